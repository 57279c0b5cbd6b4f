"""Whether computed rows are still those on record: misses without a reason, reasons without a miss, changed values."""

from collections.abc import Mapping, Sequence

import numpy as np

from drake_tc.report.figure_row import FigureRow, OnRecord


def departures(rows: Sequence[FigureRow], recorded: Mapping[str, OnRecord]) -> list[str]:
    """What a newly computed result contradicts, one sentence each; empty where it is as recorded.

    Args:
        rows: As computed with seed 0.
        recorded: Values on record, by the row's name.
    """
    computed = {row.name for row in rows}
    found = [f"{name}: on record, but not computed" for name in recorded if name not in computed]
    for row in rows:
        found += [f"{row.name}: {text}" for text in (_judgement(row), _change(row, recorded.get(row.name))) if text]
    return found


def _judgement(row: FigureRow) -> str:
    """A miss needs a reason, and a reason needs a miss."""
    if row.expected is None:
        return ""
    if not np.isfinite(row.value):
        return f"{row.value} is not a finite number"
    if row.met and row.note:
        return f"{row.value:.4g} is met; the reason of a miss has to go"
    if not row.met and not row.note:
        return f"{row.value:.4g} is a miss without a reason"
    return ""


def _change(row: FigureRow, recorded: OnRecord | None) -> str:
    """A value stays where it was, within its tolerance; a NaN is nowhere."""
    if recorded is None or abs(row.value - recorded.reached) <= recorded.reached_tolerance:
        return ""
    return f"{row.value:.4g}, but {recorded.reached:.4g} +/- {recorded.reached_tolerance:.2g} is on record"
