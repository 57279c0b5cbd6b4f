"""The most probable effort, load and acceleration, given what was recorded and how loud the noise of each record is.

    x = w + l * (u - w),    l(f) = 1 - S_u(f)/S(f)
    z* = z - g h * (z - e), h(f) = S_z(f)/S_e(f),   g(t) = min(1, E[n^2]/p(t))

with what was recorded, u and z, the effort w that a model needs, what z is expected to be, e, and the spectra S_u and
S_z of the noise of u and z, S of u - w and S_e of z - e (Wiener's filter). An acceleration is expected to be 0, a load
to be that of a link that turns about the joint. n = h * (z - e) is noise but where z jumps, as at reversals: there its
local power p is above that of noise, and it is kept. The errors of x are not correlated with u - w at any lag: no
filter of x explains the residual's noise by itself. Noise of z attenuates no coefficient of z* (Berkson, 1950), and
rewards no model that does without z: without e, a payload that moves as the link does would be a torque sensor without
noise, beside a drive gain that is too small.
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import oaconvolve, welch

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.effects.base import Signals
from drake_tc.types import FloatArray

SPECTRUM = 256
"""Samples over which spectra are taken."""
HOP = 64
"""Samples from one window to the next."""
LOCAL = 2
"""Kernels over which power is local."""


@dataclass(frozen=True, eq=False)
class Smoother:
    """Taps (m,) of h, the gate g (T,), and the motions (T, k) by which z is expected on the rows."""

    taps: FloatArray
    gate: FloatArray
    motions: FloatArray

    def of(self, samples: Samples, values: FloatArray) -> FloatArray:
        """(T,) z*."""
        if not self.gate.any():
            return values
        return np.asarray(values - self.gate * filtered(samples, self.taps, unexpected(samples, values, self.motions)))


@dataclass(frozen=True, eq=False)
class Smoothing:
    """Of velocity, acceleration and load."""

    velocity: Smoother
    acceleration: Smoother
    load: Smoother

    def needed_torque(self, samples: Samples) -> FloatArray:
        """(T,) the most probable tau + J qddot and what else is known [N m]; without tau where the load is unknown."""
        s = samples.signals
        torque = s.rotor_inertia * self.acceleration.of(samples, s.acceleration) + s.known_torque
        return np.asarray(torque if samples.load_unknown else torque + self.load.of(samples, s.load_torque))


def recorded_need(samples: Samples) -> FloatArray:
    """(T,) tau + J qddot and what else is known as recorded [N m]; without tau where the load is unknown."""
    s = samples.signals
    torque = s.rotor_inertia * s.acceleration + s.known_torque
    return np.asarray(torque if samples.load_unknown else torque + s.load_torque)


def smoothing(samples: Samples, *, measured: bool) -> Smoothing:
    """The filters of a joint; `measured`: a sensor tells the load torque."""
    level, s = samples.resolution, samples.signals
    light = [np.fft.rfft(kernel, SPECTRUM) for kernel in samples.light.kernels]
    white = 2.0 * s.period
    speed_only = level.raw_velocity_noise > 0.0
    noise = level.raw_velocity_noise if speed_only else level.position_noise
    speeds, rates = (noise**2 * np.abs(light[order - speed_only]) ** 2 for order in (1, 2))
    none = np.zeros((len(s), 0))
    velocity = _smoother(samples, s.velocity, white * speeds, none)
    acceleration = _smoother(samples, s.acceleration, white * rates, none)
    of_load = level.torque_noise**2 * np.abs(light[0]) ** 2 if measured else s.link_inertia**2 * rates
    motions = _motions(s, acceleration.of(samples, s.acceleration))
    return Smoothing(velocity, acceleration, _smoother(samples, s.load_torque, white * of_load, motions))


def _motions(s: Signals, acceleration: FloatArray) -> FloatArray:
    """(T, 9) what the load of a link about the joint is made of, and its rate: a sensor can be late."""
    q, v = s.position, s.velocity
    sine, cosine, jerk = np.sin(q), np.cos(q), np.gradient(acceleration, s.period)
    return np.stack([np.ones(len(s)), q, sine, cosine, v, v * sine, v * cosine, acceleration, jerk], axis=1)


def unexpected(samples: Samples, values: FloatArray, motions: FloatArray) -> FloatArray:
    """(T,) values less their least squares fit on the rows by motions (T, k)."""
    if motions.shape[1] == 0:
        return values
    rows = samples.rows
    return np.asarray(values - motions @ np.linalg.lstsq(motions[rows], values[rows], rcond=None)[0])


def _smoother(samples: Samples, values: FloatArray, noise: FloatArray, motions: FloatArray) -> Smoother:
    """Of recorded values (T,) whose noise has this one-sided spectral density (F,)."""
    left = unexpected(samples, values, motions)
    spectrum = _typical_spectrum(samples, left)
    if spectrum is None or not noise.any():
        return Smoother(np.ones(1), np.zeros(values.size), motions)
    taps = _taps(np.clip(noise / np.maximum(spectrum, 1e-300), 0.0, 1.0))
    passed = np.abs(np.fft.rfft(np.fft.ifftshift(taps[:-1]), SPECTRUM)) ** 2
    power = float(np.mean(noise * passed)) * 0.5 / samples.signals.period
    window = np.ones(2 * LOCAL * samples.light.margin + 1)
    local = filtered(samples, window / window.size, filtered(samples, taps, left) ** 2)
    return Smoother(taps, np.minimum(power / np.maximum(local, 1e-300), 1.0), motions)


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
    return _taps(np.clip(1.0 - of_noise / np.maximum(residual, 1e-300), 0.0, 1.0))


def _taps(share: FloatArray) -> FloatArray:
    """Symmetric taps of a filter with this gain (F,)."""
    taps = np.fft.fftshift(np.fft.irfft(share, SPECTRUM))
    return np.asarray(np.append(taps, taps[0])[: SPECTRUM + 1] * np.hanning(SPECTRUM + 1))


def filtered(samples: Samples, taps: FloatArray, values: FloatArray) -> FloatArray:
    """Values (T,) through a symmetric filter, stretch by stretch."""
    if taps.size == 1:
        return np.asarray(taps[0] * values)
    out, half = np.empty_like(values), taps.size // 2
    for s in samples.segments:
        out[s] = oaconvolve(np.pad(values[s], half, mode="edge"), taps, mode="valid")
    return out


def _typical_spectrum(samples: Samples, values: FloatArray) -> FloatArray | None:
    """One-sided spectral density (F,) of values (T,), median over the windows that hold most rows; None without any."""
    inside = np.zeros(values.size)
    inside[samples.rows] = 1.0
    starts = [i for s in samples.segments for i in range(s.start, s.stop - SPECTRUM + 1, HOP)]
    shares = np.array([np.mean(inside[i : i + SPECTRUM]) for i in starts])
    if not starts or shares.max() == 0.0:
        return None
    taken = [i for i, share in zip(starts, shares, strict=True) if share >= 0.5 * shares.max()]
    window = np.hanning(SPECTRUM + 1)[:-1]
    scale = 2.0 * samples.signals.period / float(window @ window)
    power = np.abs(np.fft.rfft([window * values[i : i + SPECTRUM] for i in taken], axis=1)) ** 2
    return np.asarray(scale * np.median(power, axis=0) / np.log(2.0))  # the mean over the median of chi2 with 2 degrees


def _spectrum(samples: Samples, values: FloatArray) -> FloatArray | None:
    """One-sided spectral density (F,) of values (T,), mean over the stretches; None where all are too short."""
    edge, total, count = samples.light.margin, np.zeros(SPECTRUM // 2 + 1), 0
    for part in samples.segments:
        inner = values[part.start + edge : part.stop - edge]
        if inner.size >= SPECTRUM:
            total += inner.size * welch(inner, 1.0 / samples.signals.period, nperseg=SPECTRUM, detrend=False)[1]
            count += inner.size
    return total / count if count else None
