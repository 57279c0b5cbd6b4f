"""The residual against one quantity: points coloured by direction, reversals apart, binned medians with quartiles."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from drake_tc.report.bins import MOST_POINTS, binned, evenly, frame
from drake_tc.report.numbers import Scale, significant
from drake_tc.report.rows import Quantity, Rows
from drake_tc.report.svg import (
    BACKWARD,
    BACKWARD_DOT,
    FORWARD,
    FORWARD_DOT,
    INK,
    MUTED,
    PIXELS_PER_INCH,
    REVERSAL_DOT,
    SHADE,
    new_figure,
    page_style,
    to_svg,
)
from drake_tc.types import BoolArray, FloatArray

LEGEND = (
    ("forward", "moving forwards"),
    ("backward", "moving backwards"),
    ("reversal", "within 0.1 s of a reversal"),
)


@dataclass(frozen=True)
class CloudLook:
    """Most points that a cloud draws, and pixels per inch of their bitmap."""

    most: int = MOST_POINTS
    pixels_per_inch: int = PIXELS_PER_INCH


FULL_LOOK = CloudLook()


@dataclass(frozen=True)
class Cloud:
    """One panel.

    Attributes:
        name: Unique in the page. title: above the frame.
        residual: (N,) [unit of `scale` before its factor].
        scale: The residual's prefix. label: of the y axis.
        floor: Noise floor, drawn as a band about zero.
        line: (N,) a model's prediction to draw as its own binned median, or None.
        size: Width and height [inch]. look: How many points, and how sharp.
    """

    name: str
    title: str
    residual: FloatArray
    scale: Scale
    floor: float
    label: str = "residual"
    line: FloatArray | None = None
    size: tuple[float, float] = (3.0, 2.15)
    look: CloudLook = FULL_LOOK


def cloud_svg(cloud: Cloud, against: Quantity, rows: Rows) -> str:
    """The panel as inline SVG."""
    x, y = against.values, cloud.residual * cloud.scale.factor
    floor = cloud.floor * cloud.scale.factor
    limits = frame(y, floor if np.isfinite(floor) else 0.0)
    with page_style(cloud.name):
        figure = new_figure(*cloud.size)
        axes = figure.add_subplot()
        for begin, end in against.shaded:
            axes.axvspan(begin, end, color=SHADE, linewidth=0)
        for mark in against.marks:
            axes.axvline(mark, color=MUTED, linewidth=0.7, linestyle=(0, (4, 3)))
        if np.isfinite(floor):
            axes.axhspan(-floor, floor, color=SHADE, linewidth=0)
        _points(axes, x, y, rows, cloud.look.most)
        _medians(axes, x, y, rows, split=against.key != "time")
        if cloud.line is not None:
            _prediction(axes, x, cloud.line * cloud.scale.factor, rows)
        axes.set_ylim(*limits)
        axes.set_xlabel(against.label)
        axes.set_ylabel(f"{cloud.label} [{cloud.scale.unit}]")
        axes.set_title(cloud.title)
        axes.locator_params(nbins=5)
        outside = int(np.sum((y < limits[0]) | (y > limits[1])))
        if outside:
            axes.text(
                0.99,
                0.98,
                f"{outside} beyond the frame",
                transform=axes.transAxes,
                ha="right",
                va="top",
                fontsize=6.5,
                color=MUTED,
            )
        spread = float(np.sqrt(np.mean(cloud.residual**2))) * cloud.scale.factor if y.size else float("nan")
        said = f"{cloud.label} against {against.title}, {cloud.title}: RMS {significant(spread)} {cloud.scale.unit}"
        return to_svg(figure, said, cloud.look.pixels_per_inch)


def _points(axes: Any, x: FloatArray, y: FloatArray, rows: Rows, most: int) -> None:
    kept = np.zeros(x.size, dtype=bool)
    kept[evenly(x.size, most)] = True
    groups: tuple[tuple[BoolArray, str, str, float], ...] = (
        (~rows.reversal & (rows.direction >= 0.0), FORWARD_DOT, "o", 3.0),
        (~rows.reversal & (rows.direction < 0.0), BACKWARD_DOT, "o", 3.0),
        (rows.reversal, REVERSAL_DOT, "x", 6.0),
    )
    for chosen, colour, marker, size in groups:
        shown = chosen & kept
        line = 0.6 if marker == "x" else 0.0
        axes.scatter(
            x[shown],
            y[shown],
            s=size,
            c=colour,
            marker=marker,
            linewidths=line,
            alpha=0.55,
            rasterized=True,
            zorder=2.0,
        )


def _medians(axes: Any, x: FloatArray, y: FloatArray, rows: Rows, *, split: bool) -> None:
    steady = ~rows.reversal if (~rows.reversal).sum() > 50 else np.ones(x.size, dtype=bool)
    groups = [(steady, INK)]
    if split:
        groups = [(steady & (rows.direction >= 0.0), FORWARD), (steady & (rows.direction < 0.0), BACKWARD)]
    for chosen, colour in groups:
        found = binned(x[chosen], y[chosen], 48 if not split else 24)
        axes.fill_between(found.x, found.low, found.high, color=colour, alpha=0.22, linewidth=0, zorder=2.5)
        axes.plot(found.x, found.middle, color=colour, linewidth=1.5, zorder=3.0)


def _prediction(axes: Any, x: FloatArray, line: FloatArray, rows: Rows) -> None:
    for chosen in (rows.direction >= 0.0, rows.direction < 0.0):
        found = binned(x[chosen], line[chosen])
        axes.plot(found.x, found.middle, color=INK, linewidth=1.1, linestyle=(0, (5, 2)), zorder=4.0)
