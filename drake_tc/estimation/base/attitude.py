"""The base's orientation before the contacts have their say: rate, vertical, and where the gyro turns it."""

import math
from typing import NamedTuple

import numpy as np

from drake_tc.estimation.base.imu_filters import (
    carried_to_tick,
    corrected_up,
    filtered_up,
    rest_and_bias,
    tilt_correction,
    turned_up,
    up_of,
)
from drake_tc.estimation.base.kinematics import Posture
from drake_tc.estimation.base.pose import levelled, turned
from drake_tc.estimation.base.spec import BaseEstimatorSpec
from drake_tc.estimation.base.state import BaseState
from drake_tc.estimation.base.valid_sample import ValidSample
from drake_tc.types import FloatArray

_LARGEST = 10.0
"""No roll or pitch is larger [rad]."""
LARGEST_BIAS = 0.1
"""No gyro has a larger bias [rad/s]."""
_CALM = 0.2
"""Share of `tilt_time` while the robot rests."""


class Attitude(NamedTuple):
    """Of one tick.

    Attributes:
        rate: (3,) omega_b [rad/s]. accel: (3,) specific force at the IMU [m/s^2]. up: (3,) the vertical; all in B.
        level: (3, 3) R_y(pitch) R_x(roll). turn: yaw increment that the gyro says [rad].
        predicted: (3, 3) R_WB with it.
        bias: (3,) of the gyro [rad/s], and up_imu: (3,) the vertical, both in the IMU's axes.
        trail: (6,) for `imu_age`.
        rested, quiet: Of `BaseState`.
    """

    rate: FloatArray
    accel: FloatArray
    up: FloatArray
    level: FloatArray
    turn: float
    predicted: FloatArray
    bias: FloatArray
    up_imu: FloatArray
    trail: FloatArray
    rested: float
    quiet: float


def attitude(
    posture: Posture, state: BaseState, sample: ValidSample, spec: BaseEstimatorSpec, shown: FloatArray | None = None
) -> Attitude:
    """Rate, vertical and yaw increment of one tick.

    omega_b = R_BI (gyro - bias) - omega_BI; the yaw angle turns at (omega_y u_y + omega_z u_z)/(u_y^2 + u_z^2), u the
    vertical in B (which is psidot = (omega_y sin r + omega_z cos r)/cos p).

    Args:
        posture: The IMU, and how it moves, against the base.
        state: Before the tick.
        sample: Readings after validation.
        spec: Tuning.
        shown: (3,) the vertical in B that soft soles show on a level ground; None: they show none.
    """
    R_BI, against, dt = posture.rotation[-1], posture.rate[-1], spec.period
    rested, quiet, bias = rest_and_bias(state, sample, spec)
    gyro, accel, trail = sample.gyro, sample.accel, state.trail
    if spec.imu_age and not sample.imu_missing:
        reading = np.concatenate((gyro, accel))
        now, trail = carried_to_tick(reading, trail if trail.any() else reading, spec.imu_age, dt)
        gyro, accel = now[:3], now[3:]
    rate = R_BI @ (gyro - bias) - against
    accel = R_BI @ accel
    up, bias = _up(state, sample, R_BI, rate, accel, bias, spec, shown, calm=rested > state.rested)
    level = levelled(up)
    turn = 0.0
    if state.started:
        _, y, z = up.tolist()
        _, wy, wz = rate.tolist()
        turn = dt * (wy * y + wz * z) / max(y * y + z * z, 0.01)
    return Attitude(
        rate, accel, up, level, turn, turned(state.yaw + turn) @ level, bias, up @ R_BI, trail, rested, quiet
    )


def _up(
    state: BaseState,
    sample: ValidSample,
    R_BI: FloatArray,
    rate: FloatArray,
    accel: FloatArray,
    bias: FloatArray,
    spec: BaseEstimatorSpec,
    shown: FloatArray | None,
    *,
    calm: bool,
) -> tuple[FloatArray, FloatArray]:
    """((3,) the vertical in B, (3,) the gyro's bias)."""
    roll, pitch = sample.tilt.tolist()
    if abs(roll) < _LARGEST and abs(pitch) < _LARGEST:
        told: FloatArray = R_BI @ up_of(roll, pitch)
        return (turned_up(told, rate, spec.imu_age) if spec.imu_age else told), bias
    if not state.started:
        length = math.sqrt(float(accel @ accel))
        return (accel / length if length > 0.0 else np.array([0.0, 0.0, 1.0])), bias
    time = spec.tilt_time * (_CALM if calm else 1.0)
    if state.stood:
        moved = turned_up(state.rotation[2], rate, spec.period)
        push = tilt_correction(state.velocity_innovation, spec.period, time)
        if shown is not None:
            push = push + (spec.period / spec.sole_time) * (shown - moved)
        if not calm:
            turned_by = turned_up(moved, push, 1.0) - moved  # up x push
            learnt = bias + (turned_by / spec.bias_time) @ R_BI
            bias = learnt if learnt @ learnt < LARGEST_BIAS**2 else bias
        return corrected_up(moved, push), bias
    return filtered_up(state.rotation[2], rate, accel, spec.period, time), bias
