"""`ModelMonitor`: whether a model in use still holds, in the loop: which cause, how large, and what is only a push."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drake_tc.actuation.compensator import Compensator
from drake_tc.actuation.joint_effects import JointValues, Models, joint_values, model_list
from drake_tc.array_stage import PortMethods
from drake_tc.errors import ParamsError
from drake_tc.kernels.lazy import Kernel
from drake_tc.kernels.torque_equations import REFERENCE_CELSIUS
from drake_tc.types import FloatArray
from drake_tc.watch.changes import Known, is_friction

CAUSES = ("friction", "torque_constant", "payload_sin", "payload_cos", "delay", "backlash", "bias")
"""Causes in the order of the codes 1 to 7 of the port `cause`; 0 is none, -1 a push."""
_WATCH = Kernel("model_monitor", "watch")


@dataclass(frozen=True)
class ModelMonitorSpec:
    """What is looked for.

    Attributes:
        friction, torque_constant: Relative changes that are to be found.
        payload: Torque of a load at the joint [N m]. bias: a constant error [N m].
        delay: [s]. backlash: gap between motor and link [rad], where a servo holds the link's side.
        limit: Of the CUSUMs: rows without a change until one reaches it are about exp(limit).
        memory: Rows after which information counts 1/e.
        rest: Speed below which a row is left out [rad/s].
        push: External torque beyond which a joint is pushed, over its Coulomb friction [N m].
        hold: Time after a push in which nothing is learned [s]; what was learned as long before it is taken back.
        confirm: Time for which a CUSUM is over its limit before a cause is named [s].

    Example:
        >>> ModelMonitorSpec(friction=0.1).friction
        0.1
    """

    friction: float = 0.2
    torque_constant: float = 0.1
    payload: float = 2.0
    bias: float = 1.0
    delay: float = 4e-3
    backlash: float = 1e-3
    limit: float = 40.0
    memory: float = 400.0
    rest: float = 0.05
    push: float = 6.0
    hold: float = 0.3
    confirm: float = 0.1


class ModelMonitor(PortMethods, LeafSystem):
    """Watches the torque balance of n joints; C causes (`CAUSES`).

    Inputs:
        position, velocity, acceleration (n): [rad, rad/s, rad/s^2].
        load_torque (n): on the link side, measured or computed [N m].
        effort (n): of the drives [rad | A | V | N m].
        external_torque (n): of a `MomentumResidual` [N m]; optional. Beyond `push` nothing is learned.
        temperature (n): [deg C]; optional, 25.
    Outputs, from the state only:
        residual (n): whitened, of variance 1 while the model holds.
        cause (n): 0, a code of `CAUSES`, or -1 while the joint is pushed.
        change (n): of the cause: relative for friction and torque constant, else in its unit.
        statistic (n): largest CUSUM over its limit; a cause is named from 1 on and withdrawn below 1/2.
        tracked (n C): changes of all causes, joint by joint.

    With the effort y^ that the model needs, r = (y - y^)/K and the columns phi_k = dr/dx_k of the causes, every row of
    m ticks, m dt about the correlation time of the model's error of deviation s:

        w   = (r[n] - rho r[n-m])/(s sqrt(1 - rho^2)),     psi_k likewise of phi_k
        g+  = max(0, g+ + d_k psi_k w - (d_k psi_k)^2/2),  g- likewise of -d_k              (Page, 1954)
        A   = l A + psi psi',   b = l b + psi w,           tracked x = (A + P^-1)^-1 b

    P has the squares of the changes looked for and of the model's own relative deviations: recursive least squares with
    forgetting whose prior does not fade. The cause is the one whose change alone explains b best, with the evidence
    b_k^2/(2 (A_kk + 1/P_kk)) - log(1 + P_kk A_kk)/2. Rows near rest and during
    a push are left out, and what was learned shortly before it is taken back.

    phi: the model's friction; the needed torque; sin q and cos q; its rate; 1/K sign(needed torque) of a position
    servo; 1.

    Example:
        >>> models = load_models(MODELS / "hrp2_like" / "hrp2_like_leg_actuators.yaml")
        >>> ModelMonitor(models, deviation=0.5, correlation_time=0.02).get_cause_output_port().size()
        6
    """

    def __init__(
        self,
        models: Models,
        deviation: JointValues,
        correlation_time: JointValues,
        spec: ModelMonitorSpec | None = None,
        dt: float = 1e-3,
    ) -> None:
        """Declare ports and state.

        Args:
            models: Of the joints, in the order of the ports.
            deviation: Standard deviation of the model's torque error [N m], as torque_uncertainty.yaml has it.
            correlation_time: Of the same [s].
            spec: None: the defaults.
            dt: Period of the update [s].

        Raises:
            ParamsError: a number that is not positive and finite.
        """
        super().__init__()
        models = model_list(models)
        spec = ModelMonitorSpec() if spec is None else spec
        self._law = Compensator(models, direction_speed=0.25 * spec.rest, smoothing=0.0)
        names = list(self._law.joints)
        error = joint_values("deviation", deviation, names)
        time = joint_values("correlation_time", correlation_time, names)
        for name, values in (("deviation", error), ("correlation_time", time), ("dt", np.array([dt]))):
            if not np.all(np.isfinite(values) & (values > 0.0)):
                raise ParamsError(f"ModelMonitor: {name}: expected positive numbers, got {values.tolist()}")
        n, self._dt = len(models), float(dt)
        row = np.maximum(np.round(time / dt), 1.0)
        friction = np.array([_friction(model) for model in models])
        push = spec.push + friction
        self._gain, self._nil = self._law.k_tau, np.zeros(n)
        inertia = [model.inertia for model in models]
        self._joints = np.column_stack([error, np.exp(-row * dt / time), row, push, self._gain, inertia])
        servo = np.array([model.drive.kind == "position_servo" for model in models])
        looked = [spec.friction, spec.torque_constant, spec.payload, spec.payload, spec.delay, spec.backlash, spec.bias]
        sizes = np.tile(looked, (n, 1))
        sizes[:, CAUSES.index("backlash")] *= servo
        known = np.zeros_like(sizes)
        known[:, 0] = [_relative_deviation(model) for model in models]
        self._sizes = np.hstack([sizes, np.hypot(sizes, known)])
        hold = np.ceil(spec.hold / dt)
        self._numbers = np.array([np.exp(-1.0 / spec.memory), spec.limit, hold, spec.rest, dt, spec.confirm / dt])
        self._width = len(CAUSES)
        self._warm = np.full(n, REFERENCE_CELSIUS)
        self._declare(n)

    def _declare(self, n: int) -> None:
        """Ports, state and event; the state of a joint is that of the kernel, and one needed torque."""
        names = ("position", "velocity", "acceleration", "load_torque", "effort")
        self._ports: tuple[Any, ...] = tuple(self.DeclareVectorInputPort(name, n) for name in names)
        self._external: Any = self.DeclareVectorInputPort("external_torque", n)
        self._temperature: Any = self.DeclareVectorInputPort("temperature", n)
        arrays: tuple[Any, ...] = (*self.start(), np.full(n, np.nan))
        memory, outputs, none = arrays
        self._memory, shown = int(self.DeclareDiscreteState(memory)), self.DeclareDiscreteState(outputs)
        self._shown = int(shown)
        self._needed = int(self.DeclareDiscreteState(none))
        for number, name in enumerate(("residual", "cause", "change", "statistic")):
            self._declare_output(name, n, slice(number, number + 1), shown)
        self._declare_output("tracked", n * self._width, slice(4, 4 + self._width), shown)
        self.DeclarePeriodicDiscreteUpdateEvent(self._dt, 0.0, self._update)

    def _declare_output(self, name: str, size: int, which: slice, state: Any) -> None:
        def calc(context: Context, output: Any) -> None:
            values: FloatArray = np.asarray(context.get_discrete_state(self._shown).value())
            shown = values.reshape(-1, 4 + self._width)
            output.SetFromVector(shown[:, which].ravel())

        self.DeclareVectorOutputPort(name, size, calc, {self.discrete_state_ticket(state)})

    def _update(self, context: Context, values: DiscreteValues) -> None:
        """The recursion."""
        seen = np.stack([*(port.Eval(context) for port in self._ports), self._nil])
        if self._external.HasValue(context):
            seen[5] = self._external.Eval(context)
        warm = self._temperature.Eval(context) if self._temperature.HasValue(context) else self._warm
        needed = self.needed(seen, warm)
        places = (self._needed, self._memory, self._shown)
        last, memory, shown = (np.asarray(values.get_mutable_value(place)) for place in places)
        self.tick(seen, needed, last, memory, shown)
        last[:] = needed

    def needed(self, seen: FloatArray, temperature: FloatArray) -> FloatArray:
        """(n,) torque for which the model asks [N m]; arguments as of `tick`, temperature (n,) [deg C]."""
        effort = self._law.effort(seen[3], seen[1], None, seen[0], seen[2], temperature)
        return np.asarray(effort / self._gain)

    def start(self) -> tuple[FloatArray, FloatArray]:
        """State and outputs of `tick` before the first one."""
        n = self._gain.size
        return np.zeros(n * _state_size(self._width)), np.zeros(n * (4 + self._width))

    def tick(
        self, seen: FloatArray, needed: FloatArray, last: FloatArray, memory: FloatArray, shown: FloatArray
    ) -> None:
        """One update on arrays.

        Args:
            seen: (6, n) position, velocity, acceleration, load torque, effort and external torque.
            needed: (n,) torque for which the model asks [N m].
            last: (n,) that of the tick before; NaN at the first.
            memory: State, flat; written.
            shown: (n (4 + C),) by joint residual, cause, change, statistic and tracked changes; written.
        """
        n = needed.size
        _WATCH(
            seen, needed, last, self._joints, self._sizes, self._numbers, memory.reshape(n, -1), shown.reshape(n, -1)
        )


def _state_size(causes: int) -> int:
    """Numbers of a joint's state, see the kernel."""
    return 8 + 2 * causes + 3 * (3 * causes + causes**2)


def _friction(model: Any) -> float:
    """Coulomb friction [N m]; 0 without."""
    return sum(float(v.parameters["coulomb"]) for v in model.effects if v.key == "coulomb")


def _relative_deviation(model: Any) -> float:
    """Largest relative standard deviation of the frictions of a model by its intervals; 0 without."""
    found = [0.0]
    for value in model.effects:
        for name, ends in value.ci95.items():
            if is_friction(value.key) and value.parameters[name] and np.isfinite(ends).all():
                known = Known.of(value.parameters[name], ends)
                found.append(known.deviation / abs(known.value))
    return min(max(found), 1.0)
