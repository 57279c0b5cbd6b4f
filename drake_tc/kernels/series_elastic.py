"""A tick of the torque laws of series-elastic joints, see `drake_tc.control.series_elastic`."""

import math
from typing import Any, NamedTuple

import numpy as np

from drake_tc.kernels.compiling import INDEX, MATRIX, OUT_MATRIX, OUT_VECTOR, VECTOR, helper, kernel, together
from drake_tc.types import FloatArray

LARGEST = 1e9
"""No input in SI units is as large; one that is counts as not finite."""
VOLTAGE, ANGLE, TORQUE, DESIRED, SHAPED, LINK, FASTER, DRY = range(8)
"""Rows of a tick's memory (`MemoryRow`)."""
PROPORTIONAL_INTEGRAL, OBSERVER, LAST_STEP, MOMENTUM, MODEL = range(5)
"""Where friction comes from; a proportional-integral law knows none."""
SHAPE, CURVE, GROWTH, SPEED, UNDER_WAY, FELT = range(6)
"""Rows of weights on the memory's ticks."""


class Observer(NamedTuple):
    """A generalized-momentum observer of one joint.

    Attributes:
        inertia: J [kg m^2].
        gain: K_o [rad/s].
        dt: [s].
    """

    inertia: float
    gain: float
    dt: float


@helper
def momentum(of: Observer, thrust: float, total: float, last: float, speed: float) -> tuple[float, float]:
    """Generalized-momentum observer of one joint, one tick: (friction, integral).

        s[k] = s[k-1] + dt (v[k-1]/K - F_v w[k] - tau[k] - f[k-1]),   f[k] = K_o (s[k] - J w[k])

    Args:
        of: The observer.
        thrust: v[k-1]/K - F_v w[k] - tau[k]; the published observer knows no delay [N m].
        total: s[k-1].
        last: f[k-1] [N m].
        speed: w[k] [rad/s].

    Source: De Luca and Mattone (2003); Le Tien et al. (2008), for friction of joints with torque sensors.
    """
    total += of.dt * (thrust - last)
    return of.gain * (total - of.inertia * speed), total


@helper
def weighted(kept: FloatArray, row: int, weights: FloatArray) -> FloatArray:
    """(n,) sum over the ticks of weights (l,) times a row of the memory (l, 8, n)."""
    out = np.zeros(kept.shape[2])
    for tick in range(weights.size):
        if weights[tick] != 0.0:
            for j in range(out.size):
                out[j] += weights[tick] * kept[tick, row, j]
    return out


@helper
def observed(kept: FloatArray, weights: FloatArray) -> FloatArray:
    """(n,) friction over the last step: weights (l, 3 n) on voltage, angle and torque of the memory."""
    n = kept.shape[2]
    out = np.zeros(n)
    for tick in range(kept.shape[0]):
        for row in range(3):
            for j in range(n):
                out[j] += weights[tick, row * n + j] * kept[tick, row, j]
    return out


@helper
def remember(before: FloatArray, started: bool, readings: FloatArray, kept: FloatArray, fault: FloatArray) -> None:
    """The memory one tick on, with the last good value (or 0) for what is not finite.

    Args:
        before: (l, 8, n) memory of the tick before.
        started: Whether there was one; else the joints have stood as they stand.
        readings: (4, n) motor angle, torque, desired torque, desired acceleration; updated.
        kept: (l, 8, n) written.
        fault: (n,) 1 where something is not finite; written.
    """
    length, _, n = kept.shape
    for j in range(n):
        fault[j] = 0.0
        for row in range(4):
            if not abs(readings[row, j]) < LARGEST:
                fault[j] = 1.0
                known = started and row < 3
                readings[row, j] = before[length - 1, ANGLE + row, j] if known else 0.0
    if started:
        kept[:-1] = before[1:]
    for tick in range(length - 1 if started else 0, length):
        kept[tick] = 0.0
        for j in range(n):
            for row in range(3):
                kept[tick, ANGLE + row, j] = readings[row, j]
            kept[tick, SHAPED, j] = readings[2, j]


@helper
def proportional_integral(
    readings: FloatArray, held: FloatArray, motor: FloatArray, options: FloatArray, written: tuple[FloatArray, ...]
) -> None:
    """The law `pi`; its integral is held where the voltage is at its limit.

    Args:
        readings: (4, n) all finite.
        held: (3, n) the integral so far.
        motor: (6, n) see `law`.
        options: See `law`.
        written: (8, n) memory of this tick, (3, n) integral, (4, n) rows.
    """
    last, integral, rows = written
    dt, kp, ki = options[0], options[1], options[2]
    integral[1:] = 0.0
    for j in range(readings.shape[1]):
        error = readings[2, j] - readings[1, j]
        total = held[0, j] + dt * error
        wish = (kp * error + ki * total) / motor[0, j]
        volts = min(max(wish, -motor[5, j]), motor[5, j])
        integral[0, j] = held[0, j] if wish != volts and wish * error > 0.0 else total
        last[VOLTAGE, j] = rows[0, j] = volts
        rows[1, j], rows[2, j] = 0.0, readings[2, j]


@helper
def predict_speed(
    kept: FloatArray, held: FloatArray, asked: tuple[FloatArray, ...], taps: FloatArray, options: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(n,) the speed as measured and y, the speed when the voltage arrives [rad/s].

    Args:
        kept: (l, 8, n) memory; growth of the desired speed and acceleration of this tick are written.
        held: (3, n) integral, last friction and y of the tick before.
        asked: (n,) growth by winding the spring [rad/s], (n,) desired acceleration of the links [rad/s^2].
        taps: (6, l) see `law`.
        options: See `law`.
    """
    (faster, acceleration), arriving = asked, np.empty(held.shape[1])
    last, previous, dt = kept[-1], kept[-2], options[0]
    for j in range(faster.size):
        last[LINK, j] = acceleration[j]
        last[FASTER, j] = faster[j] + 0.5 * dt * (acceleration[j] + previous[LINK, j])
    speed, under_way = weighted(kept, ANGLE, taps[SPEED]), weighted(kept, FASTER, taps[UNDER_WAY])
    for j in range(faster.size):
        due = held[2, j] + last[FASTER, j]
        arriving[j] = due + options[4] * (speed[j] + under_way[j] - due)
    return speed, arriving


@kernel(
    together(VECTOR, VECTOR, VECTOR, VECTOR), VECTOR, together(INDEX, MATRIX, MATRIX, MATRIX, VECTOR), OUT_VECTOR,
    OUT_MATRIX,
)  # fmt: skip
def law(
    now: tuple[FloatArray, ...], state: FloatArray, tables: tuple[Any, ...], after: FloatArray, rows: FloatArray
) -> None:
    """One tick.

    Args:
        now: (n,) motor angle [rad], torque of the springs and desired torque [N m], and desired acceleration of the
            links [rad/s^2].
        state: (8 l n + 3 n + 1,) memory; the law's integral, its last friction, the speed y; 1 once there was a tick.
        tables: Counts: ticks l of the memory, D of the delay, where friction comes from, 1 with P, 1 where r is the
            desired torque itself; taps: (6, l) weights on the memory's ticks; (l, 3 n) weights of the friction over the
            last step; motor: (6, n) 1/K, F_v, J, tau_co0, 1/Ks, limit of the voltage; options: dt, kp, ki, leak, a,
            v_s, K_o.
        after: As `state`; written.
        rows: (4, n) voltage, friction, r, and 1 where an input is not finite; written.
    """
    (motor_angle, torque, desired, acceleration), (counts, taps, observer, motor, options) = now, tables
    length, delay, mode, n = counts[0], counts[1], counts[2], motor_angle.size
    dt, kp, leak, smooth, gain = options[0], options[1], options[3], options[5], options[6]
    size = 8 * length * n
    kept, integral = after[:size].reshape(length, 8, n), after[size:-1].reshape(3, n)
    held, readings = state[size:-1].reshape(3, n), np.empty((4, n))
    readings[0], readings[1], readings[2], readings[3] = motor_angle, torque, desired, acceleration
    remember(state[:size].reshape(length, 8, n), state[-1] > 0.5, readings, kept, rows[3])
    after[-1], last, previous = 1.0, kept[-1], kept[-2]
    if mode == PROPORTIONAL_INTEGRAL:
        proportional_integral(readings, held, motor, options, (last, integral, rows))
        return
    winding, faster = np.zeros(n), np.zeros(n)
    if not counts[4]:
        last[SHAPED] = weighted(kept, DESIRED, taps[SHAPE])
        winding = motor[4] * weighted(kept, DESIRED, taps[CURVE])
        faster = motor[4] * weighted(kept, DESIRED, taps[GROWTH])
    speed, arriving = predict_speed(kept, held, (faster, readings[3]), taps, options)
    integral[0], integral[1], integral[2] = held[0], held[1], arriving
    for j in range(n):
        last[DRY, j] = motor[3, j] * math.tanh(integral[2, j] / smooth)
    friction = last[DRY].copy()
    if mode in (OBSERVER, LAST_STEP):
        seen = observed(kept, observer)
        friction = leak * seen if mode == LAST_STEP else friction + leak * (seen - weighted(kept, DRY, taps[FELT]))
    for j in range(n):
        if mode == MOMENTUM:
            thrust = motor[0, j] * previous[VOLTAGE, j] - motor[1, j] * speed[j] - last[TORQUE, j]
            observer_of = Observer(motor[2, j], gain, dt)
            friction[j], integral[0, j] = momentum(observer_of, thrust, held[0, j], held[1, j], speed[j])
            integral[1, j] = friction[j]
        push = motor[1, j] * integral[2, j] + friction[j] + motor[2, j] * (readings[3, j] + winding[j])
        push += last[SHAPED, j]
        if counts[3]:
            due = 0.5 * (kept[length - 2 - delay, SHAPED, j] + kept[length - 1 - delay, SHAPED, j])
            push += kp * (due - readings[1, j])
        last[VOLTAGE, j] = min(max(push / motor[0, j], -motor[5, j]), motor[5, j])
        rows[0, j], rows[1, j], rows[2, j] = last[VOLTAGE, j], friction[j], last[SHAPED, j]
