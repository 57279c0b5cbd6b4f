"""`Compensator`: `feedforward_effort` for all joints of a robot at one instant, compiled once from their models.

    y = inverse(K (tau + level d + damping v + rest + J a)) + twist(tau)

with the parts of each effect's kernel (`drake_tc.effects.kernel`); parts that never change are summed beforehand. A
test holds this to `feedforward_effort`, effect by effect.

The compensation face: the effort that makes an actuator deliver a desired link torque.

    y = inverse(K (tau_d + sum_k theta_k phi_k)) + twist(tau_d)

the torque balance of `drake_tc.effects.base` solved for the effort, drive effects undone in the order of
`drake_tc.actuation.compensator.undone`. Effects with memory in the drive (delay, lag, integrator, saturation) have no
inverse that acts now and are left to the feedback. A position servo that holds the motor's side is also led by the
gear's wind-up and play. `Compensator` is the same for all joints at one instant, for the control loop.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.actuation.joint_effects import JointValues, Models, joint_values, model_list
from drake_tc.actuation.model import ActuatorModel, split_parts, term_tables
from drake_tc.effects.base import DriveEffect, Signals, plain_signals
from drake_tc.effects.kernel import EquationKernel
from drake_tc.errors import ParamsError
from drake_tc.kernels import torque_equations as at
from drake_tc.kernels.calls import Kernel
from drake_tc.kernels.equations import needed_torque, soft_sign
from drake_tc.kernels.joint_layout import INTERPRETED
from drake_tc.kernels.torque_equations import REFERENCE_CELSIUS, JointState
from drake_tc.types import FloatArray, IntArray

_EFFORTS = Kernel("torque_control", "efforts")


def undone(model: ActuatorModel) -> list[tuple[DriveEffect, Mapping[str, float]]]:
    """Drive effects in the order in which they are undone.

    Those that transform the effort last to first, then those that add to it in parallel (`drake_tc.effects.base`): with
    a dead zone and a switch, y* = y - w sign(y) + s d y is solved by y = (y* + w sign(y*))/(1 + s d) wherever the drive
    is out of its dead zone, in whichever order the two are listed.
    """
    last_to_first = list(reversed(model.drive_effects))
    parallel = [pair for pair in last_to_first if pair[0].coefficients]
    return [pair for pair in last_to_first if not pair[0].coefficients] + parallel


@dataclass(frozen=True)
class Motion:
    """The motion to compensate for; every array (T,), or (n,) of n joints at one instant.

    Attributes:
        velocity: [rad/s].
        position: [rad]; None: 0.
        acceleration: [rad/s^2]; None: 0 (rotor inertia is then not compensated).
        direction: In [-1, 1], what dry friction is scaled with; None: sign of the velocity, 0 at rest, or as
            the `Compensator` has it.
        temperature: [deg C]; None: 25.
    """

    velocity: FloatArray
    position: FloatArray | None = None
    acceleration: FloatArray | None = None
    direction: FloatArray | None = None
    temperature: FloatArray | None = None


class _Joint:
    """One joint's row of the tables, and its law on plain floats, which any effect has."""

    def __init__(self, model: ActuatorModel, smoothing: float) -> None:
        self.gain, self.inertia, self.smoothing = model.drive.gain, model.inertia, smoothing
        self.parts, changing = split_parts(model)
        self.kernels = tuple(law.kernel for law in changing)
        laws = (effect.inverse_law(parameters, smoothing) for effect, parameters in undone(model))
        self.inverses = tuple(law for law in laws if law is not None)
        self.servo = model.drive.kind == "position_servo"
        gears = [effect.transmission(parameters) for effect, parameters in model.transmission_effects if self.servo]
        self.compliance = sum(gear.compliance for gear in gears)
        self.half_gap = sum(gear.half_gap for gear in gears)
        self.terms = [(kernel, -1) for kernel in self.kernels if isinstance(kernel, EquationKernel)]
        self.compiled = len(self.terms) == len(self.kernels)
        self.compiled &= all(law.kind != INTERPRETED for law in self.inverses)

    def effort(self, now: JointState, acceleration: float) -> float:
        """The law where some effect has no compiled equation."""
        tau, parts = now.tau, np.array(self.parts)
        for kernel in self.kernels:
            parts += kernel(*now)
        effort = self.gain * (needed_torque(tau, now.v, now.direction, parts) + self.inertia * acceleration)
        for law in self.inverses:
            effort = law.invert(effort, now.q, now.direction)
        lead = self.half_gap * soft_sign(self.gain * tau, self.smoothing)
        return float(effort + self.compliance * tau + lead)


class Compensator:
    """Feedforward of n joints: which effort makes the actuators deliver `tau`. Holds no changing data.

    Effects with memory in the drive (delay, lag, integrator, saturation) have no inverse that acts now and are left to
    the feedback, as in `feedforward_effort`.
    """

    def __init__(self, models: Models, direction_speed: float = 0.0, smoothing: JointValues = 0.0) -> None:
        """Compile.

        Args:
            models: One a joint, in the order of every array or by joint in this order.
            direction_speed: v_s [rad/s]; where no direction is given it is tanh(v/v_s), for 0 the sign of v.
            smoothing: delta, one for all joints, (n,) or by joint [rad | A | V | N m], in each drive's own effort. The
                inverse of a dead zone of half width w jumps by 2 w at zero effort, and so does the lead over a
                backlash; within +/- delta the jump becomes a straight line, y + w clip(y/delta, -1, 1). A feedback
                loop around zero effort then sees the gain 1 + w/delta rather than an infinite one, and does not
                chatter. The desired torque is missed by at most w/K, within delta only. 0: the exact inverse.

        Raises:
            ParamsError: no joint, or a speed or smoothing that is not possible.
        """
        models = model_list(models)
        if not (math.isfinite(direction_speed) and direction_speed >= 0.0):
            raise ParamsError(f"direction_speed: expected a number >= 0 [rad/s], got {direction_speed!r}")
        given = joint_values("smoothing", smoothing, [model.joint for model in models])
        if not np.all(np.isfinite(given) & (given >= 0.0)):
            raise ParamsError(f"smoothing: expected a number or {len(models)} >= 0 [effort], got {given.tolist()}")
        widths = given.tolist()
        self._joints = tuple(model.joint for model in models)
        self._gains = tuple(model.drive.gain for model in models)
        self._laws = tuple(_Joint(model, width) for model, width in zip(models, widths, strict=True))
        self._interpreted = tuple(j for j, law in enumerate(self._laws) if not law.compiled)
        self._speed = direction_speed
        self._nil, self._room = np.zeros(len(models)), np.full(len(models), REFERENCE_CELSIUS)
        self._tables = _tables(self._laws)

    @property
    def joints(self) -> tuple[str, ...]:
        """The joints' names, in the order of every array."""
        return self._joints

    @property
    def k_tau(self) -> FloatArray:
        """(n,) the drives' gains K [rad/(N m) | A/(N m) | V/(N m)]."""
        return np.array(self._gains)

    @property
    def tables(self) -> tuple[FloatArray, FloatArray, IntArray, FloatArray]:
        """The tables of `drake_tc.kernels.torque_equations`; the largest torques are infinite."""
        joints, inverses, terms, values = self._tables
        return joints.copy(), inverses.copy(), terms.copy(), values.copy()

    @property
    def interpreted(self) -> tuple[int, ...]:
        """Joints that have an effect without compiled equation, whose efforts only `effort_of` gives."""
        return self._interpreted

    def effort_of(self, joint: int, now: JointState, acceleration: float) -> float:
        """Effort of one joint; tau is the torque that is desired, z the direction."""
        return self._laws[joint].effort(now, acceleration)

    def direction(self, velocity: FloatArray) -> FloatArray:
        """(n,) in [-1, 1]: tanh(v/v_s), the sign of v for v_s = 0; what `effort` takes where the motion has none."""
        return np.tanh(velocity / self._speed) if self._speed else np.sign(velocity)

    def effort(self, tau: FloatArray, motion: Motion) -> FloatArray:
        """Effort (n,) [rad | A | V | N m] for the link torques `tau`; a servo's command is q plus this.

        Args:
            tau: Desired torques on the link side (n,) [N m].
            motion: What the joints do, every array (n,); where it has no direction, see `direction`.

        Returns:
            y; NaN for a joint whose inputs are.
        """
        velocity, out = motion.velocity, np.empty(len(self._laws))
        ways = self.direction(velocity) if motion.direction is None else motion.direction
        places = self._nil if motion.position is None else motion.position
        rates = self._nil if motion.acceleration is None else motion.acceleration
        warm = self._room if motion.temperature is None else motion.temperature
        given = [np.ascontiguousarray(x, dtype=np.float64) for x in (tau, velocity, ways, places, rates, warm)]
        _EFFORTS(tuple(given), self._tables, out)
        for j in self._interpreted:
            t, v, d, q, a, celsius = (float(x[j]) for x in given)
            out[j] = self.effort_of(j, JointState(q, v, d, t, celsius, d), a)
        return out


def _tables(joints: Sequence[_Joint]) -> tuple[FloatArray, FloatArray, IntArray, FloatArray]:
    """See `Compensator.tables`."""
    rows = np.zeros((len(joints), at.COLUMNS))
    inverses: list[tuple[float, float]] = []
    terms: list[tuple[EquationKernel, int]] = []
    for row, joint in zip(rows, joints, strict=True):
        row[at.GAIN], row[at.LEVEL : at.LEVEL + 3], row[at.INERTIA] = joint.gain, joint.parts, joint.inertia
        row[at.COMPLIANCE], row[at.HALF_GAP], row[at.SMOOTHING] = joint.compliance, joint.half_gap, joint.smoothing
        row[at.INVERSES] = len(inverses)
        inverses += [(float(law.kind), law.number) for law in joint.inverses if joint.compiled]
        row[at.INVERSES_END], row[at.LIMIT], row[at.SERVO] = len(inverses), np.inf, joint.servo
        row[at.TERMS], row[at.TERMS_END] = len(terms), len(terms) + len(joint.terms)
        terms += joint.terms
    return rows, np.array(inverses, dtype=np.float64).reshape(-1, 2), *term_tables(terms)


def _signals(tau_d: FloatArray, motion: Motion) -> Signals:
    nil = np.zeros_like(tau_d)
    velocity = nil + motion.velocity
    optional = {
        "position": motion.position,
        "acceleration": motion.acceleration,
        "direction": np.sign(velocity) if motion.direction is None else motion.direction,
        "temperature": REFERENCE_CELSIUS if motion.temperature is None else motion.temperature,
    }
    known = {name: nil + values for name, values in optional.items() if values is not None}
    known |= {
        "velocity": velocity,
        "load_torque": tau_d,
        "expected_torque": tau_d,
        "slow_torque": tau_d,
        "travel": nil + np.inf,
    }
    return plain_signals(tau_d.size, known)


def rated_effort(model: ActuatorModel, torque: float, speed: float) -> float:
    """The largest |y| at which a drive delivers `torque` at `speed` against its friction.

    Args:
        model: The joint's actuator.
        torque: Largest torque on the link side [N m]; infinite: no bound.
        speed: Largest speed [rad/s]; infinite counts as rest.
    """
    if not np.isfinite(torque):
        return np.inf
    speed = speed if np.isfinite(speed) else 0.0
    nothing = np.zeros(2)
    motion = Motion(position=nothing, velocity=np.array([speed, -speed]), acceleration=nothing)
    return float(np.abs(feedforward_effort(model, np.array([torque, -torque]), motion)).max())


def feedforward_effort(model: ActuatorModel, tau_d: FloatArray, motion: Motion) -> FloatArray:
    """Effort (T,) [rad | A | V | N m] for the link torque `tau_d` (T,) [N m]; a servo's command is q plus this.

    Args:
        model: The joint's actuator.
        tau_d: Desired torque on the link side.
        motion: What the joint does meanwhile.

    Returns:
        y.

    Example:
        >>> from drake_tc.actuation.compensator import Motion
        >>> knee = ActuatorModel("knee", Drive("current", 0.5), (EffectValue("viscous", {"viscous": 2.0}),))
        >>> motion = Motion(position=np.zeros(1), velocity=np.ones(1), acceleration=np.zeros(1))
        >>> feedforward_effort(knee, np.array([3.0]), motion)
        array([2.5])
    """
    desired = np.atleast_1d(np.asarray(tau_d, float))
    signals = _signals(desired, motion)
    torque = desired.copy()
    for effect, parameters in model.torque_effects:
        torque += effect.torque(signals, parameters)
    effort = torque * model.drive.gain
    for drive, parameters in undone(model):
        effort = drive.inverse(effort, signals.position, signals.direction, parameters)
    if model.drive.kind == "position_servo":
        for transmission, parameters in model.transmission_effects:
            effort = effort + transmission.twist(desired, parameters)
    return effort
