"""All residual panels of a joint: one card a quantity, before beside after."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np

from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.report.numbers import Scale, fold, scale_for
from drake_tc.report.residual_plots import Cloud, CloudLook, cloud_svg
from drake_tc.report.rows import Quantity, Rows, modulo, quantity, rows_of
from drake_tc.report.signature_plots import cycles_of
from drake_tc.types import FloatArray

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


def _drawing(cloud: Cloud, against: Quantity, rows: Rows, executor: Executor | None) -> Callable[[], str]:
    if executor is None:
        return partial(cloud_svg, cloud, against, rows)
    return executor.submit(cloud_svg, cloud, against, rows).result


def _reach(residual: FloatArray) -> float:
    return float(np.percentile(np.abs(residual), 99.8)) if residual.size else 0.0


def _scale(residual: FloatArray, unit: str) -> Scale:
    return scale_for(_reach(residual), unit)
