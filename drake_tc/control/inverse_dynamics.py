"""`InverseDynamics`: the torque that a reference motion and contact force ask of the joints.

Source: Del Prete et al., 2016, eq. 10 to 14.
"""

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, LeafSystem, NumericParameterIndex, ValueProducer

from drake_tc.array_stage import Arrays, ArrayStage, PortMethods, places
from drake_tc.config.records import Checked
from drake_tc.control.dynamics_terms import BaseRotation, DynamicsTerms, FloatingTerms
from drake_tc.control.gains import TorqueGains
from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import MOTION, Kernel, KernelCall
from drake_tc.robot.robot import Robot
from drake_tc.types import Call, FloatArray

_MOTION_TORQUE = Kernel("joint_torque", "motion_torque")
TERMS = ("feedforward", "position", "velocity", "force", "acceleration_error", "force_error")
"""Names of the rows of `torque_terms`."""


class _Parts(NamedTuple):
    """M qddot_d + h (n,), its sum with Ks e and Kd edot (n,), these two (2n,), f_d and e_f (6k,)."""

    inertial: FloatArray
    torque: FloatArray
    feedback: FloatArray
    desired: FloatArray
    unmet: FloatArray


class _Given(NamedTuple):
    """The inputs: estimate and reference (3n,), f_d and f_hat (6k,), the base's (12,) and (3n,), position, gains."""

    estimate: FloatArray
    reference: FloatArray
    desired: FloatArray
    felt: FloatArray
    base: tuple[FloatArray, ...]
    position: FloatArray
    gains: FloatArray


@dataclass(frozen=True)
class MotionSources(Checked):
    """Where the inverse dynamics takes the robot's motion from.

    Attributes:
        configuration: q and v at which M, h and J are taken.
        position_error: q in e.
        angular_acceleration: Of a base that floats: the derivative of its "gyro", or "neglected".

    Raises:
        ParamsError: another source than these.

    Example:
        >>> MotionSources(position_error="encoder").configuration
        'estimate'
    """

    configuration: Literal["estimate", "reference"] = "estimate"
    position_error: Literal["estimate", "encoder"] = "estimate"
    angular_acceleration: BaseRotation = "gyro"


class InverseDynamics(PortMethods, LeafSystem):
    """tau_d = M qddot_d + h - J^T (f_d + Kf e_f) + Ks e + Kd edot, for a base that is welded or floats.

    e = q_d - q, edot = qdot_d - qdot, e_f = f_d - f_hat; M, h (gravity included) and J at the estimated, hence as a
    rule delayed, or at the reference configuration; M is of the links alone, rotors belong to the drives. Under a base
    that floats h also holds what its motion, as the IMU has it, asks of the joints (`FloatingTerms`).

    Inputs:
        joint_estimate (3n): [q; qdot; qddot] as filtered [rad, rad/s, rad/s^2].
        reference (3n): [q_d; qdot_d; qddot_d].
        force_reference (6k): f_d, the desired wrench [f; t] on each contact body at its contact frame, base axes.
        contact_wrench (6k): f_hat, the same as measured.
            Both only with `force_task`.
        position (n): q as the encoders read it now [rad]; only with `position_error="encoder"`.
        imu_estimate (12): [gyro; accel; their derivatives] as filtered; only with a base that floats, as the next one.
        base_joint_estimate (3n): the joints' motion at the IMU's instant, for joints between IMU and base.
    Outputs, with direct feedthrough of every input, no state:
        desired_torque (n): tau_d [N m].
        feedforward_torque (n): M qddot_d + h - J^T f_d [N m], the first row of `torque_terms`.
        torque_terms (6n): rows of n [N m], named in TERMS:
            M qddot_d + h - J^T f_d; Ks e; Kd edot; -J^T Kf e_f; M (qddot_d - qddot); -J^T e_f.
            The first four sum to tau_d; the last two are what feedback on an estimated torque acts on.
    Parameters: Ks, Kd, Kf (`set_gains`).

    An input that is not finite gives NaN outputs for the tick, which the CommandGuard behind stops.

    Source: Del Prete et al., 2016, eq. 12. The paper has e from the delayed estimate; `position_error="encoder"` takes
    away that delay.

    Example:
        >>> robot = load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")
        >>> gains = TorqueGains.from_servo(load_models(robot.actuators))
        >>> InverseDynamics(robot, gains, force_task=False).get_desired_torque_output_port().size()
        6
    """

    def __init__(
        self,
        robot: Robot,
        gains: TorqueGains,
        sources: MotionSources | None = None,
        *,
        force_task: bool = True,
    ) -> None:
        """Declare ports and build the model.

        Args:
            robot: Welded, or floating with an IMU.
            gains: Ks, Kd, Kf to start from; Kf (6k, 6k), or (0, 0) for none.
            sources: Where the motion comes from; None: from the estimate.
            force_task: Whether a contact force is desired or fed back; False leaves out the two ports, f_d = e_f = 0.

        Raises:
            ParamsError: a floating base without IMU, or gains of another size.
        """
        super().__init__()
        sources = MotionSources() if sources is None else sources
        model = DynamicsTerms(robot) if robot.fixed_base else FloatingTerms(robot, sources.angular_acceleration)
        self._model: Any = model
        n, m = model.size, model.wrenches
        self._size, self._wrenches, self._force_task = n, m, force_task
        self._at_reference = sources.configuration == "reference"
        self._first_gains = self._flat(gains)
        start: Any = self._first_gains
        self._gains = int(self.DeclareNumericParameter(BasicVector(start)))
        self._estimate: Any = self.DeclareVectorInputPort("joint_estimate", 3 * n)
        self._reference: Any = self.DeclareVectorInputPort("reference", 3 * n)
        wrenches = (("force_reference", m), ("contact_wrench", m)) if force_task else ()
        self._forces: tuple[Any, ...] = tuple(self.DeclareVectorInputPort(*port) for port in wrenches)
        self._position: Any = (
            self.DeclareVectorInputPort("position", n) if sources.position_error == "encoder" else None
        )
        base = (("imu_estimate", 12), ("base_joint_estimate", 3 * n))
        self._base: Any = () if robot.fixed_base else tuple(self.DeclareVectorInputPort(*port) for port in base)
        tickets = {port.ticket() for port in self._ports()}
        tickets.add(self.numeric_parameter_ticket(NumericParameterIndex(self._gains)))
        self._no_wrench, self._lost, self._nothing = np.zeros(m), np.full(n, np.nan), np.zeros(0)
        self._scratch: Any = self.DeclareCacheEntry(
            "scratch",
            ValueProducer(allocate=lambda: Value(model.create_scratch()), calc=lambda context, value: None),
            {self.nothing_ticket()},
        )
        self.DeclareVectorOutputPort("desired_torque", n, self._write_desired, tickets)
        self.DeclareVectorOutputPort("feedforward_torque", n, self._write_feedforward, tickets)
        self.DeclareVectorOutputPort("torque_terms", 6 * n, self._write_terms, tickets)

    @property
    def size(self) -> int:
        """Joints n."""
        return self._size

    def set_gains(self, context: Context, gains: TorqueGains) -> None:
        """Other Ks, Kd, Kf in this system's context (Kp, Ki are the TorqueControl's).

        Raises:
            ParamsError: gains of another size, or Kf other than 0 without a force task.
            RuntimeError: `context` is not this system's, for example because `fuse` has removed the system.
        """
        self.ValidateContext(context)
        values: Any = self._flat(gains)
        context.get_mutable_numeric_parameter(self._gains).SetFromVector(values)

    def _flat(self, gains: TorqueGains) -> FloatArray:
        """[Ks; Kd; Kf]."""
        n, m = self._size, self._wrenches
        if gains.size != n:
            raise ParamsError(f"gains: expected {n} joints, got {gains.size}")
        kf = gains.kf if gains.kf.size else np.zeros((m, m))
        if kf.shape != (m, m):
            raise ParamsError(f"gains.kf: expected shape {(m, m)}, six a force/torque sensor, got {kf.shape}")
        if not self._force_task and kf.any():
            raise ParamsError("gains.kf: expected 0, as this InverseDynamics is built without force task, got another")
        return np.concatenate([gains.ks, gains.kd, kf.ravel()])

    def _write_desired(self, context: Any, vector: Any) -> None:
        """tau_d; no mass matrix, and a Jacobian only where something is to be pushed."""
        given, scratch = self._given(context), self._scratch.Eval(context)
        vector.set_value(self._desired(given, scratch))

    def _desired(self, given: _Given, scratch: Any) -> FloatArray:
        parts = self._parts(given, scratch)
        if parts is None:
            return self._lost
        if not self._forces:
            return parts.torque
        return parts.torque - self._joint_torque(given, scratch, parts.desired + self._kf(given).dot(parts.unmet))

    def _write_feedforward(self, context: Any, vector: Any) -> None:
        given, scratch = self._given(context), self._scratch.Eval(context)
        parts = self._parts(given, scratch)
        if parts is None:
            vector.set_value(self._lost)
            return
        vector.set_value(parts.inertial - self._joint_torque(given, scratch, parts.desired))

    def _write_terms(self, context: Any, vector: Any) -> None:
        """The rows of TERMS; computed where they are asked for, in a log as a rule."""
        n, given, scratch = self._size, self._given(context), self._scratch.Eval(context)
        parts = self._parts(given, scratch)
        if parts is None:
            vector.set_value(np.full(6 * n, np.nan))
            return
        terms = np.empty((6, n))
        terms[0] = parts.inertial - self._joint_torque(given, scratch, parts.desired)
        terms[1:3] = parts.feedback.reshape(2, n)
        terms[3] = -self._joint_torque(given, scratch, self._kf(given).dot(parts.unmet))
        terms[4] = parts.inertial - self._model.forces(self._placed(given, scratch), given.estimate[2 * n :])
        terms[5] = -self._joint_torque(given, scratch, parts.unmet)
        vector.set_value(terms.ravel())

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports, with the gains of its construction; `desired_torque` alone."""
        gains = self._first_gains
        gains.flags.writeable = False
        names = [port.get_name() for port in self._ports()]

        n, plain = self._size, not (self._forces or self._base)

        def bind(arrays: Arrays) -> tuple[Call, None]:
            scratch, out, desired = self._model.create_scratch(), arrays.out, arrays.out[n : 2 * n]
            given = self._gathered([arrays.inputs[name] for name in names], gains)

            def outputs(time: float) -> None:
                desired[:] = self._desired(given, scratch)

            if plain:
                constants = *self._model.tree, self._model.base(scratch)
                return KernelCall(MOTION, outputs, *self._motion(given, self._nothing), *constants, out), None
            return outputs, None

        return ArrayStage(4 * n, places({"desired_torque": slice(n, 2 * n)}), bind, frozenset(names))

    def _ports(self) -> list[Any]:
        """All input ports, in the order of `_gathered`."""
        position = [] if self._position is None else [self._position]
        return [self._estimate, self._reference, *self._forces, *self._base, *position]

    def _given(self, context: Any) -> _Given:
        gains: FloatArray = context.get_numeric_parameter(self._gains).value()
        return self._gathered([port.Eval(context) for port in self._ports()], gains)

    def _gathered(self, values: list[FloatArray], gains: FloatArray) -> _Given:
        """The values of `_ports` by what they are."""
        forces = len(self._forces)
        position = self._nothing if self._position is None else values.pop()
        estimate, reference, *others = values
        desired, felt = others[:forces] if forces else (self._no_wrench,) * 2
        return _Given(estimate, reference, desired, felt, tuple(others[forces:]), position, gains)

    def _kf(self, given: _Given) -> FloatArray:
        """Kf (6k, 6k)."""
        return given.gains[2 * self._size :].reshape(self._wrenches, self._wrenches)

    def _joint_torque(self, given: _Given, scratch: Any, wrench: FloatArray) -> FloatArray:
        """J^T f (n,) of wrenches (6k,) at the contacts."""
        if not wrench.any():
            return np.zeros(self._size)
        return np.asarray(wrench.dot(self._model.jacobian(self._placed(given, scratch))))

    def _placed(self, given: _Given, scratch: Any) -> Any:
        """The scratch memory, at the configuration where M, h and J are taken."""
        n = self._size
        if given.base:
            self._model.carry(scratch, *given.base)
        place = given.reference if self._at_reference else given.estimate
        self._model.place(scratch, place[:n], place[n : 2 * n])
        return scratch

    def _parts(self, given: _Given, scratch: Any) -> _Parts | None:
        """What all outputs need; None where an input is not finite."""
        n, others = self._size, self._nothing
        if self._forces or given.base:
            others = np.concatenate((given.desired, given.felt, *given.base))
        if given.base:
            if not np.isfinite(others).all():
                return None
            self._model.carry(scratch, *given.base)
        out = np.empty(4 * n)
        if not _MOTION_TORQUE(self._motion(given, others), self._model.tree, self._model.base(scratch), out):
            return None
        unmet = given.desired - given.felt if self._forces else given.desired
        return _Parts(out[:n], out[n : 2 * n], out[2 * n :], given.desired, unmet)

    def _motion(self, given: _Given, others: FloatArray) -> tuple[FloatArray, ...]:
        """The first argument of the kernel `motion_torque`."""
        place = given.reference if self._at_reference else given.estimate
        return (given.estimate, given.reference, given.position, others, given.gains, place)
