"""The most probable effort and load, given what a model needs and how loud the noise of either record is.

    x = w + l * (u - w),   l(f) = 1 - S_u(f)/S(f)
    tau* = tau + m * (u - w)/K,   m(f) = K^2 S_tau(f)/S(f)

with what was recorded, u and tau, what the model needs, w, and the spectra S_u and S_tau of their noise and S of u - w
(Wiener's filter). The errors of both are not correlated with u - w at any lag, so that no filter of them explains the
residual's noise by itself. What is neither's noise is an error of the model, and changes no regressor but the effort:
put into the load, it would hide the effect that it lacks. A share that is the same for all frequencies would let the
noise of a load that is computed from accelerations explain itself.
"""

import numpy as np
from scipy.signal import welch

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.filtering.common_kernel import BlockConvolution
from drake_tc.types import FloatArray

SPECTRUM = 256
"""Samples over which spectra are taken."""


def latent_shares(samples: Samples, error: FloatArray, gain: float) -> tuple[FloatArray, FloatArray]:
    """Taps (m,) of the filters l and m of a residual u - w (T,); `gain` is K [effort/(N m)]."""
    level, s, light = samples.resolution, samples.signals, samples.light.kernels[0]
    noise = max(level.effort_noise**2, level.effort_step**2 / 12.0)
    if samples.floor.servo:
        noise += level.position_noise**2
    of_load, residual, stay = (gain * level.torque_noise) ** 2, _spectrum(samples, error), level.torque_pole(s.period)
    if residual is None:
        kernel = np.convolve(light, samples.kernel.kernels[0])
        part = float(kernel @ kernel) / max(float(np.mean(samples.reduce(error) ** 2)), 1e-300)
        follows, load = np.clip([1.0 - noise * part, of_load * part], 0.0, 1.0)
        return np.array([follows]), np.array([load])
    passed = 2.0 * s.period * np.abs(np.fft.rfft(light, SPECTRUM)) ** 2 / np.maximum(residual, 1e-300)
    waves = np.exp(-2j * np.pi * np.fft.rfftfreq(SPECTRUM))
    colour = (1.0 - stay**2) / np.abs(1.0 - stay * waves) ** 2
    return _taps(np.clip(1.0 - noise * passed, 0.0, 1.0)), _taps(np.clip(of_load * colour * passed, 0.0, 1.0))


def _taps(share: FloatArray) -> FloatArray:
    """Symmetric taps of a filter with this gain (F,)."""
    taps = np.fft.fftshift(np.fft.irfft(share, SPECTRUM))
    return np.asarray(np.append(taps, taps[0])[: SPECTRUM + 1] * np.hanning(SPECTRUM + 1))


def filtered(samples: Samples, taps: FloatArray, values: FloatArray) -> FloatArray:
    """Values (T,) through a symmetric filter, stretch by stretch."""
    if taps.size == 1:
        return np.asarray(taps[0] * values)
    out, half, low_pass = np.empty_like(values), taps.size // 2, BlockConvolution(taps)
    for s in samples.segments:
        out[s] = low_pass.inner(np.pad(values[s], half, mode="edge"))
    return out


def _spectrum(samples: Samples, values: FloatArray) -> FloatArray | None:
    """One-sided spectral density (F,) of values (T,), mean over the stretches of motion; None where all are too short.

    At rest, dry friction leaves open which effort is needed.
    """
    edge, total, count, rate = samples.light.margin, np.zeros(SPECTRUM // 2 + 1), 0, 1.0 / samples.signals.period
    for part in samples.segments:
        inner = slice(part.start + edge, part.stop - edge)
        turns = np.flatnonzero(np.diff(samples.moving[inner], prepend=False, append=False))
        for start, stop in zip(turns[::2], turns[1::2], strict=True):
            own = values[inner][start:stop]
            if own.size > edge:
                size = min(own.size, SPECTRUM)
                total += own.size * welch(own, rate, nperseg=size, nfft=SPECTRUM, detrend=False)[1]
                count += own.size
    return total / count if count else None
