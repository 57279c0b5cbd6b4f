"""The base's orientation before the contacts have their say: rate, vertical, and where the gyro turns it."""

import math
from dataclasses import dataclass

import numpy as np

from drake_tc.estimation.base.believed import Believed
from drake_tc.estimation.base.kinematics import Posture
from drake_tc.estimation.base.pose import levelled, turned
from drake_tc.estimation.base.spec import BaseEstimatorSpec
from drake_tc.estimation.base.state import BaseState
from drake_tc.estimation.base.tilt import filtered_up, up_of
from drake_tc.types import FloatArray

_LARGEST = 10.0
"""No roll or pitch is larger [rad]."""
_DOUBT = 5.0
"""Samples that a bias of zero counts for, before any is seen."""
_CALM = 0.2
"""Share of `tilt_time` while the robot stands still."""


@dataclass(frozen=True, eq=False)
class Attitude:
    """Of one tick.

    Attributes:
        rate: (3,) omega_b [rad/s]. accel: (3,) specific force at the IMU [m/s^2]. up: (3,) the vertical; all in B.
        level: (3, 3) R_y(pitch) R_x(roll). turn: yaw increment that the gyro says [rad].
        predicted: (3, 3) R_WB with it.
        bias: (3,) of the gyro [rad/s], and up_imu: (3,) the vertical, both in the IMU's axes.
        rested: Ticks that the robot has stood still so far.
    """

    rate: FloatArray
    accel: FloatArray
    up: FloatArray
    level: FloatArray
    turn: float
    predicted: FloatArray
    bias: FloatArray
    up_imu: FloatArray
    rested: float


def attitude(posture: Posture, state: BaseState, sample: Believed, spec: BaseEstimatorSpec) -> Attitude:
    """Rate, vertical and yaw increment of one tick.

    omega_b = R_BI (gyro - bias) - omega_BI; the yaw angle turns at (omega_y u_y + omega_z u_z)/(u_y^2 + u_z^2), u the
    vertical in B (which is psidot = (omega_y sin r + omega_z cos r)/cos p).

    Args:
        posture: The IMU, and how it moves, against the base.
        state: Before the tick.
        sample: What was believed.
        spec: Tuning.
    """
    R_BI, against = posture.rotation[-1], posture.rate[-1]
    rested, bias = _rest(state, sample, spec)
    rate = R_BI @ (sample.gyro - bias) - against
    accel = R_BI @ sample.accel
    up = _up(state, sample, R_BI, rate, accel, spec, calm=rested > state.rested)
    level = levelled(up)
    turn = 0.0
    if state.started:
        _, y, z = up.tolist()
        _, wy, wz = rate.tolist()
        turn = spec.period * (wy * y + wz * z) / max(y * y + z * z, 0.01)
    return Attitude(rate, accel, up, level, turn, turned(state.yaw + turn) @ level, bias, up @ R_BI, rested)


def _rest(state: BaseState, sample: Believed, spec: BaseEstimatorSpec) -> tuple[float, FloatArray]:
    """(ticks that the robot has stood still so far, (3,) bias of the gyro [rad/s])."""
    error, qd = sample.gyro - state.bias, sample.qd
    if qd @ qd > qd.size * spec.still_rate**2:  # so one of them at least is too fast
        return state.rested, state.bias
    still = np.abs(error).max() < spec.still_rate and np.abs(sample.qd).max() < spec.still_rate
    if sample.imu_missing or not still:
        return state.rested, state.bias
    rested = state.rested + 1.0
    return rested, state.bias + max(1.0 / (rested + _DOUBT), min(1.0, spec.period / spec.bias_time)) * error


def _up(
    state: BaseState,
    sample: Believed,
    R_BI: FloatArray,
    rate: FloatArray,
    accel: FloatArray,
    spec: BaseEstimatorSpec,
    *,
    calm: bool,
) -> FloatArray:
    """(3,) the vertical in B."""
    roll, pitch = sample.tilt.tolist()
    if abs(roll) < _LARGEST and abs(pitch) < _LARGEST:
        told: FloatArray = R_BI @ up_of(roll, pitch)
        return told
    length = math.sqrt(float(accel @ accel))
    if not state.started:
        return accel / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    return filtered_up(state.rotation[2], rate, accel, spec.period, spec.tilt_time * (_CALM if calm else 1.0))
