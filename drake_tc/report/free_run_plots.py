"""Free runs: the recorded position beside the diagram driven by the recorded command alone, before and after."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from drake_tc.report.bins import evenly
from drake_tc.report.numbers import scale_for, times
from drake_tc.report.svg import AFTER, BEFORE, INK, new_figure, page_style, to_svg
from drake_tc.types import FloatArray, IntArray

SIZE = (4.3, 3.1)
MOST_SAMPLES = 1600
ZOOM_S = 3.0
Trace = Mapping[str, FloatArray]


@dataclass(frozen=True)
class FreeRunPlot:
    """One run: RMS position errors as text, and two panels of SVG (all of it; the worst three seconds)."""

    run: str
    before: str
    after: str
    fold: str
    whole: str
    zoom: str


def rms_error(trace: Trace, name: str) -> float:
    """RMS of simulated minus recorded position [rad], NaN if the run has no such simulation."""
    if name not in trace:
        return float("nan")
    return float(np.sqrt(np.mean((trace[name] - trace["recorded"]) ** 2)))


def worst_window(trace: Trace, seconds: float = ZOOM_S) -> tuple[float, float]:
    """Begin and end [s] of the stretch in which the model before (or after, if that is all) errs most."""
    time = trace["time"]
    error = np.abs(trace.get("before", trace.get("after", trace["recorded"])) - trace["recorded"])
    total = np.concatenate([[0.0], np.cumsum(np.nan_to_num(error))])
    last = np.searchsorted(time, time + seconds, side="right")
    full = time + seconds <= time[-1]
    if not full.any():
        return float(time[0]), float(time[-1])
    sums = np.where(full, total[last] - total[np.arange(time.size)], -1.0)
    start = float(time[int(np.argmax(sums))])
    return start, start + seconds


def free_run_plots(free_run: Mapping[str, Trace], prefix: str) -> Sequence[FreeRunPlot]:
    """Two panels for each run that was simulated."""
    plots = []
    for number, (run, trace) in enumerate(free_run.items()):
        before, after = rms_error(trace, "before"), rms_error(trace, "after")
        scale = scale_for(np.nanmax([before, after, 0.0]), "rad")
        name = f"{prefix}-free-{number}"
        time = trace["time"]
        begin, end = worst_window(trace)
        inside = np.flatnonzero((time >= begin) & (time <= end))
        plots.append(
            FreeRunPlot(
                run=run,
                before=scale.quantity(before),
                after=scale.quantity(after),
                fold=times(before, after),
                whole=_panel(f"{name}-whole", "whole run", _take(trace, evenly(time.size, MOST_SAMPLES))),
                zoom=_panel(
                    f"{name}-zoom",
                    "worst 3 s",
                    _take(trace, inside[evenly(inside.size, MOST_SAMPLES)]),
                ),
            )
        )
    return plots


def _take(trace: Trace, index: IntArray) -> Trace:
    return {name: values[index] for name, values in trace.items()}


def _panel(name: str, title: str, trace: Trace) -> str:
    time = trace["time"]
    errors = {k: trace[k] - trace["recorded"] for k in ("before", "after") if k in trace}
    largest = max((float(np.nanmax(np.abs(e))) for e in errors.values() if np.isfinite(e).any()), default=0.0)
    scale = scale_for(largest, "rad")
    looks = {"before": (BEFORE, (0, (4, 2))), "after": (AFTER, "solid")}
    with page_style(name):
        figure = new_figure(*SIZE)
        grid = figure.add_gridspec(2, 1, height_ratios=(1.6, 1.0))
        top: Any = figure.add_subplot(grid[0])
        bottom: Any = figure.add_subplot(grid[1], sharex=top)
        top.plot(time, trace["recorded"], color=INK, linewidth=1.6, label="recorded")
        for key, error in errors.items():
            colour, dash = looks[key]
            top.plot(time, trace[key], color=colour, linestyle=dash, linewidth=1.1, label=f"model {key}")
            bottom.plot(time, error * scale.factor, color=colour, linestyle=dash, linewidth=1.0)
        top.tick_params(labelbottom=False)
        top.set_ylabel("position [rad]")
        top.set_title(title)
        top.margins(x=0.0, y=0.16)
        top.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=3, handlelength=1.8, borderaxespad=0.0)
        bottom.set_ylabel(f"error [{scale.unit}]")
        bottom.set_xlabel("time [s]")
        return to_svg(figure, f"free run {title}: recorded position and models")
