"""Uniform cubic B-splines over a range, constant beyond its ends."""

from collections.abc import Callable

import numpy as np

from drake_tc.types import FloatArray

_PIECES = np.array([[1.0, -3.0, 3.0, -1.0], [4.0, 0.0, -6.0, 3.0], [1.0, 3.0, 3.0, -3.0], [0.0, 0.0, 0.0, 1.0]]) / 6.0
"""The four cubic B-splines of one interval as polynomials in u in [0, 1]: row k holds the powers 0 to 3."""


def spline_columns(
    position: FloatArray, start: FloatArray | float, end: FloatArray | float, intervals: int
) -> FloatArray:
    """B (T, intervals + 3): the cubic B-splines over equal intervals of [start, end], which add up to 1.

    Source: de Boor, A Practical Guide to Splines (1978), chapter X.

    Args:
        position: q (T,) [rad]; beyond the range the curve keeps its value at the end.
        start: Of the range [rad].
        end: > start [rad].
        intervals: Number of equal intervals.
    """
    width = (np.asarray(end) - start) / intervals
    place = np.clip((position - start) / width, 0.0, intervals)
    interval = np.minimum(place.astype(np.int64), intervals - 1)
    u = place - interval
    out = np.zeros((position.size, intervals + 3))
    rows = np.arange(position.size)
    for k, (constant, linear, quadratic, cubic) in enumerate(_PIECES):
        out[rows, interval + k] = ((cubic * u + quadratic) * u + linear) * u + constant
    return out


def spline_curve(levels: FloatArray, start: float, end: float) -> Callable[[float], float]:
    """The curve sum_k levels_k B_k(q) of (intervals + 3,) levels at one position: a cubic an interval, by Horner."""
    intervals = levels.size - 3
    cubics = [tuple(map(float, levels[i : i + 4] @ _PIECES)) for i in range(intervals)]
    per_rad = intervals / (end - start)

    def curve(q: float) -> float:
        place = min(max((q - start) * per_rad, 0.0), float(intervals))
        interval = min(int(place), intervals - 1)
        a, b, c, d = cubics[interval]
        u = place - interval
        return a + u * (b + u * (c + u * d))

    return curve
