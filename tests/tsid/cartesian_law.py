"""The Cartesian laws of `FrameTask` in plain NumPy: the acceleration that brings a point or a frame to its reference.

Source: Faraji et al., 2015, section IV.B.

R_WD, omega_D, alpha_D are the reference frame D's, R_WE and omega_E those of the frame E that follows. Seen from D,

    R_DE = R_WD^T R_WE,   theta = log R_DE,   w = R_WD^T (omega_E - omega_D),

in D's axes. Differentiated in W, omega_E = omega_D + R_WD w gives, as d/dt R_WD = S(omega_D) R_WD,

    alpha_E = alpha_D + omega_D x (R_WD w) + R_WD wdot.

With wdot = -K theta - D w the error follows thetadd = -K theta - D thetad, but for terms of second order in it, however
the reference turns: for small theta, w = thetad + theta x thetad/2 + ... The paper has S(omega_D + 2 w) w in place of
S(omega_D) w, in D's axes, which is the same, as S(w) w = 0.
"""

from typing import NamedTuple

import numpy as np

from drake_tc.control.rotation import cross, rotation_vector
from drake_tc.types import FloatArray

Gain = float | FloatArray


class Turning(NamedTuple):
    """How a frame turns, in the world.

    Attributes:
        rotation: (3, 3) R_WD.
        velocity: (3,) omega [rad/s].
        acceleration: (3,) alpha [rad/s^2].
    """

    rotation: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


class RelativeTurn(NamedTuple):
    """Where a frame is and how it turns, seen from its reference and in its axes.

    Attributes:
        angles: (3,) theta [rad].
        velocity: (3,) w [rad/s].
    """

    angles: FloatArray
    velocity: FloatArray


def translation_acceleration(
    reference: FloatArray, position: FloatArray, velocity: FloatArray, stiffness: Gain, damping: Gain
) -> FloatArray:
    """The law a = a_d + K (x_d - x) + D (v_d - v) [m/s^2]; one point, or T of them.

    Args:
        reference: (..., 9) [x_d; v_d; a_d] in the world [m, m/s, m/s^2].
        position: (..., 3) x [m].
        velocity: (..., 3) v [m/s].
        stiffness: K of each axis, or of all [1/s^2].
        damping: D, the same [1/s].

    Source: Faraji et al., 2015, eq. 14.
    """
    error, lag = reference[..., :3] - position, reference[..., 3:6] - velocity
    return np.asarray(reference[..., 6:] + stiffness * error + damping * lag)


def relative_turn(reference: Turning, rotation: FloatArray, velocity: FloatArray) -> RelativeTurn:
    """Theta and w of a frame.

    Args:
        reference: D.
        rotation: (3, 3) R_WE.
        velocity: (3,) omega_E in the world [rad/s].
    """
    back = reference.rotation.T
    return RelativeTurn(rotation_vector(back.dot(rotation)), back.dot(velocity - reference.velocity))


def rotation_law(turn: RelativeTurn, stiffness: Gain, damping: Gain) -> FloatArray:
    """The law wdot = -K theta - D w (3,), in the reference's axes [rad/s^2].

    Args:
        turn: Of the frame from its reference.
        stiffness: K of each of the reference's axes, or of all [1/s^2].
        damping: D, the same [1/s].

    Source: Faraji et al., 2015, eq. 15.
    """
    return np.asarray(-(stiffness * turn.angles) - damping * turn.velocity)


def carried_to_world(reference: Turning, velocity: FloatArray, acceleration: FloatArray) -> FloatArray:
    """alpha_E = alpha_D + omega_D x (R_WD w) + R_WD wdot (3,), in the world [rad/s^2].

    Args:
        reference: D.
        velocity: (3,) w, in D's axes.
        acceleration: (3,) wdot, the derivative of w in D's axes.

    Source: Faraji et al., 2015, eq. 16.
    """
    seen = reference.rotation.dot(velocity)
    return np.asarray(reference.acceleration + cross(reference.velocity, seen) + reference.rotation.dot(acceleration))


def rotation_acceleration(
    reference: Turning, rotation: FloatArray, velocity: FloatArray, stiffness: Gain, damping: Gain
) -> FloatArray:
    """alpha_E (3,) in the world that the rotation law asks for [rad/s^2]; arguments as in its parts."""
    turn = relative_turn(reference, rotation, velocity)
    return carried_to_world(reference, turn.velocity, rotation_law(turn, stiffness, damping))
