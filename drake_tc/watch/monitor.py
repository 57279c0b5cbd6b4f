"""`ModelMonitor`: whether a model in use still holds, in the loop: which cause, how large, and what is only a push."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drake_tc.actuation.compensator import Compensator, Motion
from drake_tc.actuation.joint_effects import JointValues, Models, joint_values, model_list
from drake_tc.array_stage import Arrays, ArrayStage, PortMethods
from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import Kernel
from drake_tc.kernels.model_monitor import BEFORE, PAST
from drake_tc.kernels.torque_equations import REFERENCE_CELSIUS
from drake_tc.types import Call, FloatArray, IntArray
from drake_tc.watch.changes import Known, is_friction

CAUSES = ("friction", "torque_constant", "payload_sin", "payload_cos", "delay", "backlash", "bias")
"""Causes in the order of the codes 1 to 7 of the port `cause`; 0 is none, -1 a push."""
PASSES = (1.0, 0.25)
"""Shares of the friction and of the needed torque by which a joint may err without being pushed: it may have doubled
its friction, or lost a fifth of its torque."""
READ = ("position", "velocity", "acceleration", "load_torque", "effort")
OPTIONAL = ("external_torque", "temperature")
_WATCH = Kernel("model_monitor", "watch")


@dataclass(frozen=True)
class ModelMonitorSpec:
    """What is looked for.

    Attributes:
        friction, torque_constant: Relative changes that are to be found.
        payload: Torque of a load at the joint [N m]. bias: a constant error [N m].
        delay: [s]. backlash: whole gap between motor and link [rad], where a servo holds the motor's side.
        limit: Of the CUSUMs: rows without a change until one reaches it are about exp(limit).
        memory: Rows after which information counts 1/e.
        rest: Speed below which a row is left out [rad/s].
        reversal: Time before and after a reversal of the motion in which rows are left out [s]: half of that over which
            the signals are smoothed, since friction that jumps is smoothed in the effort alone.
        push: External torque beyond which a joint is pushed, over what a model may err by (`PASSES`) [N m].
        hold: Time after a push in which nothing is learned [s]; what was learned as long before it is taken back.
        confirm: Time in motion in which a CUSUM reaches its limit at the soonest [s].

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
    limit: float = 60.0
    memory: float = 400.0
    rest: float = 0.05
    reversal: float = 0.04
    push: float = 6.0
    hold: float = 0.3
    confirm: float = 0.4


class ModelMonitor(PortMethods, LeafSystem):
    """Watches the torque balance of n joints; C causes (`CAUSES`).

    Inputs:
        position, velocity, acceleration (n): [rad, rad/s, rad/s^2].
        load_torque (n): on the link side, measured or computed [N m].
        effort (n): of the drives [rad | A | V | N m].
        external_torque (n): of a `MomentumResidual` [N m]; optional, without it r of below. While it exceeds `push`
            and what a changed joint may err by (`PASSES`), nothing is learned.
        temperature (n): [deg C]; optional, 25.
    Outputs, from the state only:
        residual (n): whitened, of variance 1 while the model holds.
        cause (n): 0, a code of `CAUSES`, or -1 while the joint is pushed.
        change (n): of the cause: relative for friction and torque constant, else in its unit.
        statistic (n): largest CUSUM over its limit; a cause is named from 1 on and withdrawn below 1/2.
        tracked (n C): changes of all causes, joint by joint.

    With the effort y^ that the model needs, the columns phi_k = dr/dx_k of the causes, and the changes x0 by which the
    model is off from the beginning, r = (y - y^)/K - sum phi_k x0_k. Every row of m ticks, m dt about half the
    correlation time t of the model's error of deviation s, rho = exp(-2 m dt/t), and psi_k of phi_k as w of r:

        w   = (r[n] - rho r[n-m])/(s sqrt(1 - rho^2))
        g+  = max(0, g+ + clip(d_k psi_k w - (d_k psi_k)^2/2, c)),  g- likewise of -d_k     (Page, 1954)
        A   = l A + psi psi',   b = l b + psi w,           tracked x = (A + P^-1)^-1 b

    c keeps single rows from deciding: a censored log likelihood ratio bears errors that are no Gaussian noise (Huber,
    1965). P has the squares of the changes looked for and of the model's own relative deviations: recursive least
    squares with forgetting whose prior does not fade. The cause is the one whose change alone explains b best, with
    the evidence b_k^2/(2 (A_kk + 1/P_kk)) - log(1 + P_kk A_kk)/2. Rows near rest, |v| <= rest + reversal |a|, and
    during a push are left out, and what was learned shortly before it is taken back.

    phi: the model's friction; the needed torque; sin q and cos q; the rate of the needed torque, twice low-passed and
    without jumps of friction, and v/K more of a position servo, whose effort is measured from the position; 1/K
    sign(load torque)/2 of a position servo, the whole gap lying on the side on which the link pulls; 1.

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
        *,
        reference: FloatArray | None = None,
    ) -> None:
        """Declare ports and state.

        Args:
            models: Of the joints, in the order of the ports.
            deviation: Standard deviation of the model's torque error [N m], as torque_uncertainty.yaml has it.
            correlation_time: Of the same, integrated over positive and negative lags [s], as the file has it.
            spec: None: the defaults.
            dt: Period of the update [s].
            reference: (n, C) changes by which the model was off while nothing had changed (`health_of`); None: 0.

        Raises:
            ParamsError: a number that is not positive and finite, or a reference of another shape.
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
        memory = 0.5 * time  # of the first-order process with this correlation time
        row = np.maximum(np.round(memory / dt), 1.0)
        push = np.full(n, spec.push)
        self._gain, self._unknown = self._law.k_tau, np.full(n, np.nan)
        inertia = [model.inertia for model in models]
        off = np.zeros((n, len(CAUSES))) if reference is None else np.asarray(reference, dtype=np.float64)
        if off.shape != (n, len(CAUSES)) or not np.isfinite(off).all():
            raise ParamsError(
                f"ModelMonitor: reference: expected {n} rows of {len(CAUSES)} finite numbers, got shape {off.shape}"
            )
        servo = np.array([model.drive.kind == "position_servo" for model in models])
        stiffness = servo / self._gain
        self._joints = np.column_stack([error, np.exp(-row * dt / memory), row, push, self._gain, inertia, stiffness])
        looked = [spec.friction, spec.torque_constant, spec.payload, spec.payload, spec.delay, spec.backlash, spec.bias]
        sizes = np.tile(looked, (n, 1))
        sizes[:, CAUSES.index("backlash")] *= servo
        known = np.zeros_like(sizes)
        known[:, 0] = [_relative_deviation(model) for model in models]
        self._sizes = np.hstack([sizes, np.hypot(sizes, known), off])
        hold = np.ceil(spec.hold / dt)
        keep, confirm = np.exp(-1.0 / spec.memory), spec.confirm / dt
        self._numbers = np.array([keep, spec.limit, hold, spec.rest, dt, confirm, *PASSES, spec.reversal])
        self._width = len(CAUSES)
        self._warm = np.full(n, REFERENCE_CELSIUS)
        self._declare(n)

    def _declare(self, n: int) -> None:
        """Ports, state and event; the state is that of the kernel, and its outputs."""
        self._ports: dict[str, Any] = {name: self.DeclareVectorInputPort(name, n) for name in (*READ, *OPTIONAL)}
        memory, shown = self.start()
        self._parts = slice(memory.size), slice(memory.size, memory.size + shown.size)
        self._start: FloatArray = np.concatenate([memory, shown])
        start: Any = self._start
        state = self.DeclareDiscreteState(start)
        self._state = int(state)
        table = np.arange(shown.size).reshape(n, -1)
        single = {name: table[:, number] for number, name in enumerate(("residual", "cause", "change", "statistic"))}
        self._outputs = single | {"tracked": table[:, len(single) :].ravel()}
        for name, where in self._outputs.items():
            self._declare_output(name, where, state)
        self.DeclarePeriodicDiscreteUpdateEvent(self._dt, 0.0, self._update)

    def _declare_output(self, name: str, where: IntArray, state: Any) -> None:
        def calc(context: Context, output: Any) -> None:
            values: FloatArray = np.asarray(context.get_discrete_state(self._state).value())
            output.SetFromVector(values[self._parts[1]][where])

        self.DeclareVectorOutputPort(name, where.size, calc, {self.discrete_state_ticket(state)})

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""

        def bind(arrays: Arrays) -> tuple[Call, Call]:
            given, out, before, after = arrays.inputs, arrays.out, arrays.before, arrays.after
            shown = before[self._parts[1]]

            def outputs(time: float) -> None:
                out[:] = shown

            def update(time: float) -> None:
                self._step(given, after)

            return outputs, update

        inputs = frozenset(self._ports)
        return ArrayStage(
            self._start.size - self._parts[0].stop,
            self._outputs,
            bind,
            updates=inputs,
            start=self._start,
            period=self._dt,
        )

    def _update(self, context: Context, values: DiscreteValues) -> None:
        """The recursion."""
        given = {name: port.Eval(context) for name, port in self._ports.items() if port.HasValue(context)}
        self._step(given, np.asarray(values.get_mutable_value(self._state)))

    def _step(self, given: Mapping[str, FloatArray], state: FloatArray) -> None:
        """x[n+1] of x[n] in `state`, by inputs of this tick."""
        memory, shown = (state[part] for part in self._parts)
        seen = np.stack([given[name] for name in READ] + [given.get("external_torque", self._unknown)])
        self.tick(seen, self.needed(seen, given.get("temperature", self._warm)), memory, shown)

    def needed(self, seen: FloatArray, temperature: FloatArray) -> FloatArray:
        """(n,) torque for which the model asks [N m]; arguments as of `tick`, temperature (n,) [deg C]."""
        motion = Motion(position=seen[0], velocity=seen[1], acceleration=seen[2], temperature=temperature)
        effort = self._law.effort(seen[3], motion)
        return np.asarray(effort / self._gain)

    @property
    def room(self) -> FloatArray:
        """(n,) temperature that is taken where none is known [deg C]."""
        return self._warm

    def start(self) -> tuple[FloatArray, FloatArray]:
        """State and outputs of `tick` before the first one."""
        n = self._gain.size
        memory = np.zeros((n, _state_size(self._width)))
        memory[:, BEFORE] = np.nan
        return memory.ravel(), np.zeros(n * (4 + self._width))

    def tick(self, seen: FloatArray, needed: FloatArray, memory: FloatArray, shown: FloatArray) -> None:
        """One update on arrays.

        Args:
            seen: (6, n) position, velocity, acceleration, load torque, effort and external torque; the last may be NaN.
            needed: (n,) torque for which the model asks [N m].
            memory: State, flat; written.
            shown: (n (4 + C),) by joint residual, cause, change, statistic and tracked changes; written.
        """
        n = needed.size
        state, out = memory.reshape(n, -1), shown.reshape(n, -1)
        _WATCH(seen, needed, (self._joints, self._sizes, self._numbers), state, out)


def _state_size(causes: int) -> int:
    """Numbers of a joint's state, see the kernel."""
    return PAST + 2 * causes + 3 * (3 * causes + causes**2)


def _relative_deviation(model: Any) -> float:
    """Largest relative standard deviation of the frictions of a model by its intervals; 0 without."""
    found = [0.0]
    for value in model.effects:
        for name, ends in value.ci95.items():
            if is_friction(value.key) and value.parameters[name] and np.isfinite(ends).all():
                known = Known.of(value.parameters[name], ends)
                found.append(known.deviation / abs(known.value))
    return min(max(found), 1.0)
