"""The most probable effort and acceleration, given what the residual of a model tells of their noise.

A residual u - w holds the noise n_u of the effort and K J n_a of the acceleration, J all inertia that w moves. By the
spectra S of the residual and S_u, S_a of these parts (Wiener's filter), at each frequency

    x = w + (1 - S_u/S) (u - w),   a = a_recorded + S_a/S (u - w)/(K J)

The errors of x and a are not correlated with u - w at any lag, so that no column computed from them explains the
residual's noise by itself. What neither holds, an error of the model or of a measured load, is left in x.
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import oaconvolve, welch

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.types import FloatArray

SPECTRUM = 256
"""Samples over which spectra are taken."""


@dataclass(frozen=True, eq=False)
class Shares:
    """Taps (m,) of the two filters of the residual: 1 - S_u/S of the effort, and S_a/S of the acceleration."""

    effort: FloatArray
    acceleration: FloatArray

    @classmethod
    def of(cls, samples: Samples, error: FloatArray, inertia: float) -> "Shares":
        """Of a residual (T,); `inertia`: K J [effort/(rad/s^2)]."""
        level, s, light = samples.resolution, samples.signals, samples.light.kernels[0]
        effort = max(level.effort_noise**2, level.effort_step**2 / 12.0)
        if samples.floor.servo:
            effort += level.position_noise**2
        residual = _spectrum(samples, error)
        if residual is None:
            kernel = np.convolve(light, samples.kernel.kernels[0])
            left = float(np.mean(samples.reduce(error) ** 2))
            share = 1.0 - effort * float(kernel @ kernel) / max(left, 1e-300)
            return cls(np.array([min(max(share, 0.0), 1.0)]), np.zeros(1))
        passed = 2.0 * s.period * np.abs(np.fft.rfft(light, SPECTRUM)) ** 2 / np.maximum(residual, 1e-300)
        omega = 2.0 * np.pi * np.fft.rfftfreq(SPECTRUM, s.period)
        order, noise = (1, level.raw_velocity_noise) if level.raw_velocity_noise else (2, level.position_noise)
        of_effort = np.minimum(passed * effort, 1.0)
        of_acceleration = np.minimum(passed * (inertia * noise * omega**order) ** 2, 1.0 - of_effort)
        return cls(_taps(1.0 - of_effort), _taps(of_acceleration))


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


def _taps(share: FloatArray) -> FloatArray:
    taps = np.fft.fftshift(np.fft.irfft(share, SPECTRUM))
    return np.asarray(np.append(taps, taps[0])[: SPECTRUM + 1] * np.hanning(SPECTRUM + 1))
