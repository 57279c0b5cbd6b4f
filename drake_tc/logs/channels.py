"""Repairs of single channels on the rows of the file: missing values, slower clocks, frozen sensors.

Runs of different sampling periods are brought to one, so that one filter serves them all.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from drake_tc.logs.record import Run
from drake_tc.types import BoolArray, FloatArray, IntArray

LONGEST_FILL = 5
FROZEN_SECONDS = 0.1
FROZEN_ROWS = 30
FEWEST_CHANGES, MOST_CHANGES = 20, 0.7
"""Changes of a channel from which on its clock is looked for, and their share of the rows up to which it is slower."""
LONGEST_HOLD, LEAST_SINGLE = 1000, 0.3
"""Rows up to which a channel may repeat a value, and share of the changes that follow the last one after one sample."""
HOLD_WINDOW, REGULAR, MOSTLY_REGULAR = 60, 0.7, 0.5
"""Changes over which a slower clock is regular, RMS distance of their rows from it (0.3 where only the rounding to rows
counts; some 1.1 where the intervals are independent), and share of such windows."""
MULTIPLE = 0.3
"""Steps of time by which the gap of lost rows may differ from whole steps."""
LEAST_LEVELS = 8
"""Different values of a channel below which they are its levels and not the steps of a converter."""
ON_GRID, SHARE_ON_GRID = 0.02, 0.9
"""Distance of a difference from a multiple of the step, in steps, and share of the differences within it."""
FIRST_MULTIPLES = 8
"""Multiples of the smallest difference that its error of 2 % lets tell apart, with a margin."""
SINGLE_PRECISION_STEPS = 4.0
"""A step of at most so many units in the last place of single precision comes from the number format."""


def run_lengths(values: FloatArray) -> tuple[IntArray, IntArray]:
    """First rows and lengths of the stretches over which `values` (T,) stays exactly the same."""
    starts = np.concatenate([[0], np.flatnonzero(np.diff(values) != 0) + 1])
    return starts.astype(np.int64), np.diff(np.concatenate([starts, [values.size]])).astype(np.int64)


def true_spans(rows: BoolArray) -> list[tuple[int, int]]:
    """First row and end of every stretch over which `rows` (T,) is true."""
    starts, lengths = run_lengths(rows.astype(np.float64))
    return [(s, s + n) for s, n in zip(starts.tolist(), lengths.tolist(), strict=True) if rows[s]]


def fill_missing(time: FloatArray, values: FloatArray) -> tuple[FloatArray, BoolArray, str]:
    """Interpolate short holes, mark long ones.

    A hole is short up to 5 rows, or up to 2.5 times the channel's usual spacing when it is recorded on a slower clock
    with blanks between. What lies before the first and after the last value is long.

    Returns:
        Values (T,) without NaN, the rows (T,) that must not be used, and what to note ("" when nothing was missing).
    """
    finite = np.isfinite(values)
    if finite.all():
        return values, np.zeros(values.size, dtype=bool), ""
    at = np.flatnonzero(finite)
    spacing = np.diff(at)
    usual = float(np.median(spacing)) if spacing.size else 1.0
    allowed = max(LONGEST_FILL + 1, 2.5 * usual)
    excluded = np.zeros(values.size, dtype=bool)
    excluded[: at[0]] = True
    excluded[at[-1] + 1 :] = True
    for hole in np.flatnonzero(spacing > allowed):
        excluded[at[hole] + 1 : at[hole + 1]] = True
    filled = np.interp(time, time[at], values[at])
    missing, left_out = int((~finite).sum()), int(excluded.sum())
    parts = []
    if usual >= 2:
        parts.append(f"has a value every {usual:.0f} rows")
    if missing > left_out:
        parts.append(f"{missing - left_out} missing values were interpolated")
    if left_out:
        parts.append(
            f"{left_out} rows of long holes were left out (the first: row {int(np.flatnonzero(excluded)[0]) + 1})"
        )
    return filled, excluded, ", ".join(parts)


def hold_period(time: FloatArray, values: FloatArray) -> float:
    """Rows between two samples of a channel that a slower clock sampled and each row repeats until the next; else 1.

    The number need not be whole: a topic of 60 Hz in a log of 200 Hz changes after 3 or 4 rows, 10/3 on average. In
    every window of changes, the row n_j of the j-th one follows n_0 + T m_j, where m_j counts the samples and may pass
    over some that repeat a value. Rows that the file lost are counted by `time`. A coarse encoder repeats values too,
    but after as many rows as its speed asks for, or, on a ramp, by steps of one size.
    """
    changes = np.flatnonzero(np.diff(values) != 0)
    if changes.size < FEWEST_CHANGES or changes.size > MOST_CHANGES * values.size:
        return 1.0
    sizes = np.abs(np.diff(values)[changes])
    if np.mean(sizes < 1.01 * np.median(sizes)) > 0.9 and np.mean(sizes > 0.99 * np.median(sizes)) > 0.9:
        return 1.0
    at = _row_numbers(time)[changes + 1]
    intervals = np.diff(at)
    commonest = int(np.bincount(np.minimum(intervals, LONGEST_HOLD)).argmax())
    near = intervals[np.abs(intervals - commonest) <= 1]
    if commonest >= LONGEST_HOLD or near.size < LEAST_SINGLE * intervals.size:
        return 1.0
    rows = float(near.mean())
    samples = np.concatenate([[0.0], np.cumsum(np.maximum(np.round(intervals / rows), 1.0))])
    regular = _follows_line(samples, at.astype(np.float64))
    return rows if rows * MOST_CHANGES > 1.0 and np.mean(regular) >= MOSTLY_REGULAR else 1.0


def _follows_line(x: FloatArray, y: FloatArray) -> BoolArray:
    """Whether each window of `HOLD_WINDOW` points of y (N,) lies within `REGULAR` of a straight line over x (N,)."""
    size = min(HOLD_WINDOW, x.size)
    shape = (-1, size)
    x, y = (each[: each.size // size * size].reshape(shape) for each in (x, y))
    x, y = (each - each.mean(axis=1, keepdims=True) for each in (x, y))
    slope = (x * y).sum(axis=1, keepdims=True) / (x * x).sum(axis=1, keepdims=True)
    return np.asarray(np.sqrt(np.mean((y - slope * x) ** 2, axis=1)) <= REGULAR)


def _row_numbers(time: FloatArray) -> IntArray:
    """Numbers (T,) that the rows would have if the file had lost none.

    Steps of time that are no multiple of the usual one are those of a logger with an unsteady rate.
    """
    steps = np.diff(time) / np.median(np.diff(time))
    whole = np.round(steps)
    passed = np.where((whole > 1.0) & (np.abs(steps - whole) <= MULTIPLE), whole, 1.0)
    return np.concatenate([[0], np.cumsum(passed)]).astype(np.int64)


def release_hold(time: FloatArray, values: FloatArray, rows: float) -> FloatArray:
    """Values (T,) interpolated between the rows at which a channel with a `hold_period` was sampled afresh."""
    starts, lengths = run_lengths(values)
    numbers = _row_numbers(time)
    since = np.floor((numbers - np.repeat(numbers[starts], lengths) + 0.5) / rows)
    fresh = np.concatenate([[True], np.diff(since) != 0])
    fresh[starts] = True
    return np.asarray(np.interp(time, time[fresh], values[fresh]))


def frozen_rows(values: FloatArray, others: FloatArray, period: float, *, jump: bool) -> BoolArray:
    """Rows (T,) in which a live channel repeats one value for long although another channel moves.

    Args:
        values: The channel, (T,).
        others: A channel that shows motion, (T,).
        period: [s].
        jump: Demand that the channel leaves the stretch with a jump (an encoder may well rest; it does not leap).
    """
    frozen = np.zeros(values.size, dtype=bool)
    starts, lengths = run_lengths(values)
    if starts.size < 20 or np.median(lengths) > 2:
        return frozen
    longest = max(FROZEN_ROWS, round(FROZEN_SECONDS / period), 20 * float(np.percentile(lengths, 90)))
    steps = np.abs(np.diff(values))
    usual = float(np.percentile(steps, 99))
    span = float(np.ptp(others))
    for start, length in zip(starts[lengths >= longest].tolist(), lengths[lengths >= longest].tolist(), strict=True):
        stop = start + length
        leap = abs(values[stop] - values[stop - 1]) if stop < values.size else 0.0
        moving = np.ptp(others[start:stop]) > 0.01 * span
        if moving and (not jump or leap > 5 * usual):
            frozen[start:stop] = True
    return frozen


def saturated_share(values: FloatArray) -> float:
    """Share of the rows in which a command rests at its largest magnitude for 5 rows or more.

    A command that is stepped from one value to the next rests at each of them: it must rest twice as long as usual.
    """
    limit = float(np.abs(values).max())
    if limit == 0.0:
        return 0.0
    starts, lengths = run_lengths(values)
    at_limit = (np.abs(values[starts]) > 0.9995 * limit) & (lengths >= max(5.0, 2.0 * float(np.median(lengths))))
    return float(lengths[at_limit].sum() / values.size)


def zero_stretches(effort: FloatArray, position: FloatArray, period: float) -> BoolArray:
    """Rows (T,) in which the effort is exactly 0 for 0.1 s or more while the joint moves: the drive was off."""
    off = np.zeros(effort.size, dtype=bool)
    span = float(np.ptp(position))
    for start, stop in true_spans(effort == 0.0):
        if stop - start >= max(20, 0.1 / period) and np.ptp(position[start:stop]) > 0.02 * span:
            off[start:stop] = True
    return off


def grid_step(values: FloatArray) -> float:
    """The step of recorded values (T,) that lie on a grid, as an encoder's do; 0 where they do not.

    The smallest difference between neighbouring rows is a first estimate of the step, and least squares over ever
    larger differences refines it. It is the step when nine differences in ten are multiples of it to within 2 % of a
    step. A channel of a few levels (a binary or a staircase command) is exact and not rounded to them, and what single
    precision rounds is no step of a sensor.
    """
    finite = values[np.isfinite(values)]
    if np.unique(finite).size < LEAST_LEVELS:
        return 0.0
    largest = float(np.max(np.abs(finite)))
    changes = np.abs(np.diff(finite))
    changes = changes[changes > 1e-12 * max(largest, 1e-12)]
    if changes.size == 0:
        return 0.0
    step = _refined_step(changes)
    multiples = changes / step
    on_grid = float(np.mean(np.abs(multiples - np.round(multiples)) < ON_GRID)) > SHARE_ON_GRID
    return step if on_grid and not _is_single_precision(finite, step) else 0.0


def _refined_step(changes: FloatArray) -> float:
    """The d for which differences (N,) are closest to multiples n d: sum c n / sum n^2, for c up to 8 d, 64 d, ...

    The error of d times the largest n stays below half a step in each round, so that every n is rounded right.
    """
    step, reach = float(np.min(changes)), float(FIRST_MULTIPLES)
    longest = float(np.max(changes))
    while True:
        near = changes[changes < (reach + 0.5) * step]
        n = np.round(near / step)
        close = np.abs(near / step - n) < 0.25  # others are off the grid whatever the step's last digits
        near, n = near[close], n[close]
        step = float(near @ n / (n @ n))
        if reach * step > longest:
            return step
        reach *= FIRST_MULTIPLES


def _is_single_precision(values: FloatArray, step: float) -> bool:
    """Whether values (T,) are single-precision numbers whose own rounding is as coarse as the step."""
    largest = np.float32(np.max(np.abs(values)))
    if step > SINGLE_PRECISION_STEPS * float(np.spacing(largest)):
        return False
    return bool(np.array_equal(values, values.astype(np.float32)))


SAME = 0.01


def at_common_period(runs: Sequence[Run]) -> tuple[Run, ...]:
    """The runs at the shortest of their periods; unchanged where the periods agree within 1 %.

    Between samples the channels are interpolated linearly, segment by segment: a low-pass of a few of the longest
    periods, which every later step applies, does not see the difference.
    """
    if not runs:
        return ()
    shortest = min(run.period for run in runs)
    return tuple(run if run.period <= (1.0 + SAME) * shortest else _resampled(run, shortest) for run in runs)


def _resampled(run: Run, period: float) -> Run:
    times: list[FloatArray] = []
    values: dict[str, list[FloatArray]] = {name: [] for name in run.columns}
    segments = []
    for part in run.segments():
        old = run.time[part]
        count = int(np.floor((old[-1] - old[0]) / period * (1.0 + 1e-12))) + 1
        new = old[0] + period * np.arange(count)
        times.append(new)
        segments.append(np.full(count, run.segment[part.start], dtype=np.int64))
        for name, column in run.columns.items():
            values[name].append(np.interp(new, old, column[part]))
    if not times:
        return run
    note = f"Resampled from {1e3 * run.period:.3g} ms to {1e3 * period:.3g} ms, the shortest period among the runs."
    return replace(
        run,
        time=np.concatenate(times),
        period=period,
        columns={name: np.concatenate(parts) for name, parts in values.items()},
        segment=np.concatenate(segments),
        notes=(*run.notes, note),
        acceleration_weights=None,
    )
