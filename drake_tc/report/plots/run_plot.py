"""Plots of simulated runs: panels over time with the flags that were up, and a Bode plot of frequency responses."""

from collections.abc import Mapping
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogFormatter

from drake_tc.analysis.frequency_response import FrequencyResponse
from drake_tc.loops.simulated import RunPlot, TimePanel
from drake_tc.types import BoolArray, FloatArray

WIDTH, PANEL_HEIGHT, FLAG_HEIGHT = 9.0, 2.1, 0.25
"""Of the page and of its parts [inch]."""
NAMED = 12
"""Lines of a panel that a legend names at most."""


def run_figure(plot: RunPlot, figure: Any = None) -> Any:
    """The page as a matplotlib Figure.

    Args:
        plot: What to draw.
        figure: To draw into, such as that of a window; None makes one.
    """
    flags = {name: up for name, up in plot.flags.items() if up.any()}
    heights = [PANEL_HEIGHT] * len(plot.panels) + ([0.6 + FLAG_HEIGHT * len(flags)] if flags else [])
    figure = Figure() if figure is None else figure
    figure.set_size_inches(WIDTH, sum(heights) + 0.6)
    figure.set_layout_engine("constrained")
    frames: Any = figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights)
    for axes, panel in zip(frames[:, 0], plot.panels, strict=False):
        _draw(axes, panel)
    if flags:
        _draw_flags(frames[-1, 0], plot.time, flags)
    frames[-1, 0].set_xlabel("time [s]")
    figure.suptitle(f"{plot.title} (simulated)", x=0.01, ha="left", fontsize=11)
    return figure


def _draw(axes: Any, panel: TimePanel) -> None:
    colours = _colours(len(panel.lines))
    for colour, (name, values) in zip(colours, panel.lines.items(), strict=True):
        axes.plot(panel.time, values, color=colour, linewidth=1.0, label=name)
        if name in panel.dashed:
            axes.plot(panel.time, panel.dashed[name], color=colour, linewidth=0.9, linestyle=(0, (4, 3)))
    axes.set_title(panel.title, loc="left", fontsize=9)
    axes.set_ylabel("" if panel.unit == "-" else f"[{panel.unit}]")
    axes.grid(color="#dddddd", linewidth=0.5)
    axes.margins(x=0.0)
    if 1 < len(panel.lines) <= NAMED:
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7, frameon=False)


def _colours(count: int) -> list[Any]:
    """Ten colours that can be told apart; more lines take their colours from a scale."""
    if count <= 10:
        return [f"C{number}" for number in range(count)]
    return list(mpl.colormaps["viridis"](np.linspace(0.0, 0.95, count)))


def _draw_flags(axes: Any, time: FloatArray, flags: Mapping[str, BoolArray]) -> None:
    """A bar for every stretch in which a flag was up."""
    for row, up in enumerate(flags.values()):
        edges = np.flatnonzero(np.diff(np.concatenate([[False], up, [False]]).astype(int)))
        step = time[1] - time[0] if time.size > 1 else 0.0
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            axes.barh(row, time[end - 1] - time[begin] + step, left=time[begin], height=0.6, color="#c15201")
    axes.set_yticks(range(len(flags)), list(flags), fontsize=7)
    axes.invert_yaxis()
    axes.set_title("flags", loc="left", fontsize=9)
    axes.grid(axis="x", color="#dddddd", linewidth=0.5)


def draw_bode(
    figure: Any,
    curves: Mapping[str, FrequencyResponse],
    title: str = "",
    *,
    delay: float | None = None,
) -> None:
    """Draw responses into a matplotlib Figure.

    Args:
        figure: Empty.
        curves: By name; those called "linear ..." are lines, the others dots on lines. Where the turns of one's phase
            are not known its dots stand alone, and the axis says so.
        title: Above.
        delay: Phase of a pure delay [s], drawn beside them; None: not.
    """
    above, below = figure.subplots(2, 1, sharex=True)
    modulo = any(one.turned is None for one in curves.values())
    for name, one in curves.items():
        style = {"linestyle": "--"} if name.startswith("linear") else {"marker": "o", "markersize": 3.0}
        magnitude = np.where(np.isfinite(one.magnitude_db), one.magnitude_db, np.nan)
        above.semilogx(one.frequency_hz, magnitude, label=name, **style)
        alone = {} if one.turned is not None else {"linestyle": "none"}
        below.semilogx(one.frequency_hz, np.degrees(one.phase), label=name, **{**style, **alone})
    if delay is not None:
        grid = np.unique(np.concatenate([one.frequency_hz for one in curves.values()]))
        below.semilogx(grid, -360.0 * grid * delay, "k:", label=f"{1e3 * delay:g} ms")
    above.set_ylabel("|H| [dB]")
    below.set_ylabel("phase modulo 360 [deg]" if modulo else "phase [deg]")
    below.set_xlabel("frequency [Hz]")
    above.set_title(title)
    for axes in (above, below):
        axes.grid(visible=True, which="both", alpha=0.3)
        axes.xaxis.set_major_formatter(FormatStrFormatter("%g"))
        axes.xaxis.set_minor_formatter(LogFormatter(labelOnlyBase=False, minor_thresholds=(2.0, 0.5)))
    below.legend()
