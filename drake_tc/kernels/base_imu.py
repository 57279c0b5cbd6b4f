"""Filters of the IMU: the vertical, the age of readings, the gyro's bias at rest, and how fast they forget.

The vertical is taken from the IMU's own roll and pitch, or from gyro and accelerometer:

up_I = (-sin p, cos p sin r, cos p cos r)                  of the IMU's roll r and pitch p
up+  = up - omega x up dt + push, normalized               otherwise

    push = dt/(T + dt) (a/|a| - up) e^-((|a| - g)/0.5)^2   in the air, a the specific force
    push = dt/(T + dt) d/g /(1 + |d|^2)                    on contacts, d = (ydot_ref - ydot)/dt

On contacts the robot's own acceleration is known: the contacts' velocity ydot takes the place of that which the
accelerometer carries on, ydot_ref = ydot- + (a - g up) dt, so d = a - g up - (what the base accelerates).

A reading of an IMU that is `age` old is carried to the tick.
With x the reading at tick n, of the time t_n - age, and m its low pass of time T:

    slope = k (x - m)/dt,   m+ = m + k (x - m),   k = dt/(T + dt),   now = x + age slope

`now` stands for the step that ends at the tick, as the reading of a gyro does that averages over its period (and the
velocity of a discrete plant). Of a sinusoid of w [rad/s] it is, with z = e^(i w dt), the truth times

    e^(-i w age) (1 + age S),   S = (k/dt) (1 - z^-1)/(1 - (1 - k) z^-1) = i w/(1 + i w T) + O(dt)

which is off by w^2 age (T + age/2 + dt/2), to the lowest order, instead of w age. Noise grows by 1 + k age/dt in one
reading, but not in an angle: slopes telescope.

The robot rests when for `_LONG` joints and base have moved less than `still_rate` and the centres of pressure have
stayed where they usually are: a robot that rocks slowly moves its load over its soles long before its gyro tells it
from a bias.
"""

import math

import numpy as np

from drake_tc.kernels.base_options import Options
from drake_tc.kernels.base_sample import Sample
from drake_tc.kernels.base_state import ON, QUIET, RESTED, Memory
from drake_tc.kernels.compiling import helper
from drake_tc.kernels.vectors import dot
from drake_tc.types import GRAVITY, FloatArray

_CALM = 0.5
"""How far the length of the specific force may be from gravity before it counts for little [m/s^2]."""
_JERK = 1.0
"""What contacts and accelerometer may disagree about before it counts for little [m/s^2]."""
SLOPE_TIME = 5e-3
"""T of the low pass behind the slopes [s]."""
_LONG = 0.1
"""How long it must have been still [s]."""
_STRAY = 5e-3
"""How far a centre of pressure may be from its average [m]."""
_DOUBT = 0.02
"""What a bias of zero counts for, before any is seen [s]."""


@helper
def up_of(roll: float, pitch: float) -> FloatArray:
    """(3,) the world's vertical in the axes of a body at this roll and pitch [rad]."""
    out, cp = np.empty(3), math.cos(pitch)
    out[0], out[1], out[2] = -math.sin(pitch), cp * math.sin(roll), cp * math.cos(roll)
    return out


@helper
def turned_up(up: FloatArray, rate: FloatArray, dt: float) -> FloatArray:
    """(3,) the vertical in a body's axes after it turned with `rate` (3,) [rad/s] for `dt` [s]; to first order."""
    out = np.empty(3)
    out[0] = up[0] - dt * (rate[1] * up[2] - rate[2] * up[1])
    out[1] = up[1] - dt * (rate[2] * up[0] - rate[0] * up[2])
    out[2] = up[2] - dt * (rate[0] * up[1] - rate[1] * up[0])
    return out


@helper
def corrected_up(up: FloatArray, push: FloatArray) -> FloatArray:
    """(3,) up + push, of unit length."""
    moved = up + push
    return moved / math.sqrt(dot(moved, moved))


@helper
def filtered_up(up: FloatArray, rate: FloatArray, accel: FloatArray, dt: float, time: float) -> FloatArray:
    """(3,) the vertical after one tick in the air.

    Args:
        up: (3,) before it; as the next two, in one frame.
        rate: (3,) angular velocity [rad/s].
        accel: (3,) specific force [m/s^2].
        dt: Tick [s].
        time: Of the filter [s].
    """
    moved, length = turned_up(up, rate, dt), math.sqrt(dot(accel, accel))
    gain = dt / (time + dt) * math.exp(-(((length - GRAVITY) / _CALM) ** 2)) if length > 0.0 else 0.0
    push = gain * (accel / length - moved) if gain > 0.0 else np.zeros(3)
    return corrected_up(moved, push)


@helper
def tilt_correction(velocity_innovation: FloatArray, dt: float, time: float) -> FloatArray:
    """(3,) push on contacts.

    Args:
        velocity_innovation: (3,) ydot - ydot_ref [m/s].
        dt: Tick [s].
        time: T of the filter [s].
    """
    size = dot(velocity_innovation, velocity_innovation)
    return velocity_innovation / (-GRAVITY * (time + dt) * (1.0 + size / (_JERK * dt) ** 2))


@helper
def carried_to_tick(reading: FloatArray, trail: FloatArray, age: float, period: float) -> tuple[FloatArray, FloatArray]:
    """((6,) now, (6,) m of the next tick).

    Args:
        reading: (6,) x, [gyro; accel] in the IMU's axes [rad/s, m/s^2].
        trail: (6,) m.
        age: Of the reading [s].
        period: Of a tick [s].
    """
    rise = (period / (SLOPE_TIME + period)) * (reading - trail)
    return reading + (age / period) * rise, trail + rise


@helper
def filter_times(seen: float, time: float, bias_time: float) -> tuple[float, float]:
    """(T, T_b) [s]: time constants of an angle and of its rate's bias, bias+ = bias + (angle's correction)/T_b.

    At first all that the filter has seen counts alike, later only the last times.

    A line through errors of the same weight, seen for t, is the recursion of the gains 4 dt/t (angle) and 6 dt/t^2
    (bias); T = t/4 and T_b = t/1.5 until they reach those of the tuning.

    Args:
        seen: t [s].
        time: The largest T [s].
        bias_time: The largest T_b [s].
    """
    return min(time, 0.25 * seen), min(bias_time, seen / 1.5)


@helper
def is_still(before: Memory, sample: Sample, options: Options) -> bool:
    """Whether joints, base and centres of pressure move no more than they do at rest.

    Args:
        before: The state before the tick.
        sample: Readings after validation.
        options: Of the estimator.
    """
    if sample.imu_missing:
        return False
    for j in range(sample.qd.size):
        if not abs(sample.qd[j]) < options.still_rate:
            return False
    for i in range(3):
        if not abs(sample.gyro[i] - before.bias[i]) < options.still_rate:
            return False
    carried = False
    for i in range(before.contacts.shape[0]):
        if before.contacts[i, ON] > 0.0:
            carried = True
            for axis in range(2):
                if abs(before.pressure[i, axis] - before.usual[i, axis]) > _STRAY:
                    return False
    return carried


@helper
def rest_and_bias(before: Memory, sample: Sample, options: Options) -> tuple[float, float, FloatArray]:
    """(ticks that the robot has rested so far, ticks since something moved, (3,) bias of the gyro [rad/s]).

    Args:
        before: The state before the tick.
        sample: Readings after validation.
        options: Of the estimator.
    """
    rested, bias = before.scalars[RESTED], before.bias.copy()
    if not is_still(before, sample, options):
        return rested, 0.0, bias
    quiet = before.scalars[QUIET] + 1.0
    if quiet * options.period < _LONG:
        return rested, quiet, bias
    rested += 1.0
    share = max(1.0 / (rested + _DOUBT / options.period), min(1.0, options.period / options.bias_time))
    return rested, quiet, bias + share * (sample.gyro - bias)
