"""Tables that join several clocks without interpolating: each row holds the columns of one sender, the others blank."""

from dataclasses import replace

import numpy as np

from drake_tc.logs.columns import RawLog
from drake_tc.logs.rig import Rig
from drake_tc.types import BoolArray, FloatArray

MOST_TOGETHER = 0.5
"""Share of the rows with a position in which the other columns of the balance have values, too: below, they are on
clocks of their own, and not channels with missing values."""
LONGEST_HOLE = 2.5
"""Usual spacings of a column up to which it is interpolated."""
HELD = ("position_command", "voltage")
"""Commands keep their value until the next one."""


def on_rows_of_positions(raw: RawLog, rig: Rig) -> RawLog:
    """The log on the rows that have all positions, if the other columns of the balance have values in other rows.

    Measurements are interpolated linearly between their own samples, commands held. What lies outside, or in holes of
    more than 2.5 usual spacings, is missing (NaN). Without this, the position would be interpolated at the rows of the
    others: its noise and its steps would look smaller, and its rate higher, than they are.

    Args:
        raw: Canonical columns (T,) on the rows of the file.
        rig: Whose joints and drives say what the balance needs.
    """
    motion = [f"{j}/{'velocity' if j in raw.speed_only else 'position'}" for j in rig.joints]
    needed = [
        name for j in rig.joints for name in rig.required_columns(j) if name in raw.columns and name not in motion
    ]
    timed = np.isfinite(raw.time)
    main = timed & np.all([np.isfinite(raw.columns[name]) for name in motion], axis=0)
    together = main & np.all([np.isfinite(raw.columns[name]) for name in [*needed, *motion]], axis=0)
    if not needed or not 0 < main.sum() < timed.sum() or together.sum() > MOST_TOGETHER * main.sum():
        return raw
    columns, moved = {}, []
    for name, values in raw.columns.items():
        own = timed & np.isfinite(values)
        if (own & main).sum() > MOST_TOGETHER * main.sum() or own.sum() < 2:
            columns[name] = values[main]
            continue
        columns[name] = _at(raw.time[main], raw.time[own], values[own], held=name.rpartition("/")[2] in HELD)
        moved.append(name)
    note = (
        f"The columns have values in different rows: the {int(main.sum())} rows with a position are the samples, and "
        f"{', '.join(moved)} {'was' if len(moved) == 1 else 'were'} interpolated there (commands held)."
    )
    return replace(_of_rows(raw, main), columns=columns, notes=(*raw.notes, note))


def _of_rows(raw: RawLog, rows: BoolArray) -> RawLog:
    return replace(
        raw, rows=raw.rows[rows], time=raw.time[rows], enabled=raw.enabled[rows], valid=raw.valid[rows], columns={}
    )


def _at(time: FloatArray, own: FloatArray, values: FloatArray, *, held: bool) -> FloatArray:
    """Values (S,) of a column at its own times (S,), at other times (T,)."""
    order = np.argsort(own, kind="stable")
    own, values = own[order], values[order]
    before = np.searchsorted(own, time, side="right") - 1
    inside = (before >= 0) & (time <= own[-1])
    if held:
        return np.where(before >= 0, values[np.maximum(before, 0)], np.nan)
    spacing = np.diff(own)
    hole = spacing[np.clip(before, 0, spacing.size - 1)] > LONGEST_HOLE * float(np.median(spacing))
    on_sample = own[np.maximum(before, 0)] == time
    return np.where(inside & (~hole | on_sample), np.interp(time, own, values), np.nan)
