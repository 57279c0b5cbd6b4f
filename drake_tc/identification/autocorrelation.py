"""How much independent information autocorrelated samples hold: correlation time and long-run variance."""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from drake_tc.errors import IdentificationError
from drake_tc.types import FloatArray

_WINDOW_TIMES = 5.0
_FIRST_LAGS = 1024


def stretches(samples: int, lengths: Sequence[int] | None) -> Iterator[slice]:
    """Slices of the contiguous stretches whose lengths add up to `samples`; one stretch when None.

    Raises:
        IdentificationError: Lengths that do not add up.
    """
    sizes = [samples] if lengths is None else [int(length) for length in lengths]
    if sum(sizes) != samples or min(sizes, default=0) < 0:
        raise IdentificationError(
            f"lengths of the stretches must add up to {samples} samples; they add up to {sum(sizes)}"
        )
    start = 0
    for size in sizes:
        if size:
            yield slice(start, start + size)
        start += size


def autocovariance(x: FloatArray, lags: int, lengths: Sequence[int] | None = None) -> FloatArray:
    """γ_l = (1/T) Σ_t x_t x_{t+l}, pairs inside one stretch only, the mean of x not removed.

    Args:
        x: (T,) of any unit u.
        lags: Number of lags L >= 1; blocks of 3 L samples are correlated with their successors by FFT.
        lengths: Lengths of the contiguous stretches.

    Returns:
        (L,) lags 0 to L - 1 [u²].
    """
    size = next_fast_len(4 * lags, real=True)
    step = size - lags
    spectrum = np.zeros(size // 2 + 1, dtype=np.complex128)
    for part in stretches(x.size, lengths):
        blocks = -(-(part.stop - part.start) // step)
        padded = np.zeros(blocks * step + lags)
        padded[: part.stop - part.start] = x[part]
        now = rfft(padded[: blocks * step].reshape(blocks, step), size, axis=1)
        later = rfft(np.lib.stride_tricks.sliding_window_view(padded, size)[::step], axis=1)
        spectrum += np.einsum("bf,bf->f", now.conj(), later)
    return np.asarray(irfft(spectrum, size)[:lags] / x.size)


def correlation_sums(x: FloatArray, lengths: Sequence[int] | None = None) -> tuple[float, float]:
    """(Σ_l ρ_l, Σ_l |l| ρ_l) over all lags, positive and negative, cut off by Sokal's window.

    The sums end at the first lag M >= 5 τ(M), τ(M) = 1 + 2 Σ_{l<=M} ρ_l: far lags carry noise only.

    Source: Sokal, Monte Carlo methods in statistical mechanics, 1997, section 3.
    """
    longest = max(part.stop - part.start for part in stretches(x.size, lengths))
    lags = min(_FIRST_LAGS, longest)
    while True:
        gamma = autocovariance(x, lags, lengths)
        if not gamma[0] > 0:
            return 1.0, 0.0
        rho = gamma / gamma[0]
        running = 2 * np.cumsum(rho) - 1
        stop = np.flatnonzero(np.arange(lags) >= _WINDOW_TIMES * np.maximum(running, 1.0))
        if stop.size or lags == longest:
            break
        lags = min(8 * lags, longest)
    last = int(stop[0]) if stop.size else lags - 1
    lag = np.arange(last + 1)
    return float(running[last]), float(2 * np.sum(lag * rho[: last + 1]))


def correlation_time(x: FloatArray, lengths: Sequence[int] | None = None) -> float:
    """Integrated autocorrelation time τ = 1 + 2 Σ_{l>=1} ρ_l, in samples, at least 1.

    T samples estimate a mean as well as T/τ independent ones would. AR(1): τ = (1 + ρ)/(1 − ρ).
    """
    return max(correlation_sums(x, lengths)[0], 1.0)


def automatic_bandwidth(x: FloatArray, lengths: Sequence[int] | None = None) -> int:
    """Bartlett bandwidth B in lags that minimises the mean squared error of the long-run variance.

    B = 1.1447 (α T)^(1/3), α = (Σ |l| ρ_l / Σ ρ_l)²: the larger of the estimate under an AR(1) fit,
    α = 4ρ²/((1−ρ)²(1+ρ)²), and the one from the autocorrelation itself; at most half the longest stretch.

    Source: Andrews, Econometrica 59 (1991), equations 6.2 and 6.4; Newey and West, 1994.
    """
    gamma0 = float(x @ x)
    if not gamma0 > 0:
        return 1
    parts = list(stretches(x.size, lengths))
    rho = sum(float(x[p][1:] @ x[p][:-1]) for p in parts) / gamma0
    rho = float(np.clip(rho, -0.999, 0.999))
    first_order = 4 * rho**2 / ((1 - rho) ** 2 * (1 + rho) ** 2)
    total, moment = correlation_sums(x, lengths)
    free = (moment / max(total, 1e-3)) ** 2 if moment > 0 and total > 0 else 0.0
    longest = max(p.stop - p.start for p in parts)
    requested = 1.1447 * (max(first_order, free) * x.size) ** (1 / 3)
    return int(np.clip(np.ceil(requested), 1, max(longest // 2, 1)))


def long_run_covariance(scores: FloatArray, bandwidth: int, lengths: Sequence[int] | None = None) -> FloatArray:
    """S = Γ_0 + Σ_{l=1}^{B-1} (1 − l/B)(Γ_l + Γ_lᵀ),  Γ_l = Σ_t s_t s_{t−l}ᵀ, (p, p), Bartlett weights.

    Computed as (1/B) Σ_k W_k W_kᵀ with W_k the sum of B consecutive scores (zero outside a stretch), which is
    the same number, positive semidefinite by construction and linear in the samples for every bandwidth.

    Args:
        scores: (T, p) of any unit.
        bandwidth: B >= 1 lags; 1 takes the scores as uncorrelated.
        lengths: Lengths of the contiguous stretches; no pair straddles two of them.

    Source: Newey and West, Econometrica 55 (1987).
    """
    p, wide = scores.shape[1], bandwidth
    total = np.zeros((p, p))
    for part in stretches(scores.shape[0], lengths):
        # sums[:, k]: all scores before sample k - B + 1, held at both ends; windows that stick out are cut
        n = part.stop - part.start
        sums = np.zeros((p, n + 2 * wide - 1))
        np.cumsum(scores[part].T, axis=1, out=sums[:, wide : wide + n])
        sums[:, wide + n :] = sums[:, wide + n - 1, None]
        window = sums[:, wide:] - sums[:, :-wide]
        total += window @ window.T
    return np.asarray(total / wide)


def critical_value_95(bandwidth: int, samples: int) -> float:
    """Two-sided 95 % critical value of a t statistic whose variance used a Bartlett bandwidth B, b = B/T.

    1.96 for b -> 0; larger for a wide bandwidth, because the variance is then itself uncertain:
    1.9600 + 2.9694 b + 0.4160 b² − 0.5324 b³.

    Source: Kiefer and Vogelsang, Econometric Theory 21 (2005), table 1.
    """
    b = min(bandwidth / max(samples, 1), 1.0)
    return 1.9600 + 2.9694 * b + 0.4160 * b**2 - 0.5324 * b**3
