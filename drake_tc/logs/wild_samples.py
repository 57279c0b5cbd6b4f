"""Repair of the angles and measurements of a log: turns undone, spikes taken out; each with one sentence."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from drake_tc.errors import LogError
from drake_tc.logs.columns import RawLog, file_row
from drake_tc.logs.local_motion import held_rows
from drake_tc.logs.spikes import MOST_SPIKES, TURN, spikes, without_turns
from drake_tc.types import FloatArray

ANGLES = ("position", "motor_position", "position_command")
SLOW = ("temperature", "supply_voltage", "position_gain")
"""Channels that repeat values by nature."""
MEASURED = ("position", "motor_position", "torque", "velocity")


def mended(raw: RawLog, joints: Sequence[str]) -> RawLog:
    """The log with the turns of its angles undone, and NaN in place of its spikes; the notes say where.

    Angles of one joint that differ by whole turns after that are put together. Commands have no spikes: what was
    commanded was commanded. Currents and voltages are left alone, as switching makes real ones.

    Raises:
        LogError: spikes in more than one row in a hundred of a channel.
    """
    columns = dict(raw.columns)
    notes: list[str] = []
    for joint in joints:
        for name in (f"{joint}/{suffix}" for suffix in ANGLES):
            if name in columns and (turns := without_turns(columns[name])).rows:
                columns[name] = turns.values
                count = len(turns.rows)
                notes.append(
                    f"Column {name} jumps by whole turns of 2 pi in {count} row{'s' if count > 1 else ''} (the first:"
                    f" {file_row(raw.path, turns.rows[0])}); the turns were undone."
                )
        _put_together(columns, joint)
        for name in (f"{joint}/{suffix}" for suffix in MEASURED):
            if name in columns:
                columns[name], note = _without_spikes(columns[name], name, raw)
                notes += [note] if note else []
        notes += _without_held(columns, joint, raw)
    return replace(raw, columns=columns, notes=(*raw.notes, *notes)) if notes else raw


def _without_held(columns: dict[str, FloatArray], joint: str, raw: RawLog) -> list[str]:
    """NaN where the joint's position was held in motion, in the position and in what repeats there with it."""
    position = columns.get(f"{joint}/position")
    if position is None or not (held := held_rows(position)).any():
        return []
    names = []
    for name, values in columns.items():
        if np.array_equal(values[held], values[np.flatnonzero(held) - 1], equal_nan=True):
            columns[name] = np.where(held, np.nan, values)
            names.append(name)
    first = int(np.flatnonzero(held)[0])
    return [
        f"Column {name} repeats an earlier value in {int(held.sum())} rows in which the joint moved on (the first:"
        f" {file_row(raw.path, first)}); they were taken out."
        for name in names
        if name.rpartition("/")[2] not in SLOW
    ]


def _put_together(columns: dict[str, FloatArray], joint: str) -> None:
    """Take whole turns between position and command, which undoing turns may leave, from the command."""
    command, position = columns.get(f"{joint}/position_command"), columns.get(f"{joint}/position")
    if command is None or position is None:
        return
    between = command - position
    if np.isfinite(between).any():
        whole = np.round(np.nanmedian(between) / TURN)
        columns[f"{joint}/position_command"] = command - TURN * whole if whole else command


def _without_spikes(values: FloatArray, name: str, raw: RawLog) -> tuple[FloatArray, str]:
    wild = spikes(values)
    count = int(wild.sum())
    if not count:
        return values, ""
    first = int(np.flatnonzero(wild)[0])
    if count > MOST_SPIKES * values.size:
        raise LogError(
            f"{raw.path}: column {name} has spikes in {count} of {values.size} rows, the first in"
            f" {file_row(raw.path, first)} ({values[first]:.4g}); expected a sensor without: mend the wiring or the"
            " logger, and record again"
        )
    largest = float(np.max(np.abs(values[wild] - np.nanmedian(values))))
    note = (
        f"Column {name} has spikes of up to {largest:.3g} in {count} row{'s' if count > 1 else ''} (the first:"
        f" {file_row(raw.path, first)}); they were taken out."
    )
    return np.where(wild, np.nan, values), note
