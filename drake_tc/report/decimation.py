"""Fewer samples of several series on one clock, with every extreme of every series kept."""

from collections.abc import Sequence

import numpy as np

from drake_tc.types import FloatArray, IntArray


def extreme_samples(series: Sequence[FloatArray], most: int) -> IntArray:
    """Rising indices of the samples that a plot of the series needs, at most `most` and the two ends.

    The samples are cut into equal stretches. Of each stretch the smallest and the largest value of every series stay,
    so that no peak is lost, and all series keep the same samples, so that values at one instant belong together.
    Source: the min-max decimation of oscilloscopes; Jugel et al., M4 (2014), Section 4.

    Args:
        series: One or more (T,) on one clock; NaN takes no part.
        most: Largest number of samples in between the ends, at least two for each series.
    """
    size = series[0].size
    if size <= most:
        return np.arange(size)
    buckets = max(1, most // (2 * len(series)))
    length = -(-size // buckets)
    kept = [np.array([0, size - 1])]
    for values in series:
        padded = np.full(length * buckets, np.nan)
        padded[:size] = values
        table = padded.reshape(buckets, length)
        known = np.flatnonzero(np.isfinite(table).any(axis=1))
        for extreme in (np.nanargmin, np.nanargmax):
            kept.append(known * length + extreme(table[known], axis=1) if known.size else known)
    return np.unique(np.concatenate(kept)).astype(np.int64)
