"""Spectral density and correlations of the residual before and after, with the noise floor and 95 % bands.

Correlations are those of series with gaps.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.ticker import FuncFormatter, NullFormatter

from drake_tc.diagnosis.data.noise_colour import spectral_density
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.priors import LEAST_LINE
from drake_tc.diagnosis.problem.columns import BalanceCoefficients
from drake_tc.diagnosis.residual.over_time import spectral_line
from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.report.numbers import percent, pretty_unit, scale_for, significant
from drake_tc.report.plots.rows import LABELS, extreme_samples
from drake_tc.report.plots.svg import AFTER, BEFORE, INK, MUTED, SHADE, new_figure, page_style, to_svg
from drake_tc.types import FloatArray

LEAST_PAIRS = 30


@dataclass(frozen=True)
class Gridded:
    """A series on a uniform grid, run by run: values (centred, 0 where there is no row) and where there are rows.

    Attributes:
        values, present: One pair of (G,) arrays a run.
        step: Grid step [s].
    """

    values: tuple[FloatArray, ...]
    present: tuple[FloatArray, ...]
    step: float


def on_grid(samples: Samples, values: FloatArray) -> Gridded:
    """Rows (N,) on their runs' uniform grids; rows that fall on one slot are averaged."""
    time = samples.signals.time[samples.rows]
    centred = values - np.mean(values)
    parts, masks = [], []
    for k in np.unique(samples.run):
        mine = samples.run == k
        slot = np.round((time[mine] - time[mine][0]) / samples.row_period).astype(int)
        count = np.bincount(slot)
        parts.append(np.asarray(np.bincount(slot, centred[mine]) / np.maximum(count, 1)))
        masks.append(np.asarray(count > 0, dtype=float))
    return Gridded(tuple(parts), tuple(masks), samples.row_period)


@dataclass(frozen=True)
class Correlation:
    """Correlation (L,) over lags (L,) [s] with half the width of its 95 % band (L,); NaN where pairs are too few."""

    lag: FloatArray
    value: FloatArray
    band: FloatArray

    def thinned(self, most: int) -> "Correlation":
        """The same at about `most` of the lags; every extreme stays, and one NaN of each stretch without a value."""
        unknown = np.isnan(self.value)
        breaks = np.flatnonzero(unknown & ~np.concatenate([[False], unknown[:-1]]))
        kept = np.union1d(extreme_samples([self.value], most), breaks)
        return Correlation(self.lag[kept], self.value[kept], np.where(unknown, np.nan, self.band)[kept])


def _lagged(a: Sequence[FloatArray], b: Sequence[FloatArray], most: int) -> FloatArray:
    """sum_i a_i b_{i+k} over all runs, k = -most ... most: (2 most + 1,)."""
    total = np.zeros(2 * most + 1)
    for x, y in zip(a, b, strict=True):
        size = int(2 ** np.ceil(np.log2(x.size + most + 1)))
        full = np.fft.irfft(np.conj(np.fft.rfft(x, size)) * np.fft.rfft(y, size), size)
        total += np.concatenate([full[size - most :], full[: most + 1]])
    return total


def _normalised(a: Gridded, b: Gridded, most: int) -> tuple[FloatArray, FloatArray]:
    """Correlation and number of pairs at lags -most ... most, each (2 most + 1,)."""
    pairs = np.round(_lagged(a.present, b.present, most))
    covariance = _lagged(a.values, b.values, most) / np.maximum(pairs, 1.0)
    scale = np.sqrt(_power(a) * _power(b))
    value = covariance / scale if scale > 0.0 else np.zeros_like(covariance)
    return np.where(pairs >= LEAST_PAIRS, value, np.nan), pairs


def _power(series: Gridded) -> float:
    rows = sum(float(m.sum()) for m in series.present)
    return sum(float(np.sum(v**2)) for v in series.values) / max(rows, 1.0)


def autocorrelation(series: Gridded, longest: float) -> Correlation:
    """rho(k) = sum_i r_i r_{i+k} / (pairs var r), k from 0 to `longest` [s], over the pairs that exist.

    The band is that of white noise, 1.96 / sqrt(pairs): what leaves it is not white.
    """
    most = max(1, round(longest / series.step))
    value, pairs = _normalised(series, series, most)
    lag = np.asarray(series.step * np.arange(most + 1), dtype=np.float64)
    return Correlation(lag, value[most:], 1.96 / np.sqrt(np.maximum(pairs[most:], 1.0)))


def cross_correlation(residual: Gridded, signal: Gridded, longest: float) -> Correlation:
    """Corr(signal(t), residual(t + lag)), lag from -longest to longest [s]; a positive lag: the residual follows.

    The band is Bartlett's for two independent series that are each autocorrelated,
    1.96 sqrt(sum_h rho_r(h) rho_x(h) / pairs), the sum at least 1, which is the white-noise band.
    Source: Bartlett (1946); Box, Jenkins and Reinsel (2008), eq. 12.1.9.
    """
    most = max(1, round(longest / residual.step))
    value, pairs = _normalised(signal, residual, most)
    memory = 2 * most
    own, _ = _normalised(residual, residual, memory)
    other, _ = _normalised(signal, signal, memory)
    widening = max(1.0, float(np.nansum(own * other)))
    lag = np.asarray(residual.step * np.arange(-most, most + 1), dtype=np.float64)
    return Correlation(lag, value, 1.96 * np.sqrt(widening / np.maximum(pairs, 1.0)))


LONGEST_S = 1.0
SIGNALS = ("velocity", "acceleration", "load_torque")
CORRELOGRAM_SIZE = (4.4, 2.4)
MOST_LAGS = 150
"""Drawn of each curve."""


@dataclass(frozen=True)
class Outside:
    """A correlation of the residual after that leaves its band at more lags than chance makes it leave.

    Attributes:
        title: Of its panel.
        value: Farthest outside. band: half the width of the band there. lag: There [s].
    """

    title: str
    value: float
    band: float
    lag: float


BY_CHANCE = 0.05
"""Share of the lags that lie outside a 95 % band by chance."""


def outside(title: str, found: Correlation, reach: float = 0.0) -> Outside | None:
    """Where a correlation is farthest outside its band, beyond the lags that the filters alone correlate [s]."""
    counted = np.isfinite(found.value) & (np.abs(found.lag) > reach)
    beyond = np.where(counted, np.abs(found.value) / found.band, 0.0)
    if np.count_nonzero(beyond > 1.0) <= BY_CHANCE * np.count_nonzero(counted):
        return None
    at = int(np.argmax(beyond))
    return Outside(title, float(found.value[at]), float(found.band[at]), float(found.lag[at]))


def correlation_plots(split: DataSplit, prefix: str) -> tuple[Sequence[str], Sequence[Outside]]:
    """Auto-correlation, then cross-correlation with velocity, acceleration and load torque.

    Returns:
        Four panels of SVG, and those of them in which the residual after leaves its band.
    """
    samples = split.samples
    time = samples.signals.time[samples.rows]
    longest = min(LONGEST_S, 0.25 * float(np.ptp(time)))
    before, after = on_grid(samples, split.before), on_grid(samples, split.after)
    reach = (samples.light.margin + samples.kernel.margin) * samples.signals.period
    own = [autocorrelation(r, longest) for r in (before, after)]
    pictures = [_panel(f"{prefix}-auto", "residual with itself", own[0], own[1], reach)]
    left = [outside("itself", own[1], reach)]
    for name in SIGNALS:
        values = getattr(samples.signals, name)[samples.rows]
        if not np.isfinite(values).all():
            continue
        signal = on_grid(samples, values)
        pair = [cross_correlation(r, signal, longest) for r in (before, after)]
        pictures.append(_panel(f"{prefix}-cross-{name}", f"residual with {LABELS[name][0]}", pair[0], pair[1], 0.0))
        left.append(outside(LABELS[name][0], pair[1]))
    return pictures, [each for each in left if each is not None]


def _panel(name: str, title: str, before: Correlation, after: Correlation, reach: float) -> str:
    before, after = before.thinned(MOST_LAGS), after.thinned(MOST_LAGS)
    with page_style(name):
        figure = new_figure(*CORRELOGRAM_SIZE)
        axes: Any = figure.add_subplot()
        if reach > 0.0:
            axes.axvspan(0.0, reach, color=SHADE, linewidth=0)
        axes.axhline(0.0, color=MUTED, linewidth=0.7)
        for series, colour, dash, label in (
            (before, BEFORE, (0, (4, 2)), "before"),
            (after, AFTER, "solid", "after"),
        ):
            axes.fill_between(series.lag, -series.band, series.band, color=colour, alpha=0.16, linewidth=0)
            axes.plot(series.lag, series.value, color=colour, linestyle=dash, linewidth=1.3, label=label)
        seen = np.concatenate([before.value, after.value, [-0.2, 0.2]])
        axes.set_ylim(1.08 * np.nanmin(seen), 1.08 * np.nanmax(seen))
        axes.set_xlim(after.lag[0], after.lag[-1])
        axes.set_xlabel("lag [s]")
        axes.set_ylabel("correlation")
        axes.set_title(title)
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2, handlelength=1.8, borderaxespad=0.0)
        return to_svg(figure, f"correlation of the {title}, before and after")


SIZE = (6.2, 2.5)
BANDS_PER_OCTAVE = 12
LEAST_GAIN = 0.05
"""Amplitude that the filters pass at the upper end of the frequencies shown."""
DECADES = 4.5


@dataclass(frozen=True)
class SpectrumPlot:
    """Spectra of one joint: SVG, and a sentence on each line that is marked."""

    svg: str
    lines: Sequence[str]


def banded(frequency: FloatArray, density: FloatArray, lowest: float, highest: float) -> tuple[FloatArray, FloatArray]:
    """(frequencies (B,), mean densities (B,)) in bands of a twelfth of an octave that hold a frequency (F,)."""
    count = max(2, int(np.ceil(BANDS_PER_OCTAVE * np.log2(highest / lowest))))
    edges = np.geomspace(lowest, highest, count + 1)
    band = np.digitize(frequency, edges) - 1
    inside = (band >= 0) & (band < count)
    rows = np.bincount(band[inside], minlength=count)
    total = np.bincount(band[inside], density[inside], count)
    middle = np.bincount(band[inside], frequency[inside], count)
    full = rows > 0
    return middle[full] / rows[full], total[full] / rows[full]


def floor_density(joint: JointResult, samples: Samples, frequency: FloatArray) -> FloatArray:
    """One-sided density (F,) of the noise floor [effort^2/Hz] at the frequencies (F,) [Hz].

    Noise of torque sensor, effort and encoder that is white before the filters, through the balance of the final model:

        S(f) = |H|^2 (S_tau + S_y/K^2 + S_q |-J w^2 + i w F_v + s|^2),   w = 2 pi f

    with s the slope of the load (and 1/K of a position servo). Each part has the variance that `NoiseFloor` states, and
    all together have the RMS of the noise floor.
    """
    floor, final = samples.floor, joint.final
    known = BalanceCoefficients.of(final.terms, final.beta, samples.signals.rotor_inertia)
    passed = (samples.light.gain(frequency) * samples.kernel.gain(frequency)) ** 2
    held = floor.load_slope + (known.stiffness if floor.servo else 0.0)
    weights = np.array([floor.inertia + known.inertia, known.viscous, held])
    w = 2.0 * np.pi * frequency
    encoder = passed * ((held - weights[0] * w**2) ** 2 + (known.viscous * w) ** 2)
    memory = samples.resolution.torque_correlation_time
    torque = passed / (1.0 + (w * memory) ** 2)
    parts = (
        (torque, floor.torque_variance),
        (passed, known.stiffness**2 * floor.effort_variance),
        (encoder, float(weights @ floor.encoder_gram @ weights + floor.timing_variance(known.viscous, known.inertia))),
    )
    step = float(frequency[1] - frequency[0])
    total = np.zeros_like(frequency)
    for shape, variance in parts:
        area = float(np.sum(shape)) * step
        total += shape * (variance / area if area > 0.0 else 0.0)
    area = float(np.sum(total)) * step
    return np.asarray(total * (joint.noise_floor**2 / area if area > 0.0 else 0.0))


def spectrum_plot(joint: JointResult, prefix: str) -> SpectrumPlot | None:
    """Spectra of the residual on the held-out runs; None where they are too short for one."""
    split = joint.heldout
    samples = split.samples
    if split.after.size < 64:
        return None
    frequency, before = spectral_density(samples, split.before)
    after = spectral_density(samples, split.after)[1]
    gain = np.abs(samples.light.gain(frequency) * samples.kernel.gain(frequency))
    shown = frequency[(gain >= LEAST_GAIN) & (frequency > 0.0)]
    if shown.size < 8:
        return None
    lowest, highest = float(shown[0]), float(shown[-1])
    noise = floor_density(joint, samples, frequency)
    curves = {
        name: banded(frequency, values, lowest, highest)
        for name, values in (("before", before), ("after", after), ("noise floor", noise))
    }
    lines = _lines(joint, split)
    svg = _drawn(joint, f"{prefix}-spectrum", curves, [f for f, _ in lines], (lowest, highest))
    return SpectrumPlot(svg, [text for _, text in lines])


def _lines(joint: JointResult, split: DataSplit) -> list[tuple[float, str]]:
    """(frequency [Hz], sentence) of the lines to mark: those that hold much of the residual, before or after."""
    out = []
    for name in ("before", "after"):
        residual = split.before if name == "before" else split.after
        hertz, share = spectral_line(DataSplit(split.samples, split.before, residual))
        if share >= LEAST_LINE:
            where = f"The residual {name} has a line at {significant(hertz)} Hz"
            out.append((hertz, f"{where}, which holds {percent(share)} of its variance."))
    left = joint.unexplained.period_hz
    if left is not None and all(abs(left - hertz) > 0.02 * left for hertz, _ in out):
        out.append((left, f"What is left repeats at {significant(left)} Hz."))
    return out


def _drawn(
    joint: JointResult,
    name: str,
    curves: dict[str, tuple[FloatArray, FloatArray]],
    lines: Sequence[float],
    limits: tuple[float, float],
) -> str:
    largest = max((float(np.sqrt(np.max(d))) for _, d in curves.values() if d.size), default=0.0)
    scale = scale_for(largest, joint.unit)
    unit = scale.unit or pretty_unit(joint.unit)
    looks = {"before": (BEFORE, (0, (4, 2))), "after": (AFTER, "solid"), "noise floor": (MUTED, (0, (1, 1.5)))}
    with page_style(name):
        figure = new_figure(*SIZE)
        axes: Any = figure.add_subplot()
        for hertz in lines:
            axes.axvline(hertz, color=INK, linewidth=0.8, linestyle=(0, (4, 3)))
            axes.text(
                hertz, 1.0, f" {significant(hertz)} Hz", transform=axes.get_xaxis_transform(), fontsize=7, va="top"
            )
        band = joint.shared_band
        if band is not None and limits[0] < band.limit_hz < limits[1]:
            axes.axvspan(band.limit_hz, limits[1], color=SHADE, linewidth=0)
        for label, (frequency, density) in curves.items():
            colour, dash = looks[label]
            label = label if label == "noise floor" else f"residual {label}"
            amplitude = scale.factor * np.sqrt(density)
            axes.loglog(frequency, amplitude, color=colour, linestyle=dash, linewidth=1.2, label=label)
        top = scale.factor * largest
        bottom = min((float(np.min(d[d > 0.0])) for _, d in curves.values() if (d > 0.0).any()), default=0.0)
        if top > 0.0:
            axes.set_ylim(max(scale.factor * np.sqrt(bottom), top * 10.0**-DECADES), 1.6 * top)
        axes.set_xlim(*limits)
        axes.xaxis.set_major_formatter(FuncFormatter(lambda f, _: f"{f:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlabel("frequency [Hz]")
        axes.set_ylabel(f"amplitude density [{unit}/√Hz]")
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=3, handlelength=1.8, borderaxespad=0.0)
        return to_svg(figure, "spectral density of the residual before and after, and of the noise floor")
