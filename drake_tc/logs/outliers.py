"""Repair of the angles and measurements of a log: turns undone, what no sensor read taken out; a sentence for each."""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import binary_dilation

from drake_tc.errors import LogError
from drake_tc.logs.channels import grid_step
from drake_tc.logs.clock import GAP_PERIODS
from drake_tc.logs.columns import RawLog, file_row
from drake_tc.logs.dropouts import unanswered_zeros, zero_rows
from drake_tc.logs.local_motion import held_rows, repeated_rows
from drake_tc.logs.saturated_sensor import saturated_position, saturated_torque
from drake_tc.logs.spikes import MOST_SPIKES, TURN, spikes, without_turns
from drake_tc.types import BoolArray, FloatArray

ANGLES = ("position", "motor_position", "position_command")
SLOW = ("temperature", "supply_voltage", "position_gain")
"""Channels that repeat values by nature."""
MEASURED = ("position", "motor_position", "torque", "velocity")
DROPPING = (*MEASURED, "current")
EFFORTS = ("position_command", "current", "voltage")
ANSWERS = ("torque", "velocity")
"""Measurements that follow a pulse of the effort at once."""
WITHIN = 2
"""Rows between such a pulse and the answer to it, at most."""


def without_outliers(raw: RawLog, joints: Sequence[str], sliding: Collection[str] = ()) -> RawLog:
    """The log with the turns of its angles undone, and NaN where a sensor did not read; the notes say where.

    A sensor did not read in spikes, where it dropped out to 0, at the end of its range, and where it repeated a value
    in motion. Angles of one joint that differ by whole turns are put together. Commands have no spikes: what was
    commanded was commanded. Spikes of currents and voltages are left alone, as switching makes real ones. So are those
    of torque and velocity at the same time, which answer them. Positions of the joints `sliding` have no turns.

    Raises:
        LogError: spikes in more than one row in a hundred of a channel.
    """
    columns = dict(raw.columns)
    notes: list[str] = []
    for joint in joints:
        notes += _without_dropouts(columns, joint, raw)
        for name in () if joint in sliding else (f"{joint}/{suffix}" for suffix in ANGLES):
            if name in columns and (turns := without_turns(columns[name])).rows:
                columns[name] = turns.values
                count = len(turns.rows)
                notes.append(
                    f"Column {name} jumps by whole turns of 2 pi in {count} row{'s' if count > 1 else ''} (the first:"
                    f" {file_row(raw.path, turns.rows[0])}); the turns were undone."
                )
        if joint not in sliding:
            _put_together(columns, joint)
        for name in (f"{joint}/{suffix}" for suffix in MEASURED):
            if name in columns:
                columns[name], note = _without_spikes(columns[name], name, raw, _pulses(columns, joint, name))
                notes += [note] if note else []
        notes += _without_saturation(columns, joint, raw)
        notes += _without_held(columns, joint, raw)
    return replace(raw, columns=columns, notes=(*raw.notes, *notes)) if notes else raw


def _without_dropouts(columns: dict[str, FloatArray], joint: str, raw: RawLog) -> list[str]:
    """NaN where a channel dropped out to 0; a position command only where the joint did not answer."""
    command, position = columns.get(f"{joint}/position_command"), columns.get(f"{joint}/position")
    steps = np.diff(raw.time, prepend=raw.time[:1])
    apart = steps > GAP_PERIODS * float(np.median(steps))
    notes = []
    for name in (f"{joint}/{suffix}" for suffix in DROPPING):
        if name in columns and (rows := zero_rows(columns[name], apart)).any():
            columns[name] = np.where(rows, np.nan, columns[name])
            notes.append(_taken_out(name, "drops out to 0", rows, raw))
    if command is not None and position is not None and (rows := unanswered_zeros(command, position, apart)).any():
        columns[f"{joint}/position_command"] = np.where(rows, np.nan, command)
        notes.append(_taken_out(f"{joint}/position_command", "drops out to 0, and the joint moves on,", rows, raw))
    return notes


def _without_saturation(columns: dict[str, FloatArray], joint: str, raw: RawLog) -> list[str]:
    """NaN where the position or the torque of a joint rests at the end of its sensor's range."""
    notes = []
    for name in (f"{joint}/position", f"{joint}/torque"):
        if name not in columns:
            continue
        values, step = columns[name], grid_step(columns[name])
        command = columns.get(f"{joint}/position_command")
        torque = name.endswith("/torque")
        rows = saturated_torque(values, step) if torque else saturated_position(values, command, step)
        if not rows.any():
            continue
        reached = float(np.nanmax(np.abs(columns[name][rows])))
        columns[name] = np.where(rows, np.nan, columns[name])
        what = f"stops at an extreme value (up to {reached:.4g}), as at the end of the sensor's range,"
        notes.append(_taken_out(name, what, rows, raw))
    return notes


def _taken_out(name: str, what: str, rows: BoolArray, raw: RawLog) -> str:
    """The sentence about rows (T,) in which a channel was not read."""
    count, first = int(rows.sum()), int(np.flatnonzero(rows)[0])
    where = f"{count} row{'s' if count > 1 else ''} (the first: {file_row(raw.path, first)})"
    return f"Column {name} {what} in {where}; they were taken out."


def _without_held(columns: dict[str, FloatArray], joint: str, raw: RawLog) -> list[str]:
    """NaN where the joint's position was held in motion, in the position and in what repeats there with it."""
    name = f"{joint}/position"
    if name not in columns:
        return []
    notes = _without_repeats(columns, held_rows(columns[name]), raw)
    own = [each for each in columns if each.rpartition("/")[0] == joint and each.rpartition("/")[2] not in SLOW]
    others = [columns[each] for each in own if each != name]
    return notes + _without_repeats(columns, repeated_rows(columns[name], others), raw)


def _without_repeats(columns: dict[str, FloatArray], held: BoolArray, raw: RawLog) -> list[str]:
    """NaN in the rows (T,) of the channels that repeat there."""
    if not held.any():
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


def _pulses(columns: dict[str, FloatArray], joint: str, name: str) -> BoolArray:
    """Rows (T,) near spikes of the joint's effort, if the channel is one that answers them."""
    near = np.zeros(columns[name].size, dtype=bool)
    if name.rpartition("/")[2] in ANSWERS:
        for effort in (f"{joint}/{suffix}" for suffix in EFFORTS):
            if effort in columns:
                near |= spikes(columns[effort])
    return np.asarray(binary_dilation(near, iterations=WITHIN)) if near.any() else near


def _without_spikes(values: FloatArray, name: str, raw: RawLog, pulses: BoolArray) -> tuple[FloatArray, str]:
    wild = spikes(values) & ~pulses
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
