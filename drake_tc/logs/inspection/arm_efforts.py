"""What drives the joints of an arm whose log has both position commands and efforts.

An industrial arm follows its commands by a cascade of controllers, so that a current or a torque tells what its drives
do, and a stiffness between command and position does not exist. A hobby servo has this stiffness, and records its
current as a raw number of its bus.
"""

from collections.abc import Mapping
from typing import Literal

from drake_tc.logs.inspection.column import Column
from drake_tc.logs.inspection.names import Meaning
from drake_tc.logs.units import allowed_units

EffortDrive = Literal["current", "torque"]
EFFORTS: Mapping[EffortDrive, str] = {"current": "current", "torque": "torque_command"}
"""Drive and the column of its effort, in the order in which it is looked for."""
LARGEST: Mapping[EffortDrive, float] = {"current": 200.0, "torque": 2000.0}
"""Effort [A, N m or N] that no joint of an arm reaches."""
LEAST_JOINTS = 3
"""Joints of an arm; a log of fewer joints is that of a bench, whose servo is looked for first."""
BUS_WORDS = ("present", "load")
"""In the names of columns that servos of a bus have: numbers of their registers."""


def effort_drive(
    by_joint: Mapping[str, Mapping[str, Column]], meanings: Mapping[str, Meaning]
) -> tuple[EffortDrive, tuple[Column, ...]] | None:
    """The kind of drive and its columns, where all joints with a position command also have a plausible effort.

    That is a current or a torque of a clear unit, of a possible size, with both signs, that changes in each joint and
    is no whole number of a register. None where one joint has no such effort, and for fewer than `LEAST_JOINTS`.

    Args:
        by_joint: By joint and quantity, the columns.
        meanings: What the names of columns tell.
    """
    joints = [has for has in by_joint.values() if "position" in has and "position_command" in has]
    if len(joints) < LEAST_JOINTS:
        return None
    for drive, quantity in EFFORTS.items():
        columns = tuple(has[quantity] for has in joints if quantity in has)
        signed = len(columns) == len(joints) and any(each.low < 0.0 < each.high for each in columns)
        if signed and all(_is_effort(each, meanings[each.name], quantity, LARGEST[drive]) for each in columns):
            return drive, columns
    return None


def comment_on(drive: EffortDrive, columns: tuple[Column, ...]) -> str:
    """One line for the rig file: the choice that was made, and how to change it."""
    name = "currents" if drive == "current" else "torques"
    text = f"drive: the recorded {name} are taken for the efforts of the drives, and the position commands are not used"
    other = "position_servo fits a stiffness between command and position instead"
    if drive == "torque" and any(each.name.endswith("/effort") for each in columns):
        other += "; if the efforts are in A, write current here and /current for /torque_command under columns"
    return f"{text}; {other}."


def _is_effort(column: Column, told: Meaning, quantity: str, largest: float) -> bool:
    """Whether a column is an effort in physical units and not the number of a register."""
    factor = allowed_units(quantity).get(column.unit)
    raw = not told.unit and column.step >= 1.0 and all(v == round(v) for v in (column.low, column.high, column.step))
    named = any(word in told.by for word in BUS_WORDS)
    if factor is None or raw or named or column.low == column.high:
        return False
    return factor * max(abs(column.low), abs(column.high)) < largest
