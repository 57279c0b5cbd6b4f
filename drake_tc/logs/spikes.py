"""Samples that no joint can have moved to: whole turns that an encoder gained or lost, and single wild values.

A turn: a step between neighbouring rows within a little of 2 pi n, in a channel whose other steps are much smaller. It
is undone exactly, whether the channel stays there (an encoder that wraps round) or comes back (one sample a turn off).
A spike: one to three rows far from the median of their neighbourhood, by many times what the channel does elsewhere.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d, median_filter

from drake_tc.types import BoolArray, FloatArray

TURN = 2.0 * np.pi
NEAR_A_TURN = 0.25
"""Distance of a step from 2 pi n below which it may be turns [rad]."""
MOST_TURNS = 1000.0
"""Of one step; a larger one is a wild value."""
LIKE_OTHERS = 2.0
"""What is left of a step without its turns is at most so many times the largest other step."""
NEIGHBOURHOOD = 9
"""Rows of the running median; it passes over spikes of up to four rows."""
LONGEST_SPIKE = 3
USUAL = 95.0
"""Percentile of distances and steps that is usual in a channel; spikes are rarer than the rest."""
WILD = 30.0
"""A spike lies so many usual distances away from the running median."""
WILD_RANGE = 0.3
"""And so large a share of the channel's range (0.5 to 99.5 %) at least."""
MANY_STEPS = 30.0
"""So many of the smallest steps: the last digit of an encoder at rest flickers."""
ALONE, AROUND = 10.0, 10
"""A spike is so many times larger than any other distance within so many rows: an impact rings, and is none."""
MOST_SPIKES = 0.01
"""Share of the rows with spikes above which a channel is not mended."""


@dataclass(frozen=True)
class Turns:
    """Whole turns found in an angle.

    Attributes:
        values: (T,) without the turns.
        rows: Where they were gained or lost.
    """

    values: FloatArray
    rows: tuple[int, ...]


def without_turns(values: FloatArray) -> Turns:
    """An angle (T,) [rad] without the whole turns between its rows; NaN stays.

    Steps of 2 pi n +- 0.25 rad are turns if what is left without them is like the other steps, and every other step
    is below a tenth of a turn; a joint that moves faster than that between two samples is left alone.
    """
    at = np.flatnonzero(np.isfinite(values))
    steps = np.diff(values[at])
    turns = np.round(steps / TURN)
    found = (turns != 0) & (np.abs(turns) <= MOST_TURNS) & (np.abs(steps - TURN * turns) < NEAR_A_TURN)
    largest = float(np.abs(steps[~found]).max(initial=0.0))
    found &= np.abs(steps - TURN * turns) <= LIKE_OTHERS * largest  # else a wild value that happens to be near one
    if not found.any() or np.abs(steps[~found]).max(initial=0.0) > 0.1 * TURN:
        return Turns(values, ())
    mended = values.copy()
    mended[at[1:]] -= TURN * np.cumsum(np.where(found, turns, 0.0))
    return Turns(mended, tuple((at[1:][found]).tolist()))


def spikes(values: FloatArray) -> BoolArray:
    """Rows (T,) of a channel that hold spikes; NaN are none.

    A distance d = |x - median of 9 rows| is wild above 30 times its 95th percentile, above 0.3 of the channel's range
    (2.5 to 97.5 %), above ten times the 95th percentile of the steps between rows, and above thirty times the smallest
    of them. A spike stands alone: it is ten times larger than all else within ten rows.
    """
    wild = np.zeros(values.size, dtype=bool)
    at = np.flatnonzero(np.isfinite(values))
    if at.size < 20 * NEIGHBOURHOOD:
        return wild
    x = values[at]
    distance = np.abs(x - median_filter(x, NEIGHBOURHOOD, mode="nearest"))
    usual = float(np.percentile(distance, USUAL))
    low, high = np.percentile(x, [2.5, 97.5])
    steps = np.abs(np.diff(x))
    step, finest = float(np.percentile(steps, USUAL)), float(np.min(steps, where=steps > 0.0, initial=np.inf))
    found = distance > max(WILD * usual, WILD_RANGE * float(high - low), 10.0 * step, MANY_STEPS * finest)
    if found.any():
        calm = maximum_filter1d(np.where(found, 0.0, distance), 2 * AROUND + 1, mode="nearest")
        wild[at[_alone(found) & (distance > ALONE * calm)]] = True
    return wild


def _alone(found: BoolArray) -> BoolArray:
    """The stretches of True (T,) that are no longer than a spike, with no other within ten rows."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], found, [False]]).astype(np.int8))).reshape(-1, 2)
    gaps = np.concatenate([[np.inf], edges[1:, 0] - edges[:-1, 1], [np.inf]])
    alone = np.zeros(found.size, dtype=bool)
    for (first, end), before, after in zip(edges.tolist(), gaps[:-1], gaps[1:], strict=True):
        alone[first:end] = end - first <= LONGEST_SPIKE and min(before, after) > AROUND
    return alone
