"""The instants of the samples, where the time stamps of a steady logger scatter about them.

A logger that samples on a steady clock and stamps the rows late, by its own scheduling, writes stamps t_i that
scatter about the true instants. A logger that samples unsteadily and stamps at once writes true stamps. With a smooth
curve s_i through the stamps, the instants are

    tau_i = s_i + lambda (t_i - s_i),

where lambda is 0 for the first logger and 1 for the second. The positions tell it: over the rows, a smooth motion
q(tau) has the roughness H q = lambda H (v (t - s)) + noise, where H is 1 minus the cubic Savitzky-Golay smoothing over
11 rows, and v the velocity. Least squares over all joints give lambda and its standard error.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d
from scipy.signal import savgol_filter

from drake_tc.types import BoolArray, FloatArray, IntArray

ROUGH_ROWS, ORDER = 11, 3
"""Rows and order of the smoothing whose remainder is the roughness."""
SMOOTH_ROWS = 201
"""Rows over which the stamps of a steady clock are fitted by a line."""
LEVEL_ROWS = 25
"""Rows on either side of a lost row that show the step in the stamps."""
LEAST_SCATTER = 0.02
"""Scatter of the stamps in periods below which it does not matter."""
LARGEST_ERROR = 0.1
"""Standard error of lambda up to which the positions tell it."""
MOSTLY_NOISE = 0.5
"""Lambda below which, by three standard errors, the scatter is noise of the stamps."""
OUT_OF_ORDER = 10.0
"""Step backwards, over the median scatter of the stamps, that is none of it: about five of its standard deviations."""
GAP = 5.0
"""Steps of time in periods that begin another stretch."""


class Instants(NamedTuple):
    """Times of the rows, and a note where they are not the stamps.

    Attributes:
        time: (T,) [s].
        notes: One sentence, or none.
    """

    time: FloatArray
    notes: tuple[str, ...] = ()


class _Stretch(NamedTuple):
    """Rows between gaps.

    Attributes:
        rows: Their numbers (N,).
        smooth: (N,) instants of a steady clock [s].
        steady: (N,) whether the rows near a sample are complete.
    """

    rows: IntArray
    smooth: FloatArray
    steady: BoolArray


def sampling_instants(time: FloatArray, positions: Sequence[FloatArray], others: Sequence[FloatArray] = ()) -> Instants:
    """The instants of the samples: a smooth clock where the stamps scatter about it and the motion does not.

    Rows that repeat the stamp and all values of the row before keep its time. Where rows are out of order, the stamps
    are returned as they are.

    Args:
        time: (T,) stamps [s], NaN where there is none.
        positions: (T,) of each joint.
        others: (T,) of each further channel.
    """
    known = np.isfinite(time)
    channels = [q for q in positions if np.isfinite(q[known]).all() and np.ptp(q[known]) > 0.0]
    repeats = np.diff(time[known], prepend=np.nan) == 0.0
    for values in (*positions, *others) if repeats.any() else ():
        repeats &= ~(np.diff(values[known], prepend=np.nan) != 0.0)
    if not channels or known.sum() - repeats.sum() < 2 * SMOOTH_ROWS:
        return Instants(time)
    index = np.flatnonzero(known)[~repeats]
    stamps = time[index]
    period = (stamps[-1] - stamps[0]) / (stamps.size - 1)
    steps = np.diff(stamps)
    period = float(np.median(steps[np.abs(steps) < GAP * period])) if period > 0.0 else 0.0
    if period <= 0.0 or float(steps.min()) < -GAP * period:
        return Instants(time)
    stretches = list(_stretches(stamps, period))
    away = np.concatenate([stamps[s.rows] - s.smooth for s in stretches]) if stretches else np.zeros(0)
    if away.size < 0.5 * stamps.size or float(steps.min()) < -OUT_OF_ORDER * float(np.median(np.abs(away))):
        return Instants(time)  # rows that are out of order are no scatter
    if not LEAST_SCATTER * period < float(away.std()) < float(steps.std()):
        return Instants(time)  # independent scatter is 0.7 of that of the steps; a clock whose rate changes has more
    share, error = _share(stamps, [q[index] for q in channels], stretches, period)
    if error > LARGEST_ERROR or share + 3.0 * error > MOSTLY_NOISE:
        return Instants(time)
    instants = stamps.copy()
    for s in stretches:
        instants[s.rows] = s.smooth + max(share, 0.0) * (stamps[s.rows] - s.smooth)
    if np.any(np.diff(instants) <= 0.0):
        return Instants(time)
    result = time.copy()
    result[index] = instants
    for row in np.flatnonzero(known)[repeats].tolist():
        result[row] = result[row - 1]
    note = (
        f"The time stamps scatter by {1e3 * float(away.std()):.3g} ms RMS about a steady clock. The positions are"
        " smooth on that clock and not on the stamps, so the times of the clock were used."
    )
    return Instants(result, (note,))


def _stretches(stamps: FloatArray, period: float) -> Iterator[_Stretch]:
    """The stretches between gaps that are long enough, with the instants of a steady clock."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(stamps) > GAP * period) + 1, [stamps.size]])
    for first, last in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        if last - first < SMOOTH_ROWS:
            continue
        own = stamps[first:last]
        number, steady = row_numbers(own, period)
        slope, start = np.polyfit(number, own, 1)
        line = start + slope * number
        yield _Stretch(np.arange(first, last), line + savgol_filter(own - line, SMOOTH_ROWS, 1), steady)


def row_numbers(stamps: FloatArray, period: float) -> tuple[FloatArray, BoolArray]:
    """Numbers (N,) of the rows, counting those that were lost, and where none was lost nearby (N,).

    Args:
        stamps: (N,) without gaps, N >= `SMOOTH_ROWS` [s].
        period: [s].

    A lost row raises the level of all later stamps by a period. Means over `LEVEL_ROWS`, without single stamps that are
    far off, see the step through the scatter, and least squares find its row.
    """
    rows = np.arange(stamps.size, dtype=np.float64)
    above = stamps - np.polyfit(rows, stamps, 1)[0] * rows
    middle = median_filter(above, LEVEL_ROWS, mode="nearest")
    level = uniform_filter1d(np.clip(above, middle - 2.0 * period, middle + 2.0 * period), LEVEL_ROWS, mode="nearest")
    half = LEVEL_ROWS // 2 + 1
    rise = np.zeros(stamps.size)
    rise[half:-half] = level[2 * half :] - level[: -2 * half]
    lost: FloatArray = np.zeros(stamps.size)
    steady: BoolArray = np.ones(stamps.size, dtype=bool)
    edges = np.flatnonzero(np.diff((rise > 0.5 * period).astype(np.int8)))
    for begin, end in zip((edges[::2] + 1).tolist(), (edges[1::2] + 1).tolist(), strict=True):
        first, last = max(0, begin - half), min(stamps.size, end + half)
        size = period * max(1.0, np.round(rise[begin:end].max() / period))
        near = above[first:last] - level[max(0, first - half)]
        at = first + int(np.argmax(np.cumsum((near - size) ** 2 - near**2))) + 1
        lost[min(at, stamps.size - 1)] = size / period
        steady[max(0, at - ROUGH_ROWS) : at + ROUGH_ROWS] = False
    return np.asarray(rows + np.cumsum(lost), dtype=np.float64), steady


def _share(
    stamps: FloatArray, positions: Sequence[FloatArray], stretches: Sequence[_Stretch], period: float
) -> tuple[float, float]:
    """Lambda and its standard error, by least squares weighted with each joint's noise."""
    information, total = 0.0, 0.0
    for q in positions:
        x, y = np.zeros(0), np.zeros(0)
        for s in stretches:
            own = q[s.rows]
            velocity = savgol_filter(own, ROUGH_ROWS, ORDER, deriv=1, delta=period)
            x = np.append(x, _rough(velocity * (stamps[s.rows] - s.smooth))[s.steady])
            y = np.append(y, _rough(own)[s.steady])
        square = float(x @ x)
        if square == 0.0:
            continue
        own_share = float(x @ y) / square
        noise = float(np.mean((y - own_share * x) ** 2)) + 1e-12 * float(np.mean(x**2))
        information += square / noise
        total += float(x @ y) / noise
    if information == 0.0:
        return 1.0, np.inf
    return total / information, float(information**-0.5)


def _rough(values: FloatArray) -> FloatArray:
    return np.asarray(values - savgol_filter(values, ROUGH_ROWS, ORDER))
