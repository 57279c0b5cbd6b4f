"""How much a difference between two models is worth when neighbouring samples say the same thing."""

import numpy as np

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.identification.autocorrelation import correlation_time
from drake_tc.types import FloatArray

RESAMPLES = 400


def effective_samples(residual: FloatArray, samples: Samples) -> float:
    """N over the integrated autocorrelation time of a residual (N,), no lag counted across runs; at least 3."""
    lengths = [int(n) for n in np.bincount(samples.run) if n]
    return max(residual.size / correlation_time(residual - residual.mean(), lengths), 3.0)


def better_share(difference: FloatArray, seed: int = 0) -> float:
    """Share of resamples of pairs of neighbouring blocks in which a sum of differences (B,) is positive.

    Args:
        difference: By block, squared error of the smaller model less that of the larger one.
        seed: Of the resampling.
    """
    if difference.size % 2:
        difference = np.append(difference, 0.0)
    pairs = difference.reshape(-1, 2).sum(axis=1)
    rng = np.random.default_rng(seed)
    draws = rng.integers(0, pairs.size, (RESAMPLES, pairs.size))
    return float(np.mean(pairs[draws].sum(axis=1) > 0.0))
