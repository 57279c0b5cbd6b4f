"""Effort and position over time: data for the plots that a reader can zoom, and a picture for where no script runs.

Measured and modelled effort and position of each run over time, thinned to what a screen shows.
"""

import base64
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.result.errors import MODELS
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.report.numbers import Scale, scale_for
from drake_tc.report.plots import svg
from drake_tc.report.plots.rows import extreme_samples
from drake_tc.types import FloatArray, IntArray

GAP_ROWS = 1.5
"""Distance between neighbouring rows, in typical distances, beyond which the line is broken."""
FARTHEST = 10.0
"""A simulated position is drawn up to this many times the recorded range away from the recorded one."""


@dataclass(frozen=True, eq=False)
class Trace:
    """One quantity of one run.

    Attributes:
        run: Name. heldout: whether the run took no part in fitting.
        time: (T,) since the start of the run [s].
        measured: (T,) NaN where the line is broken.
        errors: (T,) modelled minus measured, by model: "before", "after" or "refined", those that were computed.
    """

    run: str
    heldout: bool
    time: FloatArray
    measured: FloatArray
    errors: Mapping[str, FloatArray]

    def thinned(self, most: int) -> "Trace":
        """The same with at most about `most` samples; extremes of all lines and the widest breaks stay."""
        lines = [self.measured, *self.errors.values(), *(self.measured + e for e in self.errors.values())]
        kept = np.unique(np.concatenate([extreme_samples(lines, most), self._breaks(most // 4)]))
        errors = {name: e[kept] for name, e in self.errors.items()}
        return Trace(self.run, self.heldout, self.time[kept], self.measured[kept], errors)

    def _breaks(self, most: int) -> IntArray:
        """Indices of at most `most` breaks, the widest ones."""
        breaks = np.flatnonzero(np.isnan(self.measured[1:-1])) + 1
        width = self.time[breaks + 1] - self.time[breaks - 1]
        return np.sort(breaks[np.argsort(-width, kind="stable")[:most]]).astype(np.int64)


def effort_traces(joint: JointResult) -> Sequence[Trace]:
    """Effort of every run on the rows of the regression [effort], training runs first.

    The modelled effort is the one that the balance needs for the recorded motion and load. It is the measured effort
    plus the residual, and all of them have passed the filters of the regression.
    """
    return [*_effort(joint.train, heldout=False), *_effort(joint.heldout, heldout=True)]


def _effort(split: DataSplit, *, heldout: bool) -> Sequence[Trace]:
    samples = split.samples
    measured = samples.reduce(samples.signals.effort)
    time = samples.signals.time[samples.rows]
    out = []
    for k, run in enumerate(samples.runs):
        mine = samples.run == k
        if mine.any():
            lines = (time[mine], measured[mine], split.before[mine], split.after[mine])
            clock, effort, before, after = _with_breaks(*lines)
            out.append(Trace(run, heldout, clock, effort, {"before": before, "after": after}))
    return out


def _with_breaks(time: FloatArray, *lines: FloatArray) -> tuple[FloatArray, ...]:
    """Time and lines with one NaN sample in each gap between the rows."""
    step = np.diff(time)
    typical = float(np.median(step)) if step.size else 0.0
    gaps = np.flatnonzero(step > GAP_ROWS * typical) + 1
    clock = np.insert(time, gaps, 0.5 * (time[gaps - 1] + time[gaps]))
    return clock, *(np.insert(line, gaps, np.nan) for line in lines)


def position_traces(free_run: Mapping[str, Mapping[str, FloatArray]], heldout: Sequence[str]) -> Sequence[Trace]:
    """Position [rad] of every run that was simulated from the recorded command alone."""
    out = []
    for run, trace in free_run.items():
        recorded = trace["recorded"]
        far = FARTHEST * max(float(np.ptp(recorded)), 1e-9)
        errors = {name: np.clip(trace[name] - recorded, -far, far) for name in MODELS if name in trace}
        out.append(Trace(run, run in heldout, trace["time"], recorded, errors))
    return out


SIZE = (8.6, 3.1)
PICTURE_SAMPLES, FIGURE_SAMPLES = 500, 4000
NAMED = 3
"""Runs that the title of a figure names."""
WORST_S = 3.0
LEVELS = 65534
"""Steps of a value between the smallest and the largest of its line; the number -32768 stands for a break."""


@dataclass(frozen=True)
class TimePlot:
    """One quantity of one joint.

    Attributes:
        id: Unique in the page.
        runs: (name, "training" or "held-out") of each run.
        shown: Index of the run that is shown first: the held-out run with the largest error after.
        picture: That run as SVG.
        data: What the script draws, plain data for JSON.
    """

    id: str
    runs: Sequence[tuple[str, str]]
    shown: int
    picture: str
    data: Mapping[str, Any]


def effort_plot(joint: JointResult, prefix: str, most: int) -> TimePlot | None:
    """Measured and modelled effort of every run; `most` samples of each."""
    return _plot(effort_traces(joint), "effort", joint.unit, f"{prefix}-effort", most)


def position_plot(joint: JointResult, prefix: str, most: int) -> TimePlot | None:
    """Recorded position and those of the models driven by the recorded command; None without a free run."""
    traces = position_traces(joint.free_run, joint.heldout.samples.runs)
    return _plot(traces, "position", joint.units.position, f"{prefix}-position", most)


def _plot(traces: Sequence[Trace], quantity: str, unit: str, name: str, most: int) -> TimePlot | None:
    if not traces:
        return None
    value = scale_for(max(_largest(t.measured) for t in traces), unit)
    error = scale_for(max(_largest(e) for t in traces for e in t.errors.values()), unit)
    last = [_rms(t.errors["after"]) if t.heldout and "after" in t.errors else -1.0 for t in traces]
    shown = int(np.argmax(np.nan_to_num(last, nan=-1.0)))
    runs = [(t.run, "held-out" if t.heldout else "training") for t in traces]
    data = {
        "quantity": quantity,
        "unit": value.unit,
        "errorUnit": error.unit,
        "valuePerError": value.factor / error.factor,
        "runs": [_packed(t.thinned(most), value, error, worst_window(t)) for t in traces],
    }
    return TimePlot(name, runs, shown, _picture(traces[shown], quantity, name, value, error), data)


def _rms(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")


def _largest(values: FloatArray) -> float:
    return float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0


def worst_window(trace: Trace) -> tuple[float, float]:
    """Begin and end [s] of the stretch in which the model after errs most (the model before, if that is all)."""
    time, error = trace.time, trace.errors.get("after", trace.errors.get("before"))
    full = time + WORST_S <= time[-1]
    if error is None or not full.any():
        return float(time[0]), float(time[-1])
    total = np.concatenate([[0.0], np.cumsum(np.abs(np.nan_to_num(error)))])
    last = np.searchsorted(time, time + WORST_S, side="right")
    sums = np.where(full, total[last] - total[np.arange(time.size)], -1.0)
    start = float(time[int(np.argmax(sums))])
    return start, start + WORST_S


def _packed(trace: Trace, value: Scale, error: Scale, worst: tuple[float, float]) -> dict[str, Any]:
    lines = {"measured": trace.measured * value.factor}
    lines |= {name: e * error.factor for name, e in trace.errors.items()}
    return {
        "time": _encoded(trace.time.astype("<f4")),
        "worst": [round(t, 3) for t in worst],
        **{name: packed_line(line) for name, line in lines.items()},
    }


def packed_line(values: FloatArray) -> tuple[float, float, str]:
    """(smallest, largest value, base64 of 16-bit steps between them) of a line (T,), NaN where it is broken."""
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
    share = (np.where(np.isfinite(values), values, low) - low) / ((high - low) or 1.0)
    steps = np.where(np.isfinite(values), np.round(share * LEVELS) - LEVELS // 2, -32768)
    return float(f"{low:.7g}"), float(f"{high:.7g}"), _encoded(steps.astype("<i2"))


def _encoded(values: np.ndarray[Any, Any]) -> str:
    return base64.b64encode(values.tobytes()).decode("ascii")


def _picture(trace: Trace, quantity: str, name: str, value: Scale, error: Scale) -> str:
    """Values above, errors below, without anything to click."""
    with svg.page_style(name):
        figure = svg.new_figure(*SIZE)
        _draw(figure, trace.thinned(PICTURE_SAMPLES), quantity, value, error)
        return svg.to_svg(figure, f"{quantity} over time, {trace.run}: measured and modelled")


def _draw(figure: Figure, trace: Trace, quantity: str, value: Scale, error: Scale) -> tuple[Any, Any]:
    """Draw values above and errors below; returns both frames. The measured line lies above those of the models."""
    looks = {"before": (svg.BEFORE, (0, (4, 2))), "after": (svg.AFTER, "solid"), "refined": (svg.REFINED, (0, (1, 1)))}
    grid = figure.add_gridspec(2, 1, height_ratios=(1.6, 1.0))
    top: Any = figure.add_subplot(grid[0])
    bottom: Any = figure.add_subplot(grid[1], sharex=top)
    top.plot(trace.time, trace.measured * value.factor, color=svg.INK, linewidth=0.9, label="measured", zorder=3)
    for key, line in trace.errors.items():
        colour, dash = looks[key]
        modelled = (trace.measured + line) * value.factor
        top.plot(trace.time, modelled, color=colour, linestyle=dash, linewidth=2.0, label=f"model {key}")
        bottom.plot(trace.time, line * error.factor, color=colour, linestyle=dash, linewidth=1.0, label=key)
    top.tick_params(labelbottom=False)
    top.set_ylabel(f"{quantity} [{value.unit}]")
    top.set_title(trace.run)
    top.margins(x=0.0, y=0.16)
    top.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=4, handlelength=1.8, borderaxespad=0.0)
    bottom.set_ylabel(f"error [{error.unit}]")
    bottom.set_xlabel("time [s]")
    return top, bottom


def residual_figure(joint: JointResult) -> svg.NotebookFigure:
    """Measured and modelled effort on the held-out runs, end to end, and below it the residuals before and after.

    The band about zero is the noise floor. The residual is modelled minus measured effort (`effort_traces`).
    """
    traces = [trace for trace in effort_traces(joint) if trace.heldout]
    joined, starts = _end_to_end(traces)
    value = scale_for(_largest(joined.measured), joint.unit)
    error = scale_for(max(map(_largest, joined.errors.values())), joint.unit)
    with svg.page_style(joint.joint):
        figure = svg.new_figure(*SIZE)
        figure.patch.set(facecolor="white", alpha=1.0)
        top, bottom = _draw(figure, joined.thinned(FIGURE_SAMPLES), "effort", value, error)
        floor = joint.noise_floor * error.factor
        if np.isfinite(floor):
            bottom.axhspan(-floor, floor, color=svg.SHADE, linewidth=0)
        for start in starts[1:]:
            for axes in (top, bottom):
                axes.axvline(start, color=svg.MUTED, linewidth=0.7, linestyle=(0, (4, 3)))
        bottom.set_ylabel(f"residual [{error.unit}]")
        bottom.set_xlabel("time, runs end to end [s]" if len(traces) > 1 else "time [s]")
        FigureCanvasAgg(figure)
    return figure


def _end_to_end(traces: Sequence[Trace]) -> tuple[Trace, Sequence[float]]:
    """The traces one after the other with a break between them, and where each begins [s]."""
    starts, at = [], 0.0
    for trace in traces:
        starts.append(at)
        at += float(trace.time[-1])
    clocks = [start + np.append(trace.time, trace.time[-1]) for trace, start in zip(traces, starts, strict=True)]

    def lines(of: Callable[[Trace], FloatArray]) -> FloatArray:
        return np.concatenate([np.append(of(trace), np.nan) for trace in traces])[:-1]

    errors = {"before": lines(lambda t: t.errors["before"]), "after": lines(lambda t: t.errors["after"])}
    name = ", ".join(trace.run for trace in traces[:NAMED]) + (" ..." if len(traces) > NAMED else "")
    return Trace(name, True, np.concatenate(clocks)[:-1], lines(lambda t: t.measured), errors), starts
