"""Noise of the rows: white noise beside a slow discrepancy, and what the sensors' own noise leaves in them.

The residual of a model on the rows is n + d: n white, of variance s^2 (1 + c q + m (v/v_rms)^2); d what the model does
not explain, an Ornstein-Uhlenbeck process of variance r s^2 and correlation time T that begins anew in each run. c is
what a model of friction leaves near rest, where the force is not that of sliding, its direction is that of a creep, and
the instant at which it turns lies anywhere between two samples. It passes the filters: q is the share of e^(-|v|/v_r)
under their squared kernel. m is what instants that scatter leave: a command that is held, or a bus that is late now and
then, errs by the speed times a time. All are estimated from the residual itself by maximum likelihood. Whitening by the
Kalman filter of n + d is exact for gaps.

**The most probable effort and load**, given what a model needs and how loud the noise of either record is, are
    x = w + l * (u - w),   l(f) = 1 - S_u(f)/S(f)
    tau* = tau + m * (u - w)/K,   m(f) = K^2 S_tau(f)/S(f)

with what was recorded, u and tau, what the model needs, w, and the spectra S_u and S_tau of their noise and S of u - w
(Wiener's filter). The errors of both are not correlated with u - w at any lag, so that no filter of them explains the
residual's noise by itself. What is neither's noise is an error of the model, and changes no regressor but the effort:
put into the load, it would hide the effect that it lacks. A share that is the same for all frequencies would let the
noise of a load that is computed from accelerations explain itself.
"""

from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.signal import get_window, lfilter

from drake_tc.diagnosis.data.preparation import slower
from drake_tc.diagnosis.data.samples import Samples, rms
from drake_tc.diagnosis.priors import MEMORIES_S, MOVING, NEAR_REST, RATIOS, RESTS
from drake_tc.filtering.common_kernel import BlockConvolution
from drake_tc.kernels.calls import Kernel
from drake_tc.types import FloatArray, IntArray

_whiten = Kernel("filters", "whiten")

SEED = 0
"""Of the noise that is drawn again."""
LONGEST_LAG = 500
"""Rows over which correlation is summed."""
UNCORRELATED = 0.05
"""Correlation at which the sum ends."""
INDEPENDENT = 0.6
"""Distance of the rows that count, over that at which white noise through the filters is independent."""


@dataclass(frozen=True)
class NoiseModel:
    """Ratio r and correlation time T [s] of the discrepancy, share of independent rows, c near rest, m in motion."""

    ratio: float = 0.0
    memory: float = 1.0
    share: float = 1.0
    rest: float = 0.0
    moving: float = 0.0

    def white(self, at_rest: FloatArray, moving: FloatArray) -> FloatArray:
        """(N,) variance of the white noise over s^2, of rows with these shares near rest and squared speeds."""
        return np.asarray(1.0 + self.rest * at_rest + self.moving * moving)


def independent_rows(samples: Samples) -> IntArray:
    """Indices into the rows, so far apart that white noise of the sensors is nearly independent after the filters.

    White noise through a kernel k is as loud as one independent sample every 1/sum(k^2) samples.
    """
    kernel = np.convolve(samples.light.kernels[0], samples.kernel.kernels[0])
    apart = INDEPENDENT / float(kernel @ kernel)
    run, rows = samples.run_of_sample[samples.rows], samples.rows
    kept, last, last_run = [], -np.inf, -1
    for i, (row, own) in enumerate(zip(rows.tolist(), run.tolist(), strict=True)):
        if own != last_run or row - last >= apart:
            kept.append(i)
            last, last_run = row, own
    return np.asarray(kept, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Rows:
    """The rows of one split that count, and how they follow each other."""

    samples: Samples

    @cached_property
    def index(self) -> IntArray:
        """(n,) of the rows that count among all rows."""
        return independent_rows(self.samples)

    @cached_property
    def apart(self) -> FloatArray:
        """(n,) time since the row before [s]; infinite at the start of a run."""
        rows = self.samples.rows[self.index]
        time, run = self.samples.signals.time[rows], self.samples.run_of_sample[rows]
        gap = np.diff(time, prepend=-np.inf)
        gap[np.diff(run, prepend=-1) != 0] = np.inf
        return np.asarray(np.maximum(gap, 0.0))

    @cached_property
    def _at_rest(self) -> FloatArray:
        """(N,) share of e^(-|v|/v_r) that passes both filters to all rows; v is 0 where it changes its sign."""
        samples, velocity = self.samples, self.samples.signals.velocity
        speed, turns = np.abs(velocity), np.flatnonzero(np.diff(np.sign(velocity)))
        speed[turns] = speed[turns + 1] = 0.0
        kernel = np.convolve(samples.light.kernels[0], samples.kernel.kernels[0]) ** 2
        near = np.exp(-speed / max(NEAR_REST * rms(speed[samples.rows]), 1e-300))
        ends = (np.pad(near[s], kernel.size // 2, mode="edge") for s in samples.segments)
        passed = np.concatenate([np.convolve(each, kernel, "valid") for each in ends])
        return np.asarray(passed[samples.rows] / kernel.sum())

    @cached_property
    def _moving(self) -> FloatArray:
        """(N,) (v/v_rms)^2 of all rows."""
        speed = self.samples.signals.velocity[self.samples.rows]
        return np.asarray((speed / max(rms(speed), 1e-300)) ** 2)

    def variances(self, noise: NoiseModel) -> FloatArray:
        """(N,) variance of the white noise of all rows over s^2."""
        return noise.white(self._at_rest, self._moving)

    def weighed(self, residual: FloatArray, noise: NoiseModel) -> FloatArray:
        """(N,) residual of all rows over the deviation of its white noise."""
        return np.asarray(residual / np.sqrt(self.variances(noise)))

    def whitened(self, values: FloatArray, noise: NoiseModel) -> tuple[FloatArray, float]:
        """Values (N,) or (N, k) of all rows, whitened on those that count (n, k), and the log determinant."""
        return self.innovations(values.reshape(values.shape[0], -1)[self.index], noise)

    def innovations(self, values: FloatArray, noise: NoiseModel) -> tuple[FloatArray, float]:
        """Values (n, k) of the rows that count, whitened, and the log determinant."""
        values, out = np.ascontiguousarray(values), np.empty(values.shape)
        white = noise.white(*self._counting)
        return out, float(_whiten(values, self.apart, white, noise.ratio, noise.memory, out))

    @cached_property
    def _counting(self) -> tuple[FloatArray, FloatArray]:
        """`_at_rest` and `_moving` of the rows that count (n,)."""
        return self._at_rest[self.index], self._moving[self.index]


def drawn_noise(samples: Samples, *, measured: bool) -> list[Samples]:
    """The samples with the noise of position, torque sensor (`measured`) and effort drawn once more, one at a time.

    As large as the log shows each channel's, after the light kernel; where the instants of sampling scatter, the
    position's and the command's grow with the speed. Channels are drawn apart because a product of the
    noise of two is 0 on average, and not in one draw.
    """
    level, s, light = samples.resolution, samples.signals, samples.light
    random = np.random.default_rng(SEED)
    raw, white, third = random.standard_normal((3, len(s)))
    slow = slower(light)
    if level.raw_velocity_noise > 0.0:
        velocity = level.raw_velocity_noise * raw
        motion = (np.zeros(len(s)), light.smooth(velocity), light.derivative(velocity))
        slow_motion = (np.zeros(len(s)), slow.derivative(velocity))
    else:
        position = raw * (level.position_noise if level.timing is None else level.timing.position_noise(s.velocity))
        motion = (light.smooth(position), light.derivative(position), light.second_derivative(position))
        slow_motion = (slow.smooth(position), slow.second_derivative(position))
    names = ("position", "velocity", "acceleration")
    changes = [dict(zip(names, motion, strict=True))]
    if not measured:
        changes[0]["load_torque"] = s.load_slope * motion[0] + s.link_inertia * motion[2]
        changes[0]["slow_torque"] = s.load_slope * slow_motion[0] + s.link_inertia * slow_motion[1]
    if samples.floor.servo:
        changes[0]["effort"] = -motion[0]
    if measured and level.torque_noise > 0.0:
        stay = level.torque_pole(s.period)
        torque = lfilter([np.sqrt(1.0 - stay**2)], [1.0, -stay], white)
        changes.append({"load_torque": level.torque_noise * light.smooth(torque)})
    own = max(level.effort_noise, level.effort_step / np.sqrt(12.0))
    if own > 0.0 or level.command_scatter > 0.0:
        moving = level.command_scatter * s.velocity  # a part of the mean square of all
        noise = light.smooth(third * np.sqrt(np.maximum(own**2 - np.mean(moving**2), 0.0) + moving**2))
        changes.append({"effort": noise} | ({"command": noise} if samples.floor.servo else {}))
    return [
        replace(
            samples, signals=replace(s, **{name: getattr(s, name) + more for name, more in each.items()})
        ).with_settled_margins()
        for each in changes
    ]


def independent_share(rows: Rows, residual: FloatArray) -> float:
    """One over the integrated autocorrelation time of a residual (N,), in rows that count."""
    values, total = residual[rows.index], np.zeros(LONGEST_LAG)
    starts = np.flatnonzero(np.isinf(rows.apart))
    for start, stop in zip(starts, np.append(starts[1:], values.size), strict=True):
        own = values[start:stop]
        for lag in range(min(LONGEST_LAG, own.size)):
            total[lag] += own[: own.size - lag] @ own[lag:]
    correlation = total[1:] / max(total[0], 1e-300)
    end = int(np.argmax(correlation < UNCORRELATED)) if np.any(correlation < UNCORRELATED) else correlation.size
    return float(1.0 / (1.0 + 2.0 * correlation[:end].sum()))


def fitted_noise(rows: Rows, residual: FloatArray, *, slow: bool = True) -> NoiseModel:
    """The noise model under which a residual (N,) is most likely; without a discrepancy where it is not `slow`."""
    own, count = residual[rows.index][:, None], rows.index.size

    @cache
    def likelihood(model: NoiseModel) -> float:
        white, log_determinant = rows.innovations(own, model)
        return -0.5 * count * float(np.log(max(float(np.mean(white**2)), 1e-300))) - 0.5 * log_determinant

    def uneven(model: NoiseModel) -> NoiseModel:
        best = max((replace(model, rest=rest) for rest in RESTS), key=likelihood)
        return max((replace(best, moving=moving) for moving in MOVING), key=likelihood)

    alike = uneven(NoiseModel())
    if not slow:
        return alike
    tried = [NoiseModel(r, memory) for r in RATIOS for memory in (MEMORIES_S if r > 0.0 else MEMORIES_S[:1])]
    found = []
    for rest, moving in sorted({(0.0, 0.0), (alike.rest, alike.moving)}):
        best = max((replace(model, rest=rest, moving=moving) for model in tried), key=likelihood)
        found.append(uneven(best))
    return max(found, key=likelihood)


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
        turns = np.flatnonzero(np.diff(samples.sliding[inner], prepend=False, append=False))
        for start, stop in zip(turns[::2], turns[1::2], strict=True):
            own = values[inner][start:stop]
            if own.size > edge:
                total += own.size * _density(own, rate)
                count += own.size
    return total / count if count else None


def _density(values: FloatArray, rate: float) -> FloatArray:
    """One-sided spectral density (F,) of values (T,) at a rate [Hz], by Welch's method with Hann windows.

    As `scipy.signal.welch`, a call of which takes ten times as long for a few hundred values.
    """
    size = min(values.size, SPECTRUM)
    frames = values[None] if values.size == size else sliding_window_view(values, size)[:: size - size // 2]
    density = np.mean(np.abs(np.fft.rfft(frames * _window(size), SPECTRUM)) ** 2, axis=0) / rate
    density[1:-1] *= 2.0
    return np.asarray(density)


@lru_cache(maxsize=SPECTRUM)
def _window(size: int) -> FloatArray:
    """Hann window (size,) of unit power."""
    window = get_window("hann", size)
    return np.asarray(window / np.sqrt(window @ window))
