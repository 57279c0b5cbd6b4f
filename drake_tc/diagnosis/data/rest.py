"""What a position sensor shows of a joint at rest.

White noise is known from the differences of samples. Noise that wanders, over a tenth of a second or more, is not: it
shows as a slow motion to and fro of a joint that sticks, and friction would be given the sign of that motion. A joint
that stays within a few milliradians for half a second and turns twice is therefore taken to be at rest, and what its
filtered velocity is there, about its median line (a slow reversal has a trend), is what the sensor does not resolve.
A joint that breaks away at the end of such a window, or comes to rest at its begin, moves in the lesser part of it;
medians within and over the windows leave it out.
"""

from collections.abc import Sequence

import numpy as np

from drake_tc.types import FloatArray

WINDOW = 0.5
"""Length of the windows in which a joint is found at rest [s]."""
HOPS = 2
"""Windows that begin within one window's length."""
LEAST_WINDOWS = 10
"""Fewest windows at rest from which a speed is told."""
POINTS = 50
"""Samples of a window through which its median line goes, at most."""
MOST_TRAVEL = 5e-3
"""Span of the position of a joint at rest, at most [rad], and as a share of the whole motion's span ..."""
MOST_SHARE = 0.02
LEAST_TURNS = 2
"""Changes of the velocity's sign within a window, at least: a reversal is one, creep none."""
AT_ONCE = 256
"""Windows whose lines are computed together."""
NORMAL = 0.6744897501960817
"""Median of the absolute values of a standard normal variable."""
MOST_OF_SPEED = 0.02
"""The result as a share of the 95th percentile of the speed, at most: the motion must stay resolved."""


def speed_at_rest(q: FloatArray, v: FloatArray, segments: Sequence[slice], period: float) -> float:
    """Standard deviation of the filtered velocity while the joint is at rest [rad/s]; 0 where it hardly rests.

    Args:
        q: (T,) filtered position [rad].
        v: (T,) filtered velocity [rad/s].
        segments: Uniform stretches without the filters' margins.
        period: [s].
    """
    length = max(4, round(WINDOW / period))
    hop = max(1, length // HOPS)
    windows = [slice(begin, begin + length) for s in segments for begin in range(s.start, s.stop - length + 1, hop)]
    if len(windows) < LEAST_WINDOWS:
        return 0.0
    narrow = min(MOST_TRAVEL, MOST_SHARE * float(np.ptp(np.concatenate([q[w] for w in windows]))))
    resting = [v[w] for w in windows if np.ptp(q[w]) < narrow and _turns(v[w]) >= LEAST_TURNS]
    if len(resting) < LEAST_WINDOWS:
        return 0.0
    deviation = np.concatenate(
        [_deviations(np.array(resting[k : k + AT_ONCE])) for k in range(0, len(resting), AT_ONCE)]
    )
    fast = float(np.percentile(np.abs(np.concatenate([v[w] for w in windows])), 95.0))
    return min(float(np.median(deviation)), MOST_OF_SPEED * fast)


def _deviations(v: FloatArray) -> FloatArray:
    """(W,) standard deviation of each window (W, length) about its median line, from the median absolute deviation.

    The line has the median of the medians of the slopes between one sample and all others (Siegel, 1982).
    """
    few = v[:, :: -(-v.shape[1] // POINTS)]
    count = few.shape[1]
    at = np.arange(count, dtype=float)
    first, second = np.nonzero(~np.eye(count, dtype=bool))
    slopes = ((few[:, first] - few[:, second]) / (first - second)).reshape(len(few), count, count - 1)
    slope = np.median(np.median(slopes, axis=2), axis=1)
    left = few - slope[:, None] * at
    left -= np.median(left, axis=1)[:, None]
    return np.asarray(np.median(np.abs(left), axis=1) / NORMAL)


def _turns(v: FloatArray) -> int:
    sign = np.sign(v[v != 0.0])
    return int(np.count_nonzero(np.diff(sign)))
