"""What a tick of the base estimator is told, its validation, and what follows from it without the estimator's state.

Missing readings and encoder spikes are replaced by the previous estimate, and flagged. Where contacts and IMU are and
how they move is in the axes of the base, see `drake_tc.estimation.base_kinematics`.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from drake_tc.kernels.base.state import STARTED, Memory
from drake_tc.kernels.compiling import INDEX, MATRIX, TABLE, VECTOR, helper, together
from drake_tc.kernels.dynamics import BODY_WIDTH, Motion, frame_motion, frame_pose, move
from drake_tc.kernels.linear_algebra import cross
from drake_tc.types import FloatArray, IntArray

FLAT, MAKE, BREAK, STIFFNESS, ORIGIN, STEP, MIDDLE, HALF_PLANES = 0, 1, 2, 3, 4, 6, 8, 10
"""Columns of a contact's row: 1 for a sole, 0 for a point; loads at which it is made and lost [N]; stiffness of a soft
sole [N/m], 0 of a rigid one; first node and step of its table [m] (2 each); middle of the sole [m] (2); then rows
[normal (2), offset [m]] of the half planes that it is made of."""
TRANSFORM, WEIGHT = 36, 54
"""Ends of the parts of a contact's load: from its sensor to it (6, 6), and weight beyond the sensor (6, 3) [kg]."""


SAMPLE = together(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR)
"""See `drake_tc.estimation.base_kinematics.Sample`."""
ESTIMATOR = together(VECTOR, MATRIX, MATRIX, MATRIX, TABLE, MATRIX, MATRIX, INDEX)


class Estimator(NamedTuple):
    """What an estimator of n joints and k contacts knows beforehand.

    Attributes:
        settings: (27,) see `Options`.
        soles: (k, w) rows of the contacts, see `FLAT` and what follows it.
        tables: (k, m m) see `base.contacts.shape_of`.
        between: (k, 54) see `external_wrench`.
        places, constants: (n, 4) and (n, 26) of the robot's tree, see `dynamics`.
        frames, frame_bodies: (k + 1, 12) and (k + 1,) of the contacts and the IMU, and rows of their bodies.
    """

    settings: FloatArray
    soles: FloatArray
    tables: FloatArray
    between: FloatArray
    places: IntArray
    constants: FloatArray
    frames: FloatArray
    frame_bodies: IntArray


class Options(NamedTuple):
    """`BaseEstimatorSpec`, with 0 or 1 for choices; whether any sole is soft; the robot's weight [N]."""

    period: float
    imu_age: float
    level: float
    touchdown: float
    velocity_time: float
    contact_velocity: float
    cop_moment: float
    position_time: float
    yaw_time: float
    yaw_bias_time: float
    bias_time: float
    tilt_time: float
    sole_time: float
    still_rate: float
    anchor_time: float
    slip_speed: float
    slip_distance: float
    slip_turn: float
    slip_time: float
    slip_hold: float
    tilted: float
    force_offset: float
    yaw_drift: float
    encoder_spike: float
    quick_start: float
    any_soft: float
    weight: float


@helper
def options_of(row: FloatArray) -> Options:
    """Names for the places of a row."""
    return Options(
        row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7], row[8], row[9], row[10], row[11], row[12],
        row[13], row[14], row[15], row[16], row[17], row[18], row[19], row[20], row[21], row[22], row[23], row[24],
        row[25], row[26],
    )  # fmt: skip


LARGEST = 1e6
"""No reading in SI units is as large; one that is counts as missing."""
_FORGET = 0.05
"""In which a speed that is no longer measured dies away [s]."""
_PATIENCE = 5
"""Ticks after which a step of an encoder that persists is taken as real."""


class Sample(NamedTuple):
    """A sample without gaps: the fields of `Readings`, and what was replaced.

    Attributes:
        q, qd, gyro, accel, tilt, wrench: As in `Readings`; `tilt` may be NaN, the others are finite.
        doubt: (n,) ticks for which each encoder has been rejected.
        has_gyro, has_accel: Whether gyro and accelerometer have readings.
        encoder_missing, encoder_spike, imu_missing, wrench_missing: What was wrong.
    """

    q: FloatArray
    qd: FloatArray
    gyro: FloatArray
    accel: FloatArray
    tilt: FloatArray
    wrench: FloatArray
    doubt: FloatArray
    has_gyro: bool
    has_accel: bool
    encoder_missing: bool
    encoder_spike: bool
    imu_missing: bool
    wrench_missing: bool


class Given(NamedTuple):
    """What a tick is given beside its sample.

    Attributes:
        soles: (k, w) rows of the contacts.
        tables: (k, m m) see `base.contacts.shape_of`.
        before: The state before the tick.
        options: Of the estimator.
    """

    soles: FloatArray
    tables: FloatArray
    before: Memory
    options: Options


@helper
def valid_sample(readings: tuple[FloatArray, ...], before: Memory, options: Options) -> Sample:
    """The sample without gaps.

    Missing encoders move on at their speed, or at their last one, which dies away; a missing gyro reads its bias, a
    missing wrench nothing. An encoder that jumps by more than `encoder_spike` and twice what its speed explains
    is rejected for five ticks, and so is its speed, also in the tick after it.

    Args:
        readings: See `SAMPLE`.
        before: The state before the tick.
        options: Of the estimator.
    """
    q, qd, imu, tilt, wrench, _ = readings
    n, dt = q.size, options.period
    angle, speed, doubt = np.empty(n), np.empty(n), np.zeros(n)
    missing = spike = False
    kept, slack = math.exp(-dt / _FORGET), options.encoder_spike + 2.0 * dt
    for j in range(n):
        last, rate, doubted = before.q[j], before.qd[j], before.doubt[j]
        seen, moving = abs(q[j]) < LARGEST, abs(qd[j]) < LARGEST
        missing = missing or not (seen and moving)
        v = qd[j] if moving else kept * rate
        x = q[j] if seen else last + dt * v
        if before.scalars[STARTED]:
            impatient = doubted < _PATIENCE
            jumps = impatient and abs(x - last) > slack + 2.0 * dt * abs(rate)
            doubtful = jumps or (impatient and doubted > 0.0)
            spike = spike or doubtful
            if jumps:
                x = last
                doubt[j] = doubted + 1.0
            if doubtful:
                v = rate
        else:
            doubt[j] = doubted
        angle[j], speed[j] = x, v
    has_gyro, has_accel, missing_wrench = True, True, False
    gyro, accel, loads = np.empty(3), np.zeros(3), np.zeros(wrench.size)
    for i in range(3):
        has_gyro = has_gyro and abs(imu[i]) < LARGEST
        has_accel = has_accel and abs(imu[3 + i]) < LARGEST
    for i in range(3):
        gyro[i] = imu[i] if has_gyro else before.bias[i]
        if has_accel:
            accel[i] = imu[3 + i]
    for i in range(wrench.size):
        if abs(wrench[i]) < LARGEST:
            loads[i] = wrench[i]
        else:
            missing_wrench = True
    whole = has_gyro and has_accel
    return Sample(
        angle, speed, gyro, accel, tilt, loads, doubt, has_gyro, has_accel, missing, spike, not whole, missing_wrench
    )


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
        tree: From `places` to `frame_bodies` of `Estimator`.
    """
    places, constants, frames, frame_bodies = tree
    count = frame_bodies.size
    bodies, base = np.empty((places.shape[0] + 1, BODY_WIDTH)), np.zeros(13)
    base[0] = 1.0
    move(Motion(base, q, qd), places, constants, bodies)
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
