"""Where contacts and IMU are and how they move, in the axes of the base, see `drake_tc.estimation.base.kinematics`."""

from typing import Any, NamedTuple

import numpy as np

from drake_tc.kernels.base_sample import TRANSFORM
from drake_tc.kernels.compiling import helper
from drake_tc.kernels.dynamics import BODY_WIDTH, frame_motion, frame_pose, move
from drake_tc.kernels.vectors import cross
from drake_tc.types import FloatArray


class Posture(NamedTuple):
    """Of k contacts and, behind them, the IMU; in the axes of the base.

    Attributes:
        rotation: (k + 1, 3, 3) R_BC.
        position: (k + 1, 3) p_BC [m].
        rate: (k + 1, 3) omega_BC against the base [rad/s], or omega_b + omega_BC after `turning`.
        velocity: (k + 1, 3) v_BC [m/s], or v_BC + omega_b x p_BC.
    """

    rotation: FloatArray
    position: FloatArray
    rate: FloatArray
    velocity: FloatArray


@helper
def posture_of(q: FloatArray, qd: FloatArray, tree: tuple[Any, ...]) -> Posture:
    """Contacts and IMU against the base.

    Args:
        q: (n,) encoders [rad], in the robot's order.
        qd: (n,) their speeds [rad/s].
        tree: From `places` to `frame_bodies` of `base_sample.Estimator`.
    """
    places, constants, frames, frame_bodies = tree
    count = frame_bodies.size
    bodies, base = np.empty((places.shape[0] + 1, BODY_WIDTH)), np.zeros(13)
    base[0] = 1.0
    move(base, q, qd, places, constants, bodies)
    rotation, position = np.empty((count, 3, 3)), np.empty((count, 3))
    rate, velocity = np.empty((count, 3)), np.empty((count, 3))
    pose, motion = np.empty(12), np.empty(12)
    for i in range(count):
        frame_pose(bodies, frame_bodies[i], frames[i], pose)
        frame_motion(bodies, frame_bodies[i], pose, 9, motion)
        for a in range(3):
            for b in range(3):
                rotation[i, a, b] = pose[3 * a + b]
            position[i, a], rate[i, a], velocity[i, a] = pose[9 + a], motion[a], motion[3 + a]
    return Posture(rotation, position, rate, velocity)


@helper
def turning(posture: Posture, rate: FloatArray) -> Posture:
    """The same on a base that turns with omega_b (3,) [rad/s], in axes that do not."""
    velocity = np.empty_like(posture.velocity)
    for i in range(velocity.shape[0]):
        velocity[i] = posture.velocity[i] + cross(rate, posture.position[i])
    return Posture(posture.rotation, posture.position, posture.rate + rate, velocity)


@helper
def external_wrench(load: FloatArray, reading: FloatArray, down: FloatArray) -> FloatArray:
    """(6,) E = [f; t] at a contact, in its axes [N, N m].

    Args:
        load: (54,) what stands between sensor and contact.
        reading: (6,) [f; t] in the sensor's axes.
        down: (3,) gravity R^T g in the contact's axes [m/s^2].
    """
    out = np.zeros(6)
    for i in range(6):
        for j in range(6):
            out[i] += load[6 * i + j] * reading[j]
        for j in range(3):
            out[i] -= load[TRANSFORM + 3 * i + j] * down[j]
    return out
