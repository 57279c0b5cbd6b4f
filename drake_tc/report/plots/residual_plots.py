"""Plots of the residual of a joint against one quantity: without and with an effect, and what is left.

Points are coloured by direction, reversals apart, with binned medians and quartiles. Where an effect was found, its
plot has the residual without it, what it adds, and the residual with it.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns, coefficients_by_term
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.result.joint_result import FoundEffect, JointResult
from drake_tc.effects.base import DriveEffect
from drake_tc.report.equation import equations
from drake_tc.report.numbers import Scale, fold, percent, scale_for, significant
from drake_tc.report.plots import svg
from drake_tc.report.plots.rows import (
    MOST_POINTS,
    Quantity,
    SplitRows,
    binned,
    evenly,
    frame,
    modulo,
    quantity,
    rows_of,
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
    pixels_per_inch: int = svg.PIXELS_PER_INCH


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


def cloud_svg(cloud: Cloud, against: Quantity, rows: SplitRows) -> str:
    """The panel as inline SVG."""
    x, y = against.values, cloud.residual * cloud.scale.factor
    floor = cloud.floor * cloud.scale.factor
    limits = frame(y, floor if np.isfinite(floor) else 0.0)
    with svg.page_style(cloud.name):
        figure = svg.new_figure(*cloud.size)
        axes = figure.add_subplot()
        for begin, end in against.shaded:
            axes.axvspan(begin, end, color=svg.SHADE, linewidth=0)
        for mark in against.marks:
            axes.axvline(mark, color=svg.MUTED, linewidth=0.7, linestyle=(0, (4, 3)))
        if np.isfinite(floor):
            axes.axhspan(-floor, floor, color=svg.SHADE, linewidth=0)
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
                f"{outside} outside the axes",
                transform=axes.transAxes,
                ha="right",
                va="top",
                fontsize=6.5,
                color=svg.MUTED,
            )
        spread = float(np.sqrt(np.mean(cloud.residual**2))) * cloud.scale.factor if y.size else float("nan")
        said = f"{cloud.label} against {against.title}, {cloud.title}: RMS {significant(spread)} {cloud.scale.unit}"
        return svg.to_svg(figure, said, cloud.look.pixels_per_inch)


def _points(axes: Any, x: FloatArray, y: FloatArray, rows: SplitRows, most: int) -> None:
    kept = np.zeros(x.size, dtype=bool)
    kept[evenly(x.size, most)] = True
    groups: tuple[tuple[BoolArray, str, str, float], ...] = (
        (~rows.reversal & (rows.direction >= 0.0), svg.FORWARD_DOT, "o", 3.0),
        (~rows.reversal & (rows.direction < 0.0), svg.BACKWARD_DOT, "o", 3.0),
        (rows.reversal, svg.REVERSAL_DOT, "x", 6.0),
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


def _medians(axes: Any, x: FloatArray, y: FloatArray, rows: SplitRows, *, split: bool) -> None:
    steady = ~rows.reversal if (~rows.reversal).sum() > 50 else np.ones(x.size, dtype=bool)
    groups = [(steady, svg.INK)]
    if split:
        groups = [(steady & (rows.direction >= 0.0), svg.FORWARD), (steady & (rows.direction < 0.0), svg.BACKWARD)]
    for chosen, colour in groups:
        found = binned(x[chosen], y[chosen], 48 if not split else 24)
        axes.fill_between(found.x, found.low, found.high, color=colour, alpha=0.22, linewidth=0, zorder=2.5)
        axes.plot(found.x, found.middle, color=colour, linewidth=1.5, zorder=3.0)


def _prediction(axes: Any, x: FloatArray, line: FloatArray, rows: SplitRows) -> None:
    for chosen in (rows.direction >= 0.0, rows.direction < 0.0):
        found = binned(x[chosen], line[chosen])
        axes.plot(found.x, found.middle, color=svg.INK, linewidth=1.1, linestyle=(0, (5, 2)), zorder=4.0)


SIZE = (4.2, 2.7)


@dataclass(frozen=True)
class SignaturePlot:
    """An effect's own plot: title, what to look for, the share it removes, its equations and two panels of SVG."""

    title: str
    id: str
    look_for: str
    gain: str
    equations: Sequence[str]
    without: str
    with_it: str


def contribution(split: DataSplit, fitted: Fit, key: str) -> FloatArray:
    """What the effect `key` of the final model takes off the residual (N,) [effort]: residual without minus with it.

    The other effects keep their final parameters. A torque effect's share is -K phi theta, from

        r = K (z - z_hat) = K z - y* + K sum_k theta_k phi_k                      (diagnosis.design)

    and that of an effect on the drive is the difference between the efforts y* with and without it.
    """
    columns = Columns(split.samples)
    share = np.zeros(split.after.shape)
    for term, theta in coefficients_by_term(fitted.terms, fitted.beta):
        if term.effect.key == key:
            if theta.size:
                share = share - fitted.gain * (columns.of(term) @ theta)
            if isinstance(term.effect, DriveEffect) and (term.effect.shapes or term.effect.filters):
                rest = [t for t in fitted.terms if t is not term]
                share = share + columns.effort(fitted.terms) - columns.effort(rest)
    return np.asarray(share)


def cycles_of(fitted: Fit, key: str) -> float | None:
    """Cycles a turn of the effect `key` in the fit, or None if it has none."""
    for term in fitted.terms:
        if term.effect.key == key and term.shape.get("cycles_per_turn", 0.0) > 0.0:
            return float(term.shape["cycles_per_turn"])
    return None


def signature_quantity(split: DataSplit, joint: JointResult, found: FoundEffect) -> Quantity | None:
    """What the effect's signature is drawn against; None if that was not recorded."""
    x = next(t.effect.signature.x for t in joint.final.terms if t.effect.key == found.key)
    if x.startswith("position modulo"):
        cycles = cycles_of(joint.final, found.key)
        return modulo(split, cycles) if cycles else quantity(split, "position", joint.unit)
    return quantity(split, x, joint.unit)


def signature_plots(joint: JointResult, prefix: str, look: CloudLook) -> Sequence[SignaturePlot]:
    """One pair of panels for each effect that was found, on the held-out runs."""
    split = joint.heldout
    rows = rows_of(split)
    plots = []
    for number, found in enumerate(joint.effects):
        against = signature_quantity(split, joint, found)
        if against is None:
            continue
        share = contribution(split, joint.final, found.key)
        without = split.after + share
        scale = scale_for(float(np.max(np.abs(without))), joint.unit)
        fine = scale_for(float(np.max(np.abs(split.after))), joint.unit)
        name, floor = f"{prefix}-signature-{number}", joint.noise_floor
        bare = Cloud(
            f"{name}-without", f"without {found.title}", without, scale, floor, line=share, size=SIZE, look=look
        )
        full = Cloud(f"{name}-with", f"with {found.title}", split.after, fine, floor, size=SIZE, look=look)
        own = next(t.effect for t in joint.final.terms if t.effect.key == found.key)
        plots.append(
            SignaturePlot(
                title=found.title,
                id=found.id,
                look_for=own.signature.look_for,
                gain=percent(found.heldout_gain),
                equations=equations(own, found.parameters),
                without=cloud_svg(bare, against, rows),
                with_it=cloud_svg(full, against, rows),
            )
        )
    return plots


MOST_PLOTS = 4


def leftover_plots(joint: JointResult, prefix: str, look: CloudLook = FULL_LOOK) -> Sequence[str]:
    """Panels of SVG, most important signal first; stretches that stand out are shaded. None without structure.

    The held-out runs are drawn, unless every stretch that stands out lies in the training runs: then those are.
    """
    left = joint.unexplained
    if not left.structured:
        return []
    held = joint.heldout.samples.runs
    in_training = bool(left.confined_to) and not any(s.run in held for s in left.confined_to)
    split, where = (joint.train, "training runs") if in_training else (joint.heldout, "held-out runs")
    rows = rows_of(split)
    scale = scale_for(float(abs(split.after).max()), joint.unit)
    panels = []
    for name in left.depends_on[:MOST_PLOTS]:
        against = quantity(split, name, joint.unit, left.confined_to)
        if against is not None:
            title, own = f"after, {where}", f"{prefix}-left-{name}"
            cloud = Cloud(own, title, split.after, scale, joint.noise_floor, size=SIZE, look=look)
            panels.append(cloud_svg(cloud, against, rows))
    return panels


SIGNALS = ("velocity", "acceleration", "position", "load_torque", "effort", "temperature", "time")
NOTED = 1.05
"""Ratio of the two axes' ranges above which the title of the plot after states it."""


@dataclass(frozen=True)
class Card:
    """Before and after against one quantity, as SVG; `after` is empty when both are the same."""

    title: str
    before: str
    after: str


def quantities(joint: JointResult, split: DataSplit) -> Sequence[Quantity]:
    """What the residual is drawn against: every recorded signal, and the position modulo found periods."""
    out = []
    for key in SIGNALS:
        found = quantity(split, key, joint.unit, joint.unexplained.confined_to)
        if found is not None:
            out.append(found)
        if key == "position":
            cycles = [cycles_of(joint.final, t.effect.key) for t in joint.final.terms]
            out += [modulo(split, c) for c in sorted({c for c in cycles if c is not None})]
    return out


@dataclass(frozen=True)
class CardDrawing:
    """A card that is being drawn: its panels are drawn on request."""

    title: str
    before: Callable[[], str]
    after: Callable[[], str] | None

    def card(self) -> Card:
        """The finished card."""
        return Card(self.title, self.before(), "" if self.after is None else self.after())


def residual_cards(
    joint: JointResult, split: DataSplit, prefix: str, look: CloudLook, executor: Executor | None = None
) -> Sequence[CardDrawing]:
    """One card a quantity; each of the two panels has its own scale, the noise floor's band ties them together.

    Args:
        joint: Whose residual is drawn.
        split: Of its runs.
        prefix: Of the plots' names.
        look: Of the clouds.
        executor: Draws the panels beside the caller; None draws each on request.
    """
    rows = rows_of(split)
    same = bool(np.array_equal(split.before, split.after))
    coarse, fine = _scale(split.before, joint.unit), _scale(split.after, joint.unit)
    reach = _reach(split.before), _reach(split.after)
    finer = f"after (axis {fold(*reach)} finer)" if reach[0] > NOTED * reach[1] else "after"
    cards = []
    for against in quantities(joint, split):
        name = f"{prefix}-{against.key}"
        title = "before and after: nothing was added" if same else "before"
        before = Cloud(f"{name}-before", title, split.before, coarse, joint.noise_floor, look=look)
        after = Cloud(f"{name}-after", finer, split.after, fine, joint.noise_floor, look=look)
        drawn = [_drawing(cloud, against, rows, executor) for cloud in ((before,) if same else (before, after))]
        cards.append(CardDrawing(against.title, drawn[0], None if same else drawn[1]))
    return cards


def _drawing(cloud: Cloud, against: Quantity, rows: SplitRows, executor: Executor | None) -> Callable[[], str]:
    if executor is None:
        return partial(cloud_svg, cloud, against, rows)
    return executor.submit(cloud_svg, cloud, against, rows).result


def _reach(residual: FloatArray) -> float:
    return float(np.percentile(np.abs(residual), 99.8)) if residual.size else 0.0


def _scale(residual: FloatArray, unit: str) -> Scale:
    return scale_for(_reach(residual), unit)
