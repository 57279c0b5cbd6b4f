"""The most probable effort, given what a model needs and how loud the noise of the recorded effort is.

    x = w + l * (u - w),   l(f) = 1 - S_n(f)/S(f)

with what was recorded, u, what the model needs, w, and the spectra S_n of the noise of u and S of u - w (Wiener's
filter). The errors of x are not correlated with u - w at any lag, so that no filter of x explains the residual's noise
by itself. A share that is the same for all frequencies would let the noise of a load that is computed from
accelerations explain itself.
"""

import numpy as np
from scipy.signal import oaconvolve, welch

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.types import FloatArray

SPECTRUM = 256
"""Samples over which spectra are taken."""


def latent_share(samples: Samples, error: FloatArray) -> FloatArray:
    """Taps (m,) of the filter l of a residual u - w (T,)."""
    level, s, light = samples.resolution, samples.signals, samples.light.kernels[0]
    noise = max(level.effort_noise**2, level.effort_step**2 / 12.0)
    if samples.floor.servo:
        noise += level.position_noise**2
    residual = _spectrum(samples, error)
    if residual is None:
        kernel = np.convolve(light, samples.kernel.kernels[0])
        left = float(np.mean(samples.reduce(error) ** 2))
        share = 1.0 - noise * float(kernel @ kernel) / max(left, 1e-300)
        return np.array([min(max(share, 0.0), 1.0)])
    of_noise = 2.0 * s.period * noise * np.abs(np.fft.rfft(light, SPECTRUM)) ** 2
    follows = np.clip(1.0 - of_noise / np.maximum(residual, 1e-300), 0.0, 1.0)
    taps = np.fft.fftshift(np.fft.irfft(follows, SPECTRUM))
    return np.asarray(np.append(taps, taps[0])[: SPECTRUM + 1] * np.hanning(SPECTRUM + 1))


def filtered(samples: Samples, taps: FloatArray, values: FloatArray) -> FloatArray:
    """Values (T,) through a symmetric filter, stretch by stretch."""
    if taps.size == 1:
        return np.asarray(taps[0] * values)
    out, half = np.empty_like(values), taps.size // 2
    for s in samples.segments:
        out[s] = oaconvolve(np.pad(values[s], half, mode="edge"), taps, mode="valid")
    return out


def _spectrum(samples: Samples, values: FloatArray) -> FloatArray | None:
    """One-sided spectral density (F,) of values (T,), mean over the stretches; None where all are too short."""
    edge, total, count = samples.light.margin, np.zeros(SPECTRUM // 2 + 1), 0
    for part in samples.segments:
        inner = values[part.start + edge : part.stop - edge]
        if inner.size >= SPECTRUM:
            total += inner.size * welch(inner, 1.0 / samples.signals.period, nperseg=SPECTRUM, detrend=False)[1]
            count += inner.size
    return total / count if count else None
