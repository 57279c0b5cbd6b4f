"""How much a difference between two models is worth when neighbouring samples say the same thing."""

from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.thresholds import SearchThresholds
from drake_tc.identification.autocorrelation import autocovariance, correlation_time
from drake_tc.types import FloatArray

RESAMPLES = 400
LONGEST_LAG = 4096
"""Rows over which the autocorrelations of a contribution and a residual are looked at."""
WINDOW_TIMES = 5.0
"""Correlation times after which their sum ends (Sokal's window): far lags hold noise only."""


def effective_samples(residual: FloatArray, samples: Samples) -> float:
    """N over the integrated autocorrelation time of a residual (N,), no lag counted across runs; at least 3."""
    lengths = [int(n) for n in np.bincount(samples.run) if n]
    return max(residual.size / correlation_time(residual - residual.mean(), lengths), 3.0)


def effective_samples_for(contribution: FloatArray, residual: FloatArray, samples: Samples) -> float:
    """Independent samples that tell the size of a contribution (N,) beside a residual (N,); at least 3, at most N.

    N / (1 + 2 sum_l rho_x(l) rho_r(l)) with the autocorrelations of the contribution x and of the residual r: the
    variance of a coefficient by least squares in stationary noise (Bartlett, 1935). A residual that wanders says little
    of a constant, and hardly less than white noise of a fast wave. For a constant it is `effective_samples`.
    """
    lengths = [int(n) for n in np.bincount(samples.run) if n]
    lags = min(LONGEST_LAG, max(lengths))
    own, left = (autocovariance(x, lags, lengths) for x in (contribution, residual - residual.mean()))
    if not (own[0] > 0.0 and left[0] > 0.0):
        return 3.0
    running = 2.0 * np.cumsum(own * left) / (own[0] * left[0]) - 1.0
    ended = np.flatnonzero(np.arange(lags) >= WINDOW_TIMES * np.maximum(running, 1.0))
    time = float(running[ended[0] if ended.size else -1])
    return max(residual.size / max(time, 1.0), 3.0)


@dataclass(frozen=True, eq=False)
class Comparison:
    """What the larger model has over the smaller one, on cross-validated residuals of n joints.

    Attributes:
        gain: (n,) 1 - e_large/e_small.
        removed: (n,) RMS of what the larger one explains more [effort]: sqrt(e_small^2 - e_large^2).
        log_evidence: (n,) n_eff ln(e_small/e_large) less the joint's part of the price of its parameters.
        share: Share of block resamples in which the larger model is better.
        left: (n,) e_large [effort].
    """

    gain: FloatArray
    removed: FloatArray
    log_evidence: FloatArray
    share: float
    left: FloatArray

    def is_real(self, floor: FloatArray, explained: FloatArray, thresholds: SearchThresholds) -> bool:
        """Whether the larger model is worth its parameters.

        Args:
            floor: (n,) noise floors [effort].
            explained: (n,) RMS that the effects before it explain [effort].
            thresholds: What counts.
        """
        own = (self.gain >= thresholds.own_gain) & (self.left <= thresholds.own_floors * floor)
        matters = (
            (self.gain >= thresholds.least_gain)
            & (self.removed >= thresholds.least_removed * floor)
            & (own | (self.removed >= thresholds.least_of_first * explained))
        )
        supports = (self.gain >= thresholds.second_gain) & (self.log_evidence >= thresholds.second_log_evidence)
        return bool(
            self.log_evidence.sum() >= thresholds.least_log_evidence
            and matters.any()
            and supports.sum() >= thresholds.least_joints
            and self.share >= thresholds.least_share
        )


def explained_by(small: FloatArray, large: FloatArray) -> FloatArray:
    """RMS (n,) that a model of errors `large` (n,) explains beyond one of errors `small` (n,)."""
    return np.asarray(np.sqrt(np.maximum(small**2 - large**2, 0.0)))


def compared(small: FloatArray, large: FloatArray, effective: FloatArray, extra: int, share: float) -> Comparison:
    """Comparison of cross-validated errors.

    Args:
        small: (n,) RMS by joint of the smaller model [effort].
        large: (n,) of the larger one.
        effective: (n,) independent samples in the larger model's residuals.
        extra: Parameters that the larger one has more: each costs half the logarithm of all effective samples.
        share: Of resamples in which the larger one is better.
    """
    if not np.isfinite(large).all():
        nil = np.zeros(small.size)
        return Comparison(nil, nil, nil - np.inf, 0.0, large)
    ratio = np.log(small / np.maximum(large, 1e-300))
    price = 0.5 * max(extra, 0) * float(np.log(max(effective.sum(), 2.0)))
    log_evidence = effective * ratio - price * effective / effective.sum()
    return Comparison(1.0 - np.exp(-ratio), explained_by(small, large), log_evidence, share, large)


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
