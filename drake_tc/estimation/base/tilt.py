"""Which way is up, from the IMU's own roll and pitch or from gyro and accelerometer.

up_I = (-sin p, cos p sin r, cos p cos r)                  of the IMU's roll r and pitch p
up+  = up - omega x up dt + k (a/|a| - up), normalized     otherwise; k = dt/tilt_time e^-((|a| - g)/0.5)^2
"""

import math

import numpy as np

from drake_tc.types import FloatArray

GRAVITY = 9.81
_CALM = 0.5
"""How far the length of the specific force may be from gravity before it counts for little [m/s^2]."""


def up_of(roll: float, pitch: float) -> FloatArray:
    """(3,) the world's vertical in the axes of a body at this roll and pitch [rad]."""
    cp = math.cos(pitch)
    return np.array([-math.sin(pitch), cp * math.sin(roll), cp * math.cos(roll)])


def filtered_up(up: FloatArray, rate: FloatArray, accel: FloatArray, dt: float, time: float) -> FloatArray:
    """(3,) the vertical after one tick.

    Args:
        up: (3,) before it; as the next two, in one frame.
        rate: (3,) angular velocity [rad/s].
        accel: (3,) specific force [m/s^2].
        dt: Tick [s].
        time: Of the filter [s].
    """
    length = math.sqrt(float(accel @ accel))
    gain = dt / (time + dt) * math.exp(-(((length - GRAVITY) / _CALM) ** 2)) if length > 0.0 else 0.0
    moved = np.array(
        [
            up[0] - dt * (rate[1] * up[2] - rate[2] * up[1]),
            up[1] - dt * (rate[2] * up[0] - rate[0] * up[2]),
            up[2] - dt * (rate[0] * up[1] - rate[1] * up[0]),
        ]
    )
    if gain > 0.0:
        moved += gain * (accel / length - moved)
    out: FloatArray = moved / math.sqrt(float(moved @ moved))
    return out
