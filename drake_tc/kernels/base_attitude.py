"""The base's orientation before the contacts have their say: rate, vertical, and where the gyro turns it."""

import math
from typing import NamedTuple

import numpy as np

from drake_tc.kernels.base_imu import (
    carried_to_tick,
    corrected_up,
    filtered_up,
    rest_and_bias,
    tilt_correction,
    turned_up,
    up_of,
)
from drake_tc.kernels.base_kinematics import Posture
from drake_tc.kernels.base_options import Options
from drake_tc.kernels.base_sample import Sample
from drake_tc.kernels.base_state import RESTED, STARTED, STOOD, YAW, Memory
from drake_tc.kernels.compiling import helper
from drake_tc.kernels.vectors import dot, levelled, product, times, times_transposed, turned
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


@helper
def vertical(
    before: Memory,
    sample: Sample,
    R_BI: FloatArray,
    rate: FloatArray,
    accel: FloatArray,
    bias: FloatArray,
    options: Options,
    shown: FloatArray,
    calm: bool,
) -> tuple[FloatArray, FloatArray]:
    """((3,) the vertical in B, (3,) the gyro's bias); arguments as in `attitude`."""
    roll, pitch, dt = sample.tilt[0], sample.tilt[1], options.period
    if abs(roll) < _LARGEST and abs(pitch) < _LARGEST:
        told = times(R_BI, up_of(roll, pitch))
        return (turned_up(told, rate, options.imu_age) if options.imu_age else told), bias
    if not before.scalars[STARTED]:
        length, up = math.sqrt(dot(accel, accel)), np.zeros(3)
        up[2] = 1.0
        return (accel / length if length > 0.0 else up), bias
    time = options.tilt_time * (_CALM if calm else 1.0)
    if not before.scalars[STOOD]:
        return filtered_up(before.rotation[2], rate, accel, dt, time), bias
    moved = turned_up(before.rotation[2], rate, dt)
    push = tilt_correction(before.velocity_innovation, dt, time)
    if dot(shown, shown) > 0.0:
        push = push + (dt / options.sole_time) * (shown - moved)
    if not calm:
        turned_by = turned_up(moved, push, 1.0) - moved  # up x push
        learnt = bias + times_transposed(R_BI, turned_by / options.bias_time)
        bias = learnt if dot(learnt, learnt) < LARGEST_BIAS**2 else bias
    return corrected_up(moved, push), bias


@helper
def attitude(posture: Posture, before: Memory, sample: Sample, options: Options, shown: FloatArray) -> Attitude:
    """Rate, vertical and yaw increment of one tick.

    omega_b = R_BI (gyro - bias) - omega_BI; the yaw angle turns at (omega_y u_y + omega_z u_z)/(u_y^2 + u_z^2), u the
    vertical in B (which is psidot = (omega_y sin r + omega_z cos r)/cos p).

    Args:
        posture: The IMU, and how it moves, against the base.
        before: The state before the tick.
        sample: Readings after validation.
        options: Of the estimator.
        shown: (3,) the vertical in B that soft soles show on a level ground; zero: they show none.
    """
    R_BI, dt = posture.rotation[-1], options.period
    rested, quiet, bias = rest_and_bias(before, sample, options)
    reading, trail = np.empty(6), before.trail.copy()
    reading[:3], reading[3:] = sample.gyro, sample.accel
    if options.imu_age and not sample.imu_missing:
        if not trail.any():
            trail = reading.copy()
        reading, trail = carried_to_tick(reading, trail, options.imu_age, dt)
    rate = times(R_BI, reading[:3] - bias) - posture.rate[-1]
    accel = times(R_BI, reading[3:])
    calm = rested > before.scalars[RESTED]
    up, bias = vertical(before, sample, R_BI, rate, accel, bias, options, shown, calm)
    level, turn = levelled(up), 0.0
    if before.scalars[STARTED]:
        turn = dt * (rate[1] * up[1] + rate[2] * up[2]) / max(up[1] * up[1] + up[2] * up[2], 0.01)
    predicted = product(turned(before.scalars[YAW] + turn), level)
    return Attitude(rate, accel, up, level, turn, predicted, bias, times_transposed(R_BI, up), trail, rested, quiet)
