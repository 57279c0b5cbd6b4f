"""Spectral density of the residual before and after, beside that of the noise floor."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.ticker import FuncFormatter, NullFormatter

from drake_tc.diagnosis.data.noise_colour import spectral_density
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.problem.columns import BalanceCoefficients
from drake_tc.diagnosis.residual.over_time import spectral_line
from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.thresholds import LEAST_LINE
from drake_tc.report.numbers import percent, pretty_unit, scale_for, significant
from drake_tc.report.plots.svg import AFTER, BEFORE, INK, MUTED, SHADE, new_figure, page_style, to_svg
from drake_tc.types import FloatArray

SIZE = (8.2, 2.6)
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
