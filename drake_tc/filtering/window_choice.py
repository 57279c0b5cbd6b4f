"""The Savitzky-Golay window whose derivatives have the least error, from the spectrum of the log itself.

Of a channel x = s + e with white noise e of density N, a window with the frequency response H_d estimates the d-th
derivative with the expected squared error

    R = int |H_d(f) - (2 pi i f)^d|^2 S_s(f) df + N f_s/2 sum w_k^2

bias first, noise second. N is read from the upper end of the channel's spectrum S, and S_s = S - N where S stands out
of the noise. This is Mallows' risk (1973) for derivatives, with the spectrum in place of the residual: the residual of
the smoothed value says little of the error of a second derivative.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.fft import rfft
from scipy.signal import welch

from drake_tc.filtering.savitzky_golay import savgol_weights
from drake_tc.types import FloatArray, IntArray

LEAST_WINDOW = 5
LONGEST_SECONDS = 0.25
RATIO = 1.2
"""Of neighbouring windows among the candidates."""
ORDERS = (2, 3, 4, 5)
SEGMENT_SECONDS = 2.0
"""Of the stretches whose spectra are averaged, at most."""
LEAST_AVERAGES = 8
"""Of such stretches, which overlap by half; fewer would let chance stand out of the noise."""
NOISE_BAND = (0.5, 0.9)
"""Part of the band up to half the sampling frequency that is taken for noise."""
BAND = 1.15
"""Ratio of the frequencies at the end and in the middle of the band over which a density is averaged."""
DEVIATIONS = 4.0
"""Standard deviations by which the average must exceed the noise to count as signal."""


@dataclass(frozen=True)
class Window:
    """A Savitzky-Golay window.

    Attributes:
        samples: Odd number of samples.
        order: Of the polynomial.
    """

    samples: int
    order: int


def choose_window(channels: Sequence[tuple[FloatArray, int]], period: float) -> Window:
    """The window for several channels and derivatives at once.

    The risk of each group, added up over its channels, counts relative to the least that a window of the candidates
    has, and the sum of these over the groups is least.

    Args:
        channels: Groups (values, requested derivative), each of (T, n) finite values of one unit and one uniform
            stretch; 0 is the value itself. T is at least 20.
        period: [s].
    """
    candidates = tuple(_candidates(channels[0][0].shape[0], period))
    cost = np.zeros(len(candidates))
    for values, derivative in channels:
        spectra = [_spectrum(column, period) for column in values.T if np.ptp(column) > 0.0]
        risks = np.array([sum(_risk(each, derivative, s) for s in spectra) for each in candidates])
        least = float(risks.min())
        cost += risks / least if least > 0.0 else 0.0
    return candidates[int(np.argmin(cost))]


@dataclass(frozen=True)
class _Spectrum:
    """(F,) places k of the frequencies k/(size period) at which there is signal, its density there, and the noise's."""

    place: IntArray
    signal: FloatArray
    noise: float
    size: int
    period: float


def _candidates(samples: int, period: float) -> Iterator[Window]:
    longest = max(min(round(LONGEST_SECONDS / period), samples // 4), LEAST_WINDOW)
    size = float(LEAST_WINDOW)
    sizes = []
    while size <= longest:
        sizes.append(2 * int(size / 2.0) + 1)
        size *= RATIO
    for count in dict.fromkeys(sizes):
        for order in ORDERS:
            if count > order + 1:
                yield Window(count, order)


def _spectrum(values: FloatArray, period: float) -> _Spectrum:
    """One-sided densities of signal and noise, from averages of windows without leakage."""
    size = max(min(round(SEGMENT_SECONDS / period), 2 * values.size // (LEAST_AVERAGES + 1)), 8)
    frequency, density = welch(values, 1.0 / period, window="nuttall", nperseg=size, detrend="linear")
    upper = (frequency >= NOISE_BAND[0] * frequency[-1]) & (frequency <= NOISE_BAND[1] * frequency[-1])
    noise = float(np.mean(density[upper]))
    # weak content over a broad band stands out of the noise only where neighbouring frequencies are averaged
    low, high = (np.searchsorted(frequency, frequency * ratio) for ratio in (1.0 / BAND, BAND))
    total = np.concatenate([[0.0], np.cumsum(density)])
    count = np.maximum(high - low, 1)
    mean = (total[np.minimum(low + count, density.size)] - total[low]) / count
    limit = noise * (1.0 + DEVIATIONS / np.sqrt(count * LEAST_AVERAGES))
    there = (mean > limit) & (frequency < NOISE_BAND[0] * frequency[-1])
    return _Spectrum(np.flatnonzero(there), mean[there] - noise, noise, size, period)


@lru_cache(maxsize=4096)
def _response(window: Window, derivative: int, period: float, size: int) -> tuple[FloatArray, float]:
    """(size//2 + 1,) squared error |H_d(f) - (2 pi i f)^d|^2 at f = k/(size period), and sum w_k^2."""
    weights = savgol_weights(window.samples, window.order, None, derivative, period)
    longer = -(-window.samples // size)
    omega = 2.0 * np.pi * np.arange(size // 2 + 1) / (size * period)
    centred = rfft(weights, longer * size)[::longer] * np.exp(1j * omega * (window.samples // 2) * period)
    # convolution turns the window round: the weight of the sample at a lag belongs to exp(+i omega lag)
    return np.abs(np.conj(centred) - (1j * omega) ** derivative) ** 2, float(weights @ weights)


def _risk(window: Window, derivative: int, spectrum: _Spectrum) -> float:
    """R of the module's equation."""
    bias, squares = _response(window, derivative, spectrum.period, spectrum.size)
    seen = float(spectrum.signal @ bias[spectrum.place]) / (spectrum.size * spectrum.period)
    return seen + spectrum.noise * 0.5 / spectrum.period * squares
