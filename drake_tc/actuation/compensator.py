"""`Compensator`: `feedforward_effort` for all joints of a robot at one instant, compiled once from their models.

    y = inverse(K (tau + level d + damping v + rest + J a)) + twist(tau)

with the parts of each effect's kernel (`drake_tc.effects.kernel`); parts that never change are summed beforehand. A
test holds this to `feedforward_effort`, effect by effect.
"""

import math
from collections.abc import Callable, Mapping
from typing import TypeAlias

import numpy as np

from drake_tc.actuation.constant_parts import split_parts
from drake_tc.actuation.joint_values import JointValues, Models, joint_values, model_list
from drake_tc.actuation.model import ActuatorModel
from drake_tc.effects.base import DriveEffect
from drake_tc.effects.deadzone import Deadzone
from drake_tc.effects.thermal_friction import REFERENCE_CELSIUS
from drake_tc.effects.velocity_sign_switch import VelocitySignSwitch
from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray

JointLaw: TypeAlias = Callable[[float, float, float, float, float, float], float]
"""(tau, velocity, direction, position, acceleration, temperature) of one joint to its effort."""
Inverse: TypeAlias = Callable[[float, float], float]
"""(desired effort, direction) to the effort to ask for."""


def undone(model: ActuatorModel) -> list[tuple[DriveEffect, Mapping[str, float]]]:
    """Drive effects in the order in which they are undone.

    Those that transform the effort last to first, then those that add to it in parallel (`drake_tc.effects.base`): with
    a dead zone and a switch, y* = y - w sign(y) + s d y is solved by y = (y* + w sign(y*))/(1 + s d) wherever the drive
    is out of its dead zone, in whichever order the two are listed.
    """
    last_to_first = list(reversed(model.drive_effects))
    parallel = [pair for pair in last_to_first if pair[0].coefficients]
    return [pair for pair in last_to_first if not pair[0].coefficients] + parallel


def _soft_sign(value: float, width: float) -> float:
    """clip(value/width, -1, 1); the sign for width 0."""
    if value > width:
        return 1.0
    if value < -width:
        return -1.0
    return value / width if width else 0.0


def _deadzone_inverse(parameters: Mapping[str, float], smoothing: float) -> Inverse:
    width = parameters["deadzone"]

    def invert(effort: float, direction: float) -> float:
        if effort > smoothing:
            return effort + width
        if effort < -smoothing:
            return effort - width
        return effort + width * effort / smoothing if smoothing else effort

    return invert


def _switch_inverse(parameters: Mapping[str, float]) -> Inverse:
    switch = parameters["switch"]

    def invert(effort: float, direction: float) -> float:
        gain = 1.0 + switch * direction
        return effort / gain if gain > 1e-6 or gain < -1e-6 else effort

    return invert


def _inverse(effect: DriveEffect, parameters: Mapping[str, float], smoothing: float) -> Inverse | None:
    """The effect's inverse on plain floats; None where it has none."""
    if type(effect).inverse is DriveEffect.inverse:
        return None
    if type(effect) is Deadzone:
        return _deadzone_inverse(parameters, smoothing)
    if type(effect) is VelocitySignSwitch:
        return _switch_inverse(parameters)
    return lambda effort, direction: float(effect.inverse(np.array([effort]), np.array([direction]), parameters)[0])


def _joint_law(model: ActuatorModel, smoothing: float) -> JointLaw:
    gain, inertia = model.drive.gain, model.inertia
    (level, damping, rest), kernels = split_parts(model)
    undo = [_inverse(effect, parameters, smoothing) for effect, parameters in undone(model)]
    inverses = tuple(inverse for inverse in undo if inverse is not None)
    gears = [effect.transmission(parameters) for effect, parameters in model.transmission_effects]
    led = bool(gears) and model.drive.kind == "position_servo"
    compliance = sum(gear.compliance for gear in gears)
    half_gap = sum(gear.half_gap for gear in gears)

    def law(tau: float, v: float, direction: float, q: float, a: float, celsius: float) -> float:
        torque = tau + level * direction + damping * v + rest + inertia * a
        for kernel in kernels:
            dry, wet, other = kernel(q, v, direction, tau, celsius, direction)
            torque += dry * direction + wet * v + other
        effort = gain * torque
        for invert in inverses:
            effort = invert(effort, direction)
        return effort + compliance * tau + half_gap * _soft_sign(gain * tau, smoothing) if led else effort

    return law


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
        self._laws = tuple(_joint_law(model, width) for model, width in zip(models, widths, strict=True))
        self._speed = direction_speed
        self._nil = (0.0,) * len(models)
        self._room = (REFERENCE_CELSIUS,) * len(models)

    @property
    def joints(self) -> tuple[str, ...]:
        """The joints' names, in the order of every array."""
        return self._joints

    @property
    def k_tau(self) -> FloatArray:
        """(n,) the drives' gains K [rad/(N m) | A/(N m) | V/(N m)]."""
        return np.array(self._gains)

    @property
    def laws(self) -> tuple[JointLaw, ...]:
        """One function a joint on plain floats, for a loop that goes through the joints anyway."""
        return self._laws

    def direction(self, velocity: FloatArray) -> FloatArray:
        """(n,) in [-1, 1]: tanh(v/v_s), the sign of v for v_s = 0; what `effort` takes where it is given none."""
        return np.tanh(velocity / self._speed) if self._speed else np.sign(velocity)

    def effort(
        self,
        tau: FloatArray,
        velocity: FloatArray,
        direction: FloatArray | None = None,
        position: FloatArray | None = None,
        acceleration: FloatArray | None = None,
        temperature: FloatArray | None = None,
    ) -> FloatArray:
        """Effort (n,) [rad | A | V | N m] for the link torques `tau`; a servo's command is q plus this.

        Args:
            tau: Desired torques on the link side (n,) [N m].
            velocity: (n,) [rad/s].
            direction: (n,) in [-1, 1], what dry friction is scaled with; None: see `direction`.
            position: (n,) [rad]; None: 0.
            acceleration: (n,) [rad/s^2]; None: 0 (rotor inertia is then not compensated).
            temperature: (n,) [deg C]; None: 25.

        Returns:
            y; NaN for a joint whose inputs are.
        """
        ways = self.direction(velocity) if direction is None else direction
        joints = zip(
            self._laws,
            tau.tolist(),
            velocity.tolist(),
            ways.tolist(),
            self._nil if position is None else position.tolist(),
            self._nil if acceleration is None else acceleration.tolist(),
            self._room if temperature is None else temperature.tolist(),
            strict=True,
        )
        return np.array([law(t, v, d, q, a, celsius) for law, t, v, d, q, a, celsius in joints])
