"""The base's orientation before the contacts have their say: rate, vertical, and where the gyro turns it.

Filters of the IMU: the vertical, the age of readings, the gyro's bias at rest, and how fast they forget.

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
from typing import NamedTuple

import numpy as np

from drake_tc.kernels.base.sample import Options, Posture, Sample
from drake_tc.kernels.base.state import ON, QUIET, RESTED, STARTED, STOOD, YAW, Memory
from drake_tc.kernels.compiling import helper
from drake_tc.kernels.linear_algebra import dot, levelled, product, times, times_transposed, turned
from drake_tc.types import GRAVITY, FloatArray

_CALM_IMU = 0.5
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
    gain = dt / (time + dt) * math.exp(-(((length - GRAVITY) / _CALM_IMU) ** 2)) if length > 0.0 else 0.0
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
    """Whether joints, base and centres of pressure move no more than they do at rest."""
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
    """(ticks that the robot has rested so far, ticks since something moved, (3,) bias of the gyro [rad/s])."""
    rested, bias = before.scalars[RESTED], before.bias.copy()
    if not is_still(before, sample, options):
        return rested, 0.0, bias
    quiet = before.scalars[QUIET] + 1.0
    if quiet * options.period < _LONG:
        return rested, quiet, bias
    rested += 1.0
    share = max(1.0 / (rested + _DOUBT / options.period), min(1.0, options.period / options.bias_time))
    return rested, quiet, bias + share * (sample.gyro - bias)


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
    before: Memory, sample: Sample, felt: tuple[FloatArray, ...], shown: tuple[FloatArray, bool], options: Options
) -> tuple[FloatArray, FloatArray]:
    """((3,) the vertical in B, (3,) the gyro's bias); arguments as in `attitude`.

    Args:
        before: The state before the tick.
        sample: Readings after validation.
        felt: (3, 3) R_BI, (3,) omega_b and (3,) specific force in B, (3,) the gyro's bias.
        shown: (3,) the vertical in B that soft soles show, and whether the robot rests.
        options: Of the estimator.
    """
    (R_BI, rate, accel, bias), (by_soles, calm) = felt, shown
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
    if dot(by_soles, by_soles) > 0.0:
        push = push + (dt / options.sole_time) * (by_soles - moved)
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
    up, bias = vertical(before, sample, (R_BI, rate, accel, bias), (shown, calm), options)
    level, turn = levelled(up), 0.0
    if before.scalars[STARTED]:
        turn = dt * (rate[1] * up[1] + rate[2] * up[2]) / max(up[1] * up[1] + up[2] * up[2], 0.01)
    predicted = product(turned(before.scalars[YAW] + turn), level)
    return Attitude(rate, accel, up, level, turn, predicted, bias, times_transposed(R_BI, up), trail, rested, quiet)
