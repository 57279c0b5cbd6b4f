"""What a cloud of points says: binned medians with quartiles, a frame that outliers do not set, fewer points."""

from dataclasses import dataclass

import numpy as np

from drake_tc.types import FloatArray, IntArray

MOST_POINTS = 3000
BINS = 24
LEAST_IN_BIN = 8


@dataclass(frozen=True)
class Binned:
    """Bins (B,) of a cloud: median of x, and quartiles and median of y."""

    x: FloatArray
    low: FloatArray
    middle: FloatArray
    high: FloatArray


def binned(x: FloatArray, y: FloatArray, bins: int = BINS) -> Binned:
    """Medians and quartiles of y (N,) in bins of equally many x (N,): fine where the data are dense.

    Values that are not finite take no part. Bins with fewer than 8 points are left out; all may be.
    """
    good = np.isfinite(x) & np.isfinite(y)
    order = np.argsort(x[good], kind="stable")
    xs, ys = x[good][order], y[good][order]
    count = min(bins, xs.size // LEAST_IN_BIN)
    if count < 1:
        return Binned(*(np.zeros(0) for _ in range(4)))
    parts = np.array_split(np.arange(xs.size), count)
    quartiles = np.array([np.percentile(ys[p], (25.0, 50.0, 75.0)) for p in parts])
    middle = np.array([np.median(xs[p]) for p in parts])
    return Binned(middle, quartiles[:, 0], quartiles[:, 1], quartiles[:, 2])


def evenly(size: int, most: int = MOST_POINTS) -> IntArray:
    """At most `most` indices spread evenly over `size` samples, ends included."""
    if size <= most:
        return np.arange(size)
    return np.linspace(0, size - 1, most).round().astype(np.int64)


def frame(y: FloatArray, floor: float = 0.0) -> tuple[float, float]:
    """Limits of an axis for y (N,) and +-`floor`: all of y, or about its 0.2 to 99.8 percentiles."""
    finite = y[np.isfinite(y)]
    if finite.size == 0:
        return -1.0, 1.0
    low, high = (float(v) for v in np.percentile(finite, (0.2, 99.8)))
    low, high = min(low, -floor), max(high, floor)
    reach = 0.35 * (high - low)
    low = max(float(finite.min()), low - reach) if float(finite.min()) < low else low
    high = min(float(finite.max()), high + reach) if float(finite.max()) > high else high
    margin = 0.06 * (high - low) or max(abs(high), 1.0) * 0.1
    return low - margin, high + margin
