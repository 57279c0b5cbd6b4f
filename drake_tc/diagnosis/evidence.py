"""How much a difference between two fits is worth when neighbouring samples say the same thing."""

from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.design import Fit
from drake_tc.diagnosis.samples import Resolution, Samples
from drake_tc.types import FloatArray, IntArray


def effective_samples(residual: FloatArray, block: IntArray) -> float:
    """Effective number of independent samples of an autocorrelated residual.

    N_eff = N / (1 + 2 sum_l (1 - l/L) rho_l), Bartlett weights, up to the first lag at which the autocorrelation
    is no longer positive (Geyer's initial positive sequence, at single lags), at least one for every three blocks.
    Lags that cross a block gap are taken as they come: gaps are rare.

    Args:
        residual: (N,). block: (N,) as in `Samples`.
    """
    n = residual.size
    centred = residual - residual.mean()
    size = 1 << int(np.ceil(np.log2(2 * n)))
    spectrum = np.fft.rfft(centred, size)
    correlation = np.fft.irfft(spectrum * np.conj(spectrum), size)[: n // 2]
    if correlation[0] <= 0.0:
        return float(n)
    rho = correlation / correlation[0]
    negative = np.flatnonzero(rho <= 0.0)
    cut = int(negative[0]) if negative.size else rho.size
    lags = np.arange(1, cut)
    time = 1.0 + 2.0 * float(np.sum((1.0 - lags / max(cut, 1)) * rho[1:cut]))
    fewest = (int(block.max()) + 1) / 3.0
    return float(np.clip(n / max(time, 1.0), min(fewest, n), n))


def noise_floor(samples: Samples, gain: float, viscous: float, *, servo: bool) -> float:
    """RMS that sensor noise and encoder steps alone leave in the residual [effort].

    White noise of one raw sample (`Resolution`), passed through the kernels and the balance's coefficients: torque noise
    through k, encoder noise e through J k'' + F_v k' (+ k/K where the effort is q_d - q).
    """
    light, final = samples.light._kernels, samples.kernel._kernels
    k = [np.convolve(light[d], final[0]) for d in range(3)]
    r: Resolution = samples.resolution
    encoder = samples.signals.rotor_inertia * k[2] + viscous * k[1]
    if servo:
        encoder = encoder + k[0] / gain
    variance = r.torque_noise**2 * np.sum(k[0] ** 2) + r.position_noise**2 * np.sum(encoder**2)
    return float(gain * np.sqrt(variance))


@dataclass(frozen=True)
class Comparison:
    """What the larger fit has over the smaller one, on cross-validated residuals.

    Attributes:
        gain: 1 - cv_rms(large)/cv_rms(small).
        removed: RMS of what the larger one explains more [effort]: sqrt(cv_small^2 - cv_large^2).
        nats: n_eff ln(cv_small/cv_large) - penalty: evidence left after the cost of its parameters.
        share: Share of block resamples in which the larger fit is better.
    """

    gain: float
    removed: float
    nats: float
    share: float


def compare(small: Fit, large: Fit, samples: Samples, seed: int = 0) -> Comparison:
    """Compare two fits of the same rows."""
    ratio = small.cv_rms / max(large.cv_rms, 1e-300)
    n_eff = effective_samples(large.residual, samples.block)
    extra = max(large.size - small.size, 0)
    nats = n_eff * float(np.log(ratio)) - 0.5 * extra * float(np.log(max(n_eff, 2.0)))
    removed = float(np.sqrt(max(small.cv_rms**2 - large.cv_rms**2, 0.0)))
    return Comparison(1.0 - 1.0 / ratio, removed, nats, better_share(small, large, seed))


def better_share(small: Fit, large: Fit, seed: int = 0, resamples: int = 400) -> float:
    """Share of resamples of pairs of neighbouring blocks in which `large` has the smaller squared error."""
    difference = small.block_sse - large.block_sse
    if difference.size % 2:
        difference = np.append(difference, 0.0)
    pairs = difference.reshape(-1, 2).sum(axis=1)
    rng = np.random.default_rng(seed)
    draws = rng.integers(0, pairs.size, (resamples, pairs.size))
    return float(np.mean(pairs[draws].sum(axis=1) > 0.0))
