"""The compensation face: the effort that makes an actuator deliver a desired link torque.

    y = inverse(K (tau_d + sum_k theta_k phi_k)) + twist(tau_d)

the torque balance of `drake_tc.effects.base` solved for the effort, drive effects undone in the order of
`drake_tc.actuation.compensator.undone`. Effects with memory in the drive (delay, lag, integrator, saturation) have no
inverse that acts now and are left to the feedback. A position servo that holds the motor's side is also led by the
gear's wind-up and play. `Compensator` is the same for all joints at one instant, for the control loop.
"""

from dataclasses import dataclass

import numpy as np

from drake_tc.actuation.compensator import Compensator, undone
from drake_tc.actuation.model import ActuatorModel
from drake_tc.effects.base import Signals, plain_signals
from drake_tc.kernels.torque_equations import REFERENCE_CELSIUS
from drake_tc.types import FloatArray

__all__ = ["Compensator", "Motion", "feedforward_effort"]


@dataclass(frozen=True)
class Motion:
    """The motion to compensate for; every array (T,).

    Attributes:
        velocity: [rad/s].
        position: [rad]; None: 0.
        acceleration: [rad/s^2]; None: 0 (rotor inertia is then not compensated).
        direction: In [-1, 1], what dry friction is scaled with; None: sign of the velocity, 0 at rest.
        temperature: [deg C]; None: 25.
    """

    velocity: FloatArray
    position: FloatArray | None = None
    acceleration: FloatArray | None = None
    direction: FloatArray | None = None
    temperature: FloatArray | None = None


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


def feedforward_effort(model: ActuatorModel, tau_d: FloatArray, motion: Motion) -> FloatArray:
    """Effort (T,) [rad | A | V | N m] for the link torque `tau_d` (T,) [N m]; a servo's command is q plus this.

    Args:
        model: The joint's actuator.
        tau_d: Desired torque on the link side.
        motion: What the joint does meanwhile.

    Returns:
        y.

    Example:
        >>> from drake_tc.actuation.compensation import Motion
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
