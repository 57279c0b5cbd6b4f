"""`TorqueControl`: desired link torques to the commands of position, current or voltage drives.

Source: Del Prete et al., 2016, eq. 10 to 14.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiscreteValues,
    LeafSystem,
    NumericParameterIndex,
)

from drake_tc.actuation.compensator import Compensator
from drake_tc.actuation.joint_effects import JointValues, Models, joint_values, model_list
from drake_tc.array_stage import Arrays, ArrayStage, PortMethods, places
from drake_tc.control.gains import TorqueGains
from drake_tc.control.torque_law import SOLUTION, CompensationSpec, TorqueLaw
from drake_tc.errors import ParamsError
from drake_tc.types import Call, FloatArray

COMPONENTS = (
    "feedforward_torque",
    "feedforward_friction",
    "feedback_position",
    "feedback_velocity",
    "feedback_acceleration",
    "feedback_force",
)
"""Names of the rows of `components` (Del Prete et al., 2016, Fig. 6)."""


class TorqueControl(PortMethods, LeafSystem):
    """Feedforward through the actuator models and proportional-integral feedback of the estimated torque.

        u     = tau_d + Kp (tau_d - tau_hat) + Ki s[n]
        tau*  = clip(u, -tau_max, tau_max) + d           d only with `disturbance=True`: a DisturbanceObserver bounds it
        s[n+1] = s[n] + dt (tau_d - tau_hat), held where u is out of its limit and the sum would push it further, where
                 the inputs are not finite, and within |Ki s| <= tau_max (anti-windup by clamping)
        y     = effort(tau*, motion) by the models' effects (`Compensator`)
        command = q + y for position servos, y for other drives

    Inputs:
        desired_torque (n): tau_d [N m].
        torque_terms (6n): of InverseDynamics [N m]; they divide the command into components, and nothing else.
        estimated_torque (n): tau_hat [N m].
        joint_estimate (3n): [q; qdot; qddot].
        position (n): q as the encoders read it now [rad].
        reference (3n): [q_d; qdot_d; qddot_d]; only where the compensation takes its motion from there.
        disturbance (n): d, torque that the drives lose beyond their models [N m]; only with `disturbance=True`.
    Outputs, with direct feedthrough of every input:
        command (n) [rad | A | V | N m].
        components (6n): rows of n, named in COMPONENTS, in effort. With K the drive gains and tau_ff the first row of
            `torque_terms`:  K tau_ff;  y - K (tau* - d);  K6 e;  K7 edot;  the rest of the torque feedback, K8 eddot
            when estimate and inverse dynamics share one model;  K9 e_f.
        integral (n): K Ki s, the seventh; the seven sum to y. Where tau* is clipped, all but the friction are scaled
            by (tau* - d)/u.
        commanded_torque (n): tau* [N m], what the drives are to deliver if their models are right.
        solution (6n): rows of n, named in SOLUTION, for one call into Python a tick.
    State s (n) [N m s]. Parameters: Kp, Ki (`set_gains`).

    An input that is not finite gives NaN outputs for the tick, which the CommandGuard behind stops; s is held.

    Source: Del Prete et al., 2016, eq. 10 to 14, where friction is viscous alone.

    Example:
        >>> models = load_models(MODELS / "hrp2_like" / "hrp2_like_leg_actuators.yaml")
        >>> control = TorqueControl(models, TorqueGains.from_servo(models), torque_limit=100.0)
        >>> control.get_command_output_port().size()
        6
    """

    def __init__(
        self,
        models: Models,
        gains: TorqueGains,
        torque_limit: JointValues,
        dt: float = 1e-3,
        compensation: CompensationSpec | None = None,
        *,
        disturbance: bool = False,
        joints: Sequence[str] | None = None,
    ) -> None:
        """Declare ports and compile the models.

        Args:
            models: One a joint, in the order of the ports or by joint.
            gains: Kp and Ki to start from; with Ki = 0 throughout there is no update and Ki stays 0.
            torque_limit: tau_max > 0 [N m], one for all joints, (n,) or by joint; infinite for none.
            dt: Period of the integral [s].
            compensation: Which motion the models are fed with; None: the defaults.
            disturbance: Declare the port `disturbance` and compensate what comes there.
            joints: Order of the ports where `models` are given by joint (`robot.joints`); None: that of the mapping.

        Raises:
            ParamsError: sizes that do not agree, or a limit or period that is not possible.
        """
        super().__init__()
        spec = CompensationSpec() if compensation is None else compensation
        models = model_list(models, joints)
        names, n = tuple(model.joint for model in models), len(models)
        compensator = Compensator(models, spec.direction_speed, spec.smoothing)
        limit = joint_values("torque_limit", torque_limit, names)
        if not np.all(limit > 0.0):
            raise ParamsError(f"torque_limit: expected {n} positive numbers [N m], got {limit.tolist()}")
        if not (math.isfinite(dt) and dt > 0.0):
            raise ParamsError(f"dt: expected a positive period [s], got {dt!r}")
        self._size, self._spec, self._dt, self._disturbed = n, spec, float(dt), disturbance
        self._names = names
        self._nothing, self._nil = np.zeros(0), np.zeros(n)
        self._law, self._k_tau = TorqueLaw(compensator, spec, limit, float(dt)), compensator.k_tau
        self._integrates = bool(np.any(gains.ki > 0.0))
        self._first_gains = self._flat(gains)
        start: Any = self._first_gains
        self._gains = int(self.DeclareNumericParameter(BasicVector(start)))
        self._declare()

    def _declare(self) -> None:
        n = self._size
        self._desired: Any = self.DeclareVectorInputPort("desired_torque", n)
        self._terms: Any = self.DeclareVectorInputPort("torque_terms", 6 * n)
        self._estimated: Any = self.DeclareVectorInputPort("estimated_torque", n)
        self._estimate: Any = self.DeclareVectorInputPort("joint_estimate", 3 * n)
        self._position: Any = self.DeclareVectorInputPort("position", n)
        self._reference: Any = self.DeclareVectorInputPort("reference", 3 * n) if self._spec.needs_reference else None
        self._lost: Any = self.DeclareVectorInputPort("disturbance", n) if self._disturbed else None
        total = self.DeclareDiscreteState(n)
        self._sum = int(total)
        tuned = self.numeric_parameter_ticket(NumericParameterIndex(self._gains))
        tickets = {tuned, self.discrete_state_ticket(total)}
        tickets |= {port.ticket() for port in (self._desired, self._estimated, self._estimate, self._position)}
        tickets |= {port.ticket() for port in (self._reference, self._lost) if port is not None}
        self._solution: Any = self.DeclareVectorOutputPort("solution", len(SOLUTION) * n, self._solve, tickets)
        divided = {*tickets, self._terms.ticket()}
        self.DeclareVectorOutputPort("command", n, self._writer("command"), tickets)
        self.DeclareVectorOutputPort("components", 6 * n, self._write_components, divided)
        self.DeclareVectorOutputPort("commanded_torque", n, self._writer("commanded_torque"), tickets)
        self.DeclareVectorOutputPort("integral", n, self._write_integral, tickets)
        if self._integrates:
            self.DeclarePeriodicDiscreteUpdateEvent(self._dt, 0.0, self._update)

    @property
    def size(self) -> int:
        """Joints n."""
        return self._size

    @property
    def k_tau(self) -> FloatArray:
        """(n,) drive gains [effort/(N m)]."""
        return self._k_tau.copy()

    def set_gains(self, context: Context, gains: TorqueGains) -> None:
        """Other Kp, Ki in this system's context (Ks, Kd, Kf are the InverseDynamics').

        Raises:
            ParamsError: gains of another size, or an integral where the system was built without.
            RuntimeError: `context` is not this system's, for example because `fuse` has removed the system.
        """
        if not self._integrates and np.any(gains.ki > 0.0):
            raise ParamsError(
                "gains.ki: expected 0, as when this TorqueControl was built; build it with ki > 0 to tune it"
            )
        self.ValidateContext(context)
        values: Any = self._flat(gains)
        context.get_mutable_numeric_parameter(self._gains).SetFromVector(values)

    def coordinate_names(self) -> tuple[str, ...]:
        """Of the state: "joint/torque_error_integral"."""
        return tuple(f"{joint}/torque_error_integral" for joint in self._names)

    def _flat(self, gains: TorqueGains) -> FloatArray:
        """[Kp; Ki]."""
        if gains.size != self._size:
            raise ParamsError(f"gains: expected {self._size} joints, got {gains.size}")
        return np.concatenate([gains.kp, gains.ki])

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports, with the gains of its construction."""
        n, gains = self._size, self._first_gains
        gains.flags.writeable = False
        names = ("desired_torque", "estimated_torque", "position", "joint_estimate")

        def bind(arrays: Arrays) -> tuple[Call, Call | None]:
            out, after, given = arrays.out, arrays.after, arrays.inputs
            desired, estimated = given["desired_torque"], given["estimated_torque"]
            optional = [given.get(name, self._nothing) for name in ("reference", "disturbance")]
            everything = (*(given[name] for name in names), *optional, gains, arrays.before)
            solution = out.reshape(len(SOLUTION), n)

            def update(time: float) -> None:
                after[:] = self._law.next_sum(arrays.before, desired - estimated, gains, solution)

            return self._law.bind(out, everything), update if self._integrates else None

        more = (["reference"] * (self._reference is not None), ["disturbance"] * (self._lost is not None))
        rows = {row: self._part(row) for row in ("command", "commanded_torque")}
        return ArrayStage(
            len(SOLUTION) * n,
            places(rows | {"solution": slice(len(SOLUTION) * n)}),
            bind,
            frozenset({*names, *more[0], *more[1]}),
            start=np.zeros(n),
            period=self._dt if self._integrates else None,
        )

    def _solve(self, context: Any, vector: Any) -> None:
        """The rows of SOLUTION."""
        inputs = [port.Eval(context) for port in (self._desired, self._estimated, self._position, self._estimate)]
        reference = self._nothing if self._reference is None else self._reference.Eval(context)
        lost = self._nothing if self._lost is None else self._lost.Eval(context)
        gains = context.get_numeric_parameter(self._gains).value()
        total = context.get_discrete_state(self._sum).value() if self._integrates else self._nil
        self._law.solve(vector.get_mutable_value(), (*inputs, reference, lost, gains, total))

    def _part(self, row: str) -> slice:
        return slice(SOLUTION.index(row) * self._size, (SOLUTION.index(row) + 1) * self._size)

    def _writer(self, row: str) -> Callable[[Context, Any], None]:
        """The calc function of an output that is a row of the solution."""
        part = self._part(row)

        def write(context: Context, vector: Any) -> None:
            vector.set_value(self._solution.Eval(context)[part])

        return write

    def _write_integral(self, context: Any, vector: Any) -> None:
        _, asked, torque, _, integral, _ = self._solved(context)
        vector.set_value(self._share(asked, torque) * integral)

    def _solved(self, context: Any) -> FloatArray:
        """(6, n) the rows of SOLUTION."""
        return np.reshape(self._solution.Eval(context), (len(SOLUTION), self._size))

    def _share(self, asked: FloatArray, torque: FloatArray) -> FloatArray:
        """K tau*/u (n,): in effort, what the limit leaves of each part."""
        clipped = torque != asked
        if not clipped.any():
            return self._k_tau
        return self._k_tau * np.divide(torque, asked, out=np.ones_like(asked), where=clipped)

    def _write_components(self, context: Any, vector: Any) -> None:
        n = self._size
        _, asked, torque, effort, integral, _ = self._solved(context)
        terms = self._terms.Eval(context).reshape(6, n)
        kp = context.get_numeric_parameter(self._gains).value()[:n]
        parts = np.empty((6, n))
        parts[0] = terms[0]
        parts[2:4] = (1.0 + kp) * terms[1:3]
        parts[5] = (1.0 + kp) * terms[3] + kp * terms[5]
        parts[4] = asked - parts[0] - parts[2] - parts[3] - parts[5] - integral
        parts *= self._share(asked, torque)
        parts[1] = effort - self._k_tau * torque
        vector.set_value(parts.ravel())

    def _update(self, context: Any, values: DiscreteValues) -> None:
        """s[n+1]."""
        held: Any = values
        error = self._desired.Eval(context) - self._estimated.Eval(context)
        gains = context.get_numeric_parameter(self._gains).value()
        before = context.get_discrete_state(self._sum).value()
        held.set_value(self._sum, self._law.next_sum(before, error, gains, self._solved(context)))
