"""What the motion around a row says of it: positions that were held although the joint moved, and clocks that stepped.

The speed next to a row is the mean of the differences over five rows before and five rows after it. A position that
stands still for k rows and then leaps by what that speed makes in k rows was not read meanwhile; a position that goes
on by one period over a longer step of the clock was read one period later, and the clock is wrong. A logger that
repeats all channels of a joint, from which the position then leaps, did not read it either.
"""

from collections.abc import Sequence

import numpy as np

from drake_tc.logs.channels import run_lengths, true_spans
from drake_tc.types import BoolArray, FloatArray, IntArray

ROWS = 5
"""Rows before and after, over which the speed is taken."""
LEAST_DEVIATIONS = 3.0
"""Motion in deviations of the second difference (2.4 of the noise), below which nothing is told."""
REPEATED = 5
"""Rows in which a logger repeats itself, at least."""
LEAP = 1.5
"""Leap of a position behind them, times the largest step anywhere else."""
MOST_HELD = 0.02
"""Share of rows above which holding is the channel's way, as of one on a slower clock."""


def held_rows(position: FloatArray) -> BoolArray:
    """Rows (T,) whose position repeats the row before although the joint moved on.

    Args:
        position: (T,) [rad]; NaN where missing.

    Returns:
        With x the value that is held over k rows more and d the leap behind it: rows of stretches with
        d = (0.5 to 2) v (k + 1), v the speed per row around them, and v sqrt(k) beyond what noise makes by chance.
    """
    held = np.zeros(position.size, dtype=bool)
    if position.size < 4 * ROWS or not np.isfinite(position).all():
        return held
    starts, lengths = run_lengths(position)
    chosen = (lengths >= 2) & (starts >= ROWS) & (starts + lengths + ROWS < position.size)
    starts, lengths = starts[chosen], lengths[chosen]
    ends = starts + lengths
    leap = position[ends] - position[starts]
    usual = _speed(position, starts, ends) * lengths
    jumped = (leap * usual > 0.0) & (np.abs(leap) > 0.5 * np.abs(usual)) & (np.abs(leap) < 2.0 * np.abs(usual))
    speed = np.abs(usual) / lengths
    jumped &= speed * np.sqrt(lengths - 1.0) > LEAST_DEVIATIONS * _deviation(position)
    for start, end in zip(starts[jumped].tolist(), ends[jumped].tolist(), strict=True):
        held[start + 1 : end] = True
    return held if held.mean() <= MOST_HELD or _is_one_stretch(held) else np.zeros_like(held)


def repeated_rows(position: FloatArray, others: Sequence[FloatArray]) -> BoolArray:
    """Rows (T,) that repeat the row before in all channels, of stretches behind which the position leaps.

    The joint may have turned round meanwhile, so that its speed before and after says nothing. No joint that rests
    moves farther in one row than it ever does in one.

    Args:
        position: (T,) [rad]; NaN where missing.
        others: (T,) each, the other channels of the joint; at least one.
    """
    repeated = np.zeros(position.size, dtype=bool)
    if not others or position.size < 4 * ROWS:
        return repeated
    same = np.concatenate([[False], np.all([np.diff(each) == 0.0 for each in (position, *others)], axis=0)])
    spans = [(begin, end) for begin, end in true_spans(same) if end - begin >= REPEATED and end < position.size]
    steps = np.nan_to_num(np.abs(np.diff(position)))
    behind = np.array([end - 1 for _, end in spans], dtype=np.int64)
    usual = float(np.delete(steps, behind).max(initial=0.0))
    for begin, end in spans:
        repeated[begin:end] = steps[end - 1] > LEAP * usual > 0.0
    return repeated


def stepped_clock(time: FloatArray, position: FloatArray, longest: float) -> BoolArray:
    """Steps (T - 1,) of the clock over which a position goes on by one period only, so that no rows were lost.

    Args:
        time: (T,) strictly increasing [s].
        position: (T,) [rad]; NaN where missing.
        longest: Steps beyond so many periods are gaps, whatever the position does.
    """
    stepped = np.zeros(time.size - 1, dtype=bool)
    steps = np.diff(time)
    period = float(np.median(steps))
    at = np.flatnonzero((steps > 1.5 * period) & (steps <= longest * period))
    at = at[(at >= ROWS) & (at + 1 + ROWS < time.size)]
    if not at.size or not np.isfinite(position).all():
        return stepped
    speed = _speed(position, at, at + 1)
    leap = position[at + 1] - position[at]
    beyond = speed * (steps[at] / period - 1.0)  # motion in the rows that would have been lost
    told = np.abs(beyond) > LEAST_DEVIATIONS * _deviation(position)
    stepped[at[told & (np.abs(leap - speed) < 0.5 * np.abs(beyond))]] = True
    return stepped


def _speed(position: FloatArray, before: IntArray, after: IntArray) -> FloatArray:
    """Motion per row, the mean of that up to the rows `before` and that from the rows `after` on."""
    until = (position[before] - position[before - ROWS]) / ROWS
    return np.asarray(0.5 * (until + (position[after + ROWS] - position[after]) / ROWS))


def _deviation(position: FloatArray) -> float:
    """Deviation of the second difference of a position (T,), and one encoder step at least [rad]."""
    steps = np.abs(np.diff(position))
    moving = steps[steps > 1e-12 * max(float(np.abs(position).max()), 1e-12)]
    finest = float(moving.min()) if moving.size else np.inf
    return max(1.4826 * float(np.median(np.abs(np.diff(position, 2)))), finest)


def _is_one_stretch(rows: BoolArray) -> bool:
    return int(np.sum(np.diff(rows.astype(np.int8)) == 1)) == 1
