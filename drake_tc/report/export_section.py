"""The model in another simulator: what is lost, and the errors of free runs side by side."""

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from drake_tc.config.joint_units import JointUnits
from drake_tc.diagnosis.result.export_trial import ExportErrors, ExportTrial
from drake_tc.report.numbers import UNKNOWN, scale_for

HOW = (
    "Each model is driven by the recorded command alone, from the first sample on, under the recorded or known load. A"
    " run that becomes unstable has no error."
)
"""What the errors of the table are."""


def headings(rows: Sequence[ExportErrors], runner: str) -> tuple[str, ...]:
    """Of the table of errors; the user's file has a column where it could be run.

    Args:
        rows: One a joint and run.
        runner: What ran the export, such as "MuJoCo".
    """
    known = ("joint", "run", "our model, Drake", f"export, {runner}")
    return (*known, f"your file, {runner}") if _has_original(rows) else known


def cells(
    rows: Sequence[ExportErrors], units: Mapping[str, JointUnits] = MappingProxyType({})
) -> list[tuple[str, ...]]:
    """Of the table of errors, those of one unit with one prefix.

    Args:
        rows: One a joint and run.
        units: By joint, where one slides.
    """
    errors = [(row.model, row.export, row.original)[: 3 if _has_original(rows) else 2] for row in rows]
    unit_of = [units.get(row.joint, JointUnits()).position for row in rows]
    sizes: dict[str, float] = {}
    for unit, each in zip(unit_of, errors, strict=True):
        sizes[unit] = max([sizes.get(unit, 0.0), *(e for e in each if e is not None and math.isfinite(e))])
    return [
        (row.joint, row.run, *(UNKNOWN if e is None else scale_for(sizes[unit], unit).quantity(e) for e in each))
        for row, unit, each in zip(rows, unit_of, errors, strict=True)
    ]


def export_section(trial: ExportTrial | None, units: Mapping[str, JointUnits]) -> dict[str, Any] | None:
    """What the template shows; None where no export was tried."""
    if trial is None:
        return None
    return {
        "target": trial.target,
        "command": f"drake-tc export {trial.model_file} --to {trial.to}",
        "losses": trial.losses,
        "headings": headings(trial.rows, trial.runner),
        "rows": cells(trial.rows, units),
        "how": HOW,
    }


def _has_original(rows: Sequence[ExportErrors]) -> bool:
    return any(row.original is not None for row in rows)
