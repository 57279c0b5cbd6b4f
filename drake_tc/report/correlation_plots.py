"""Correlograms of the residual before and after, with the bands outside which chance does not put them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.report.correlation import Correlation, autocorrelation, cross_correlation, on_grid
from drake_tc.report.rows import LABELS
from drake_tc.report.svg import AFTER, BEFORE, MUTED, SHADE, new_figure, page_style, to_svg

LONGEST_S = 1.0
SIGNALS = ("velocity", "acceleration", "load_torque")
SIZE = (4.4, 2.4)
MOST_LAGS = 150
"""Drawn of each curve."""


def correlation_plots(split: DataSplit, prefix: str) -> Sequence[str]:
    """Auto-correlation, then cross-correlation with velocity, acceleration and load torque: four panels of SVG."""
    samples = split.samples
    time = samples.signals.time[samples.rows]
    longest = min(LONGEST_S, 0.25 * float(np.ptp(time)))
    before, after = on_grid(samples, split.before), on_grid(samples, split.after)
    reach = (samples.light.margin + samples.kernel.margin) * samples.signals.period
    own = [autocorrelation(r, longest) for r in (before, after)]
    pictures = [_panel(f"{prefix}-auto", "residual with itself", own[0], own[1], reach)]
    for name in SIGNALS:
        values = getattr(samples.signals, name)[samples.rows]
        if not np.isfinite(values).all():
            continue
        signal = on_grid(samples, values)
        pair = [cross_correlation(r, signal, longest) for r in (before, after)]
        pictures.append(_panel(f"{prefix}-cross-{name}", f"residual with {LABELS[name][0]}", pair[0], pair[1], 0.0))
    return pictures


def _panel(name: str, title: str, before: Correlation, after: Correlation, reach: float) -> str:
    before, after = before.thinned(MOST_LAGS), after.thinned(MOST_LAGS)
    with page_style(name):
        figure = new_figure(*SIZE)
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
