"""Noise that the floor of white sensor noise does not hold: what it leaves in the band of the regression.

**Noise of a torque sensor that is correlated over milliseconds.** The noise floor is read from the highest frequencies
of the log, where noise of a sensor with a filter of its own is small. What the final model leaves above the band of the
motion shows the rest: its spectral density is taken to be

    S(f) = S_w + S_c/(1 + (2 pi f T)^2),   3 ms <= T <= 53 ms,   f from 5 Hz to the end of the filters' band,

fitted to S = min(S_e, S_tau)/|H|^2, H the filters' gain: noise of the sensor is in the torque channel too, so it cannot
be larger than what that channel holds. The floor is then the root of the integral of S |H|^2 over all frequencies. What
the model leaves below 5 Hz takes no part in the fit, so a cause that acts there does not raise its own floor. The
estimate counts only where S has that form and the residual is equally loud all the time, as noise of a sensor is. One
sensor has one T: training and held-out runs share it and the test of the form, and each has its own S_c. In 13 s of
rows the lowest band, 0.9 Hz wide, has 12 periods, whose density scatters by 1/sqrt(12): as much as the test allows.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import welch

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.types import FloatArray

LOWEST_HZ = 5.0
LEAST_TOP_HZ = 8.0
BANDS = 16
LEAST_GAIN = 0.05
"""Squared gain of the filters at the upper end of the band that is fitted."""
EDGE_GAIN = 0.5
"""Squared gain at which the edge of the filters' band begins."""
MOST_MISFIT = 0.30
MOST_UNEVENNESS = 2.5
"""Set on the calibration seed: noise of a sensor leaves at most 0.25 and 2.3."""
WELCH_SECONDS = 4.0
"""Length of the windows of the torque channel's density."""
TIMES = np.geomspace(0.003, 0.053, 15)


@dataclass(frozen=True)
class CorrelatedNoise:
    """What correlated noise leaves.

    Attributes:
        rms: On the rows [N m].
        correlation_time: T [s].
        misfit: RMS difference between the logarithms of S and of its form, over the bands of all splits.
        unevenness: 95th percentile of the residual's RMS in half seconds over the median.
    """

    rms: float
    correlation_time: float
    misfit: float
    unevenness: float

    @property
    def is_noise(self) -> bool:
        """Whether what is left looks like noise of a sensor."""
        return self.misfit <= MOST_MISFIT and self.unevenness <= MOST_UNEVENNESS


def spectral_density(samples: Samples, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(frequency (F,) [Hz], one-sided density (F,) [unit^2/Hz]) of values (N,) on the rows, all runs together."""
    time, step = samples.signals.time[samples.rows], samples.row_period
    runs = np.unique(samples.run)
    longest = max(float(np.ptp(time[samples.run == k])) for k in runs)
    size = int(longest / step) + 2
    power = np.zeros(size // 2 + 1)
    for k in runs:
        rows = samples.run == k
        slot = np.round((time[rows] - time[rows][0]) / step).astype(int)
        grid = np.bincount(slot, values[rows] - values[rows].mean(), size)[:size]
        power += np.abs(np.fft.rfft(grid, size)) ** 2
    return np.asarray(np.fft.rfftfreq(size, step)), np.asarray(2.0 * step * power / values.size)


def channel_density(samples: Samples, frequency: FloatArray) -> FloatArray:
    """One-sided density (F,) [(N m)^2/Hz] of the torque channel after both filters, at the frequencies (F,) [Hz].

    Welch's estimate with Hann windows on whole stretches: the gaps between the rows, and windows without a taper, would
    spread the large load at low frequencies over the band in which the noise is looked for.
    """
    signals = samples.signals
    torque = samples.kernel.smooth(signals.load_torque)
    edge = samples.light.margin + samples.kernel.margin
    parts = [torque[s.start + edge : s.stop - edge] for s in samples.segments if s.stop - s.start > 2 * edge + 8]
    total = np.zeros_like(frequency)
    for part in parts:
        size = min(part.size, round(WELCH_SECONDS / signals.period))
        found, density = welch(part, 1.0 / signals.period, nperseg=size)
        total += part.size * np.interp(frequency, found, density)
    return np.asarray(total / max(sum(part.size for part in parts), 1))


def left_by_effort_noise(samples: Samples, residual: FloatArray, floor: float) -> float:
    """RMS [effort] that white noise of a recorded current, voltage or goal leaves on the rows, as the module says.

    At most what the residual has beyond the other sensors' noise. 0 where the floor of all fits has it already.

    Args:
        samples: Rows of one split.
        residual: (N,) of a model [effort].
        floor: RMS of what the other sensors' noise leaves [effort].
    """
    resolution = samples.resolution
    variance = max(resolution.effort_noise**2 - resolution.effort_step**2 / 12.0, 0.0)
    if resolution.effort_tells_load or variance == 0.0:
        return 0.0
    frequency, left = spectral_density(samples, residual)
    gain = (samples.light.gain(frequency) * samples.kernel.gain(frequency)) ** 2
    edge = (gain >= LEAST_GAIN) & (gain <= EDGE_GAIN)
    held = float(np.sum(left[edge]) / np.sum(gain[edge])) if edge.any() else 0.0
    density = min(2.0 * variance * samples.signals.period, held)
    most = max(float(np.mean(residual**2)) - floor**2, 0.0)
    return float(np.sqrt(min(density * np.trapezoid(gain, frequency), most)))


@dataclass(frozen=True)
class _Spectrum:
    """Densities of one split.

    Attributes:
        frequency: (F,) [Hz]. gain: (F,) squared gain of the filters.
        centres: (B,) of the bands [Hz]. density: (B,) S of the bands. white: S_w [(N m)^2/Hz].
    """

    frequency: FloatArray
    gain: FloatArray
    centres: FloatArray
    density: FloatArray
    white: float

    def level(self, memory: float) -> float:
        """S_c beside this T [s], the median over the bands."""
        fall = 1.0 + (2.0 * np.pi * self.centres * memory) ** 2
        return float(np.median(np.maximum(self.density - self.white, 0.0) * fall))

    def form(self, frequency: FloatArray, memory: float) -> FloatArray:
        """The form of S (F,) at the frequencies."""
        return self.white + self.level(memory) / (1.0 + (2.0 * np.pi * frequency * memory) ** 2)


def correlated_noise(splits: Sequence[tuple[Samples, FloatArray]]) -> list[CorrelatedNoise | None]:
    """Of each split, what noise of the torque channel leaves, white part included; None where its band is too narrow.

    Args:
        splits: Rows, and the residual (N,) of the final model on them [N m].
    """
    spectra = [_spectrum(samples, residual) for samples, residual in splits]
    known = [each for each in spectra if each is not None]
    if not known:
        return [None] * len(splits)
    density = np.maximum(np.concatenate([each.density for each in known]), 1e-300)
    forms = ([each.form(each.centres, memory) for each in known] for memory in TIMES)
    errors = [np.log(np.maximum(np.concatenate(form), 1e-300) / density) for form in forms]
    best = int(np.argmin([np.sum(e**2) for e in errors]))
    memory, misfit = float(TIMES[best]), float(np.sqrt(np.mean(errors[best] ** 2)))
    found: list[CorrelatedNoise | None] = []
    for each, (samples, residual) in zip(spectra, splits, strict=True):
        if each is None:
            found.append(None)
            continue
        rms = float(np.sqrt(np.trapezoid(each.form(each.frequency, memory) * each.gain, each.frequency)))
        found.append(CorrelatedNoise(rms, memory, misfit, _unevenness(samples, residual)))
    return found


def _spectrum(samples: Samples, residual: FloatArray) -> _Spectrum | None:
    """S of one split in its bands; None where they are too narrow to tell."""
    frequency, left = spectral_density(samples, residual)
    channel = channel_density(samples, frequency)
    gain = (samples.light.gain(frequency) * samples.kernel.gain(frequency)) ** 2
    usable = (frequency >= LOWEST_HZ) & (gain >= LEAST_GAIN)
    if not usable.any() or float(frequency[usable].max()) < LEAST_TOP_HZ:
        return None
    edges = np.geomspace(LOWEST_HZ, float(frequency[usable].max()) * 1.0001, BANDS + 1)
    number = np.digitize(frequency, edges) - 1
    bands = [band for b in range(BANDS) if (band := usable & (number == b)).sum() >= 3]
    if len(bands) < BANDS // 2:
        return None
    means = [[float(np.mean(each[band] / gain[band])) for each in (left, channel)] for band in bands]
    centres = np.array([float(np.mean(frequency[band])) for band in bands])
    white = 2.0 * samples.resolution.torque_noise**2 * samples.signals.period
    return _Spectrum(frequency, gain, centres, np.min(np.array(means), axis=1), white)


def _unevenness(samples: Samples, residual: FloatArray) -> float:
    """95th percentile of the RMS of half-second blocks over their median."""
    count = int(samples.block.max()) + 1
    rows = np.bincount(samples.block, minlength=count)
    level = np.sqrt(np.bincount(samples.block, residual**2, count) / np.maximum(rows, 1))
    full = rows >= 0.3 * rows.max()
    return float(np.percentile(level[full], 95.0) / max(float(np.median(level[full])), 1e-300))
