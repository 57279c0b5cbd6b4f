"""Noise of a sensor that wanders: what is left without it, and how certain a level is beside it.

What the residual has beside its white noise wanders within each run, with a variance w^2 about the run's mean: the
covariance of the means of neighbouring half seconds. Where it is a random walk, the mean over a run, of length T and
variance rate s^2, has the variance s^2 T/3 about the walk's start and the walk about that mean has s^2 T/6. So the mean
of one run may be off by sqrt(2) w, and that of n runs by w sqrt(2/n). Of stationary noise it is off by less.

An effect is a level where the means over the runs hold most of what it changes in the residual: a bias of a sensor,
and whatever else the other columns of the model turn into one (a friction that differs by direction, beside Coulomb
friction).
"""

import numpy as np
from scipy.linalg import solveh_banded

from drake_tc.diagnosis.root_mean_square import rms
from drake_tc.diagnosis.thresholds import MOSTLY_LEVEL, WANDER_SECONDS
from drake_tc.types import FloatArray, IntArray


def level_over_wander(change: FloatArray, left: FloatArray, run: IntArray, block: IntArray) -> float:
    """RMS of an effect's levels over w sqrt(2/n); infinite where it is no level, or where nothing wanders.

    Args:
        change: (N,) residual without the effect less that with it.
        left: (N,) residual with it, of the same unit.
        run: (N,) index of each row's run.
        block: (N,) consecutive half seconds, never across two runs.
    """
    count = np.maximum(np.bincount(run), 1)
    level = rms((np.bincount(run, change) / count)[run])
    if level**2 < MOSTLY_LEVEL * rms(change) ** 2:
        return np.inf
    off = _wander(left, run, block) * np.sqrt(2.0 / np.unique(run).size)
    return level / off if off > 0.0 else np.inf


def without_wander(left: FloatArray, time: FloatArray, run: IntArray) -> FloatArray:
    """What is left (N,) less the line that follows it best, straight between knots `WANDER_SECONDS` apart in each run.

    Of a random walk of variance rate s^2, a line through its values at the knots would leave s^2 D/6 at a distance D.

    Args:
        left: (N,) residual.
        time: (N,) of the rows [s].
        run: (N,) index of each row's run.
    """
    out = left.copy()
    for r in np.unique(run):
        rows = run == r
        knot, share = np.divmod((time[rows] - time[rows].min()) / WANDER_SECONDS, 1.0)
        knot, size = knot.astype(int), int(knot.max()) + 2
        parts = ((knot, 1.0 - share), (knot + 1, share))
        own = sum(np.bincount(k, w**2, size) for k, w in parts)
        beside = np.bincount(knot + 1, share * (1.0 - share), size)
        seen = sum(np.bincount(k, w * left[rows], size) for k, w in parts)
        level = solveh_banded(np.vstack([beside, own + 1e-9 * np.max(own)]), seen)
        out[rows] -= (1.0 - share) * level[knot] + share * level[knot + 1]
    return out


def _wander(left: FloatArray, run: IntArray, block: IntArray) -> float:
    """W (see above)."""
    count = np.maximum(np.bincount(block), 1)
    mean = np.bincount(block, left) / count
    of = np.zeros(count.size, dtype=run.dtype)
    of[block] = run
    total = pairs = 0.0
    for r in np.unique(run):
        mine = mean[of == r] - np.average(mean[of == r], weights=count[of == r])
        total += float(mine[1:] @ mine[:-1])
        pairs += mine.size - 1
    return float(np.sqrt(max(total / max(pairs, 1.0), 0.0)))
