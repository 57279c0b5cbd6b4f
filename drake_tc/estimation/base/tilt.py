"""Which way is up, from the IMU's own roll and pitch or from gyro and accelerometer.

up_I = (-sin p, cos p sin r, cos p cos r)                  of the IMU's roll r and pitch p
up+  = up - omega x up dt + push, normalized               otherwise

    push = dt/(T + dt) (a/|a| - up) e^-((|a| - g)/0.5)^2   in the air, a the specific force
    push = dt/(T + dt) d/g /(1 + |d|^2)                    on contacts, d = (ydot_ref - ydot)/dt

On contacts the robot's own acceleration is known: the contacts' velocity ydot takes the place of that which the
accelerometer carries on, ydot_ref = ydot- + (a - g up) dt, so d = a - g up - (what the base accelerates).
"""

import math

import numpy as np

from drake_tc.types import FloatArray

GRAVITY = 9.81
_CALM = 0.5
"""How far the length of the specific force may be from gravity before it counts for little [m/s^2]."""
_JERK = 1.0
"""What contacts and accelerometer may disagree about before it counts for little [m/s^2]."""


def up_of(roll: float, pitch: float) -> FloatArray:
    """(3,) the world's vertical in the axes of a body at this roll and pitch [rad]."""
    cp = math.cos(pitch)
    return np.array([-math.sin(pitch), cp * math.sin(roll), cp * math.cos(roll)])


def turned_up(up: FloatArray, rate: FloatArray, dt: float) -> FloatArray:
    """(3,) the vertical in a body's axes after it turned with `rate` (3,) [rad/s] for `dt` [s]; to first order."""
    x, y, z = up.tolist()
    a, b, c = rate.tolist()
    return np.array([x - dt * (b * z - c * y), y - dt * (c * x - a * z), z - dt * (a * y - b * x)])


def corrected_up(up: FloatArray, push: FloatArray) -> FloatArray:
    """(3,) up + push, of unit length."""
    moved = up + push
    out: FloatArray = moved / math.sqrt(float(moved @ moved))
    return out


def filtered_up(up: FloatArray, rate: FloatArray, accel: FloatArray, dt: float, time: float) -> FloatArray:
    """(3,) the vertical after one tick in the air.

    Args:
        up: (3,) before it; as the next two, in one frame.
        rate: (3,) angular velocity [rad/s].
        accel: (3,) specific force [m/s^2].
        dt: Tick [s].
        time: Of the filter [s].
    """
    moved, length = turned_up(up, rate, dt), math.sqrt(float(accel @ accel))
    gain = dt / (time + dt) * math.exp(-(((length - GRAVITY) / _CALM) ** 2)) if length > 0.0 else 0.0
    return corrected_up(moved, gain * (accel / length - moved) if gain > 0.0 else np.zeros(3))


def tilt_correction(velocity_innovation: FloatArray, dt: float, time: float) -> FloatArray:
    """(3,) push on contacts.

    Args:
        velocity_innovation: (3,) ydot - ydot_ref [m/s].
        dt: Tick [s].
        time: T of the filter [s].
    """
    push: FloatArray = velocity_innovation / (
        -GRAVITY * (time + dt) * (1.0 + float(velocity_innovation @ velocity_innovation) / (_JERK * dt) ** 2)
    )
    return push
