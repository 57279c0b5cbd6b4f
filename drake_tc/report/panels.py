"""All residual panels of a joint: one card a quantity, before beside after."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.report.numbers import Scale, fold, scale_for
from drake_tc.report.residual_plots import Cloud, CloudLook, cloud_svg
from drake_tc.report.rows import Quantity, modulo, quantity, rows_of
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


def residual_cards(joint: JointResult, split: DataSplit, prefix: str, look: CloudLook) -> Sequence[Card]:
    """One card a quantity; each of the two panels has its own scale, the noise floor's band ties them together."""
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
        cards.append(
            Card(against.title, cloud_svg(before, against, rows), "" if same else cloud_svg(after, against, rows))
        )
    return cards


def _reach(residual: FloatArray) -> float:
    return float(np.percentile(np.abs(residual), 99.8)) if residual.size else 0.0


def _scale(residual: FloatArray, unit: str) -> Scale:
    return scale_for(_reach(residual), unit)
