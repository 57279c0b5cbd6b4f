"""How much a difference between two fits is worth when neighbouring samples say the same thing."""

from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.regression import Fit
from drake_tc.diagnosis.samples import Samples
from drake_tc.identification.autocorrelation import correlation_time
from drake_tc.types import FloatArray


def effective_samples(residual: FloatArray, samples: Samples) -> float:
    """N over the integrated autocorrelation time of a residual (N,), no lag counted across runs; at least 3."""
    lengths = [int(n) for n in np.bincount(samples.run) if n]
    return max(residual.size / correlation_time(residual - residual.mean(), lengths), 3.0)


@dataclass(frozen=True)
class Comparison:
    """What the larger fit has over the smaller one, on cross-validated residuals.

    Attributes:
        gain: 1 - cv_rms(large)/cv_rms(small).
        removed: RMS of what the larger one explains more [effort]: sqrt(cv_small^2 - cv_large^2).
        log_evidence: n_eff ln(cv_small/cv_large) - penalty: evidence left after the cost of its parameters.
        share: Share of block resamples in which the larger fit is better.
    """

    gain: float
    removed: float
    log_evidence: float
    share: float


def compare(small: Fit, large: Fit, samples: Samples, seed: int = 0) -> Comparison:
    """Compare two fits of the same rows."""
    if not np.isfinite(large.cv_rms):
        return Comparison(0.0, 0.0, -np.inf, 0.0)
    ratio = small.cv_rms / max(large.cv_rms, 1e-300)
    n_eff = effective_samples(large.residual, samples)
    extra = max(large.size - small.size, 0)
    log_evidence = n_eff * float(np.log(ratio)) - 0.5 * extra * float(np.log(max(n_eff, 2.0)))
    removed = float(np.sqrt(max(small.cv_rms**2 - large.cv_rms**2, 0.0)))
    return Comparison(1.0 - 1.0 / ratio, removed, log_evidence, better_share(small, large, seed))


def better_share(small: Fit, large: Fit, seed: int = 0, resamples: int = 400) -> float:
    """Share of resamples of pairs of neighbouring blocks in which `large` has the smaller squared error."""
    difference = small.block_sse - large.block_sse
    if difference.size % 2:
        difference = np.append(difference, 0.0)
    pairs = difference.reshape(-1, 2).sum(axis=1)
    rng = np.random.default_rng(seed)
    draws = rng.integers(0, pairs.size, (resamples, pairs.size))
    return float(np.mean(pairs[draws].sum(axis=1) > 0.0))
