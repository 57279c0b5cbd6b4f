"""Readings of sensors (`drake_tc.sensing.sensor`), and checks of those of IMUs and F/T sensors.

`drake_tc.sensor_validation.body_sensors` says what is checked.
"""

import math

import numpy as np

from drake_tc.kernels.compiling import INDEX, MATRIX, OUT_VECTOR, REAL, VECTOR, helper, kernel, together
from drake_tc.types import FloatArray, IntArray

_TICK, _STUCK, _OFFSET = range(3)


@kernel(VECTOR, VECTOR, together(VECTOR, VECTOR), together(MATRIX, INDEX), OUT_VECTOR)
def reading(
    truth: FloatArray,
    row: FloatArray,
    past: tuple[FloatArray, FloatArray],
    settings: tuple[FloatArray, IntArray],
    out: FloatArray,
) -> None:
    """y[n] of `SensorBase`.

    Args:
        truth: (n,) u[n]; not looked at by a sensor with latency.
        row: [k, any m, o, m, a] of this tick, m and a where the sensor has them.
        past: (L n,) the true values of the last L ticks, empty for a sensor that reads the present one; (n,) last
            finite reading, empty for a sensor that is never stuck.
        settings: (2, n) scale and resolution, 0 for none; (2,) latency [ticks], and where in a row the additional ages
            begin, 0 for none.
        out: (n,) written.
    """
    (ring, last), (channels, layout), n = past, settings, out.shape[0]
    length, tick = ring.shape[0] // n, int(row[_TICK])
    for i in range(n):
        age = layout[0]
        if layout[1]:
            age += int(row[layout[1] + i])
        u = ring[(tick - age) % length * n + i] if age else truth[i]
        y, step = channels[0, i] * u + row[_OFFSET + i], channels[1, i]
        if step > 0.0:
            y = np.rint(y / step) * step
        if row[_STUCK] and row[_OFFSET + n + i] > 0.0 and np.isfinite(last[i]):
            y = last[i]
        out[i] = y


LARGEST = 1e5
"""No reading in SI units is as large."""
SINCE = 24
"""Place in an IMU's state: ticks since the jump."""


@helper
def all_below(values: FloatArray, limit: float) -> bool:
    """Whether all are finite and smaller in size."""
    below = True
    for value in values:
        below = below and abs(value) < limit
    return below


@helper
def exceeds(values: FloatArray, others: FloatArray, limits: FloatArray) -> bool:
    """Whether a difference exceeds its limit; False where it is not known."""
    found = False
    for i in range(values.size):
        found = found or abs(values[i] - others[i]) > limits[i]
    return found


@helper
def all_within(values: FloatArray, others: FloatArray, limits: FloatArray, share: float) -> bool:
    """Whether all differences are below a share of their limits."""
    found = True
    for i in range(values.size):
        found = found and abs(values[i] - others[i]) < share * limits[i]
    return found


@kernel(together(VECTOR, VECTOR, VECTOR), REAL, together(VECTOR, VECTOR), VECTOR, together(OUT_VECTOR, OUT_VECTOR))
def imu(
    sensed: tuple[FloatArray, ...],
    settled: float,
    settings: tuple[FloatArray, FloatArray],
    state: FloatArray,
    written: tuple[FloatArray, FloatArray],
) -> None:
    """One tick of `ValidatedImu`.

    Args:
        sensed: (6,) raw [gyro; accel]; (m,) of which any that is up leaves it out; (j,) of which any that is up says
            that a jump is true.
        settled: 1 where jumps count.
        settings: (6,) limit of a step in one tick; 1 - exp(-dt/T) of the mean, ticks for which one that jumped is left
            out at least, and within which it has jumped back.
        state: (25,) u of the last tick, its mean, mean and reading before a jump (6 each), ticks since the jump.
        written: (6,) u, or NaN; (25,) the state after it.
    """
    (u, flagged, jolt), (limit, options), (reading, after) = sensed, settings, written
    after[:] = state
    finite, jolted, since = all_below(u, LARGEST), jolt.any(), state[SINCE]
    jumps = settled > 0.0 and exceeds(u, state[:6], limit) and not jolted
    good = finite and not (since or jumps or flagged.any())
    for i in range(6):
        reading[i] = u[i] if good else np.nan
    if not finite:
        after[SINCE] = since + 1.0 if since else 0.0
        return
    mean, before, kept = after[6:12], after[12:18], after[18:SINCE]
    if not since and jumps:
        before[:], kept[:], after[SINCE] = state[6:12], state[:6], 1.0
    for i in range(6):  # the first mean is the first reading
        mean[i] = u[i] if state[6] != state[6] else mean[i] + options[0] * (u[i] - mean[i])
    if since:
        true = since <= options[2] and (jolted or all_within(u, kept, limit, 1.0))
        back = since >= options[1] and all_within(mean, before, limit, 0.5)
        after[SINCE] = 0.0 if true or back else since + 1.0
    after[:6] = u


@helper
def jumped(force: FloatArray, last: FloatArray, jump: float) -> bool:
    """Whether a force (3,) changed by more than `jump` in an axis; False where an axis is not known."""
    most, known = 0.0, True
    for i in range(3):
        change = abs(force[i] - last[i])
        known, most = known and change == change, max(most, change)
    return known and most > jump


@helper
def size_of(force: FloatArray) -> float:
    """Length of (3,)."""
    return math.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)


@kernel(together(VECTOR, VECTOR), REAL, VECTOR, VECTOR, together(OUT_VECTOR, OUT_VECTOR, OUT_VECTOR))
def wrenches(
    sensed: tuple[FloatArray, FloatArray],
    settled: float,
    options: FloatArray,
    state: FloatArray,
    written: tuple[FloatArray, FloatArray, FloatArray],
) -> bool:
    """One tick of `ValidatedWrench`; whether all sensors can be believed.

    Args:
        sensed: (6k,) raw [f; t]; (mk,) of which any that is up leaves its sensor out.
        settled: 1 where jumps count.
        options: 1 - exp(-dt/T) of the mean, `LOAD_JUMP`, `LOADS_AGREE`.
        state: (13k + 1,) last good readings, raw ones, mean of the total load, and 1 for each sensor that is doubted.
        written: (6k,) reading; (k,) 1 where a sensor can be believed; (13k + 1,) the state after it.
    """
    (raw, flagged), (reading, good, after) = sensed, written
    k, marks = good.size, flagged.size // good.size
    before, sizes, doubt, total, suspect = state[12 * k], 0.0, np.zeros(k), 0.0, False
    for i in range(k):
        own, at = raw[6 * i : 6 * i + 6], 6 * k + 6 * i
        good[i] = all_below(own, LARGEST) and not flagged[marks * i : marks * (i + 1)].any()
        jump = state[12 * k + 1 + i] > 0.0 or jumped(own[:3], state[at : at + 3], options[1])
        suspect = suspect or (jump and good[i] > 0.0)
        doubt[i] = jump and good[i] > 0.0
        sizes += size_of(own[:3])
        total += size_of(own[:3]) if good[i] else size_of(state[6 * i : 6 * i + 3])
    if not (settled > 0.0 and suspect and abs(total - before) >= options[2] * before):
        doubt[:] = 0.0
    after[:] = state
    well = True
    for i in range(k):
        if doubt[i]:
            good[i] = 0.0
        well = well and good[i] > 0.0
        for axis in range(6 * i, 6 * i + 6):
            reading[axis] = raw[axis] if good[i] else state[axis]
    after[: 6 * k], after[6 * k : 12 * k], after[12 * k + 1 :] = reading, raw, doubt
    if well:
        after[12 * k] = sizes if before != before else before + options[0] * (sizes - before)
    return well
