"""From the columns of a log, what each seems to be, in which unit and why, to a rig file to start from.

What drives an arm whose log has both position commands and efforts is told by their form: an industrial arm follows its
commands by a cascade of controllers, so that a current or a torque tells what its drives do, and a stiffness between
command and position does not exist. A hobby servo has this stiffness, and records its current as a raw number of its
bus.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import pandas as pd

from drake_tc.logs.channels import grid_step
from drake_tc.logs.columns import OFF, seconds_of_dates
from drake_tc.logs.names import DUTY_CYCLE, Meaning
from drake_tc.logs.units import COUNTS, SENSOR_SUFFIXES, allowed_units
from drake_tc.types import FloatArray

MOST_TURNS = 4.0 * np.pi
"""An angle that spans more is not in rad."""
MOST_DEGREES = 3600.0
"""An angle that lies further out is not in degrees."""
MOST_AMPERES = 100.0
MOST_VOLTS = 200.0
FASTEST = 50.0
"""A velocity above is not in rad/s."""
SWITCHED = dict.fromkeys(("on", "true", "yes", "enabled"), 1.0) | dict.fromkeys(OFF, 0.0)
"""Words of a column that says when the drive is on."""
COUNTED = "whole numbers: encoder counts"
"""Why a position has a factor for its unit."""
ANGLES = ("position", "position_command", "motor_position")
"""Quantities that an encoder counts."""
NAMELESS = "joint"
"""Name of a joint whose columns name none."""
SI = {
    "velocity": "rad/s",
    "velocity_command": "rad/s",
    "current": "A",
    "current_command": "A",
    "voltage": "V",
    "supply_voltage": "V",
    "torque": "N*m",
    "torque_command": "N*m",
    "temperature": "degC",
    **{name: next(u for u, factor in units.items() if factor == 1.0) for name, units in SENSOR_SUFFIXES.items()},
}
"""The canonical units of what is no angle and no time."""


@dataclass(frozen=True)
class Column:
    """One column of a log.

    Attributes:
        name: In the file.
        canonical: What it is taken for; empty where nothing tells.
        unit: That it seems to be in.
        why: What told name and unit.
        low, high: Smallest and largest value, as in the file.
        step: Of the values, where they lie on a grid; else 0.
        missing: Share of the rows without a number.
    """

    name: str
    canonical: str
    unit: str
    why: str
    low: float
    high: float
    step: float
    missing: float


def numbers(series: pd.Series) -> FloatArray | None:
    """(T,) as numbers, dates in seconds from the first, `on` and `off` as 1 and 0; None where it holds none."""
    if pd.api.types.is_complex_dtype(series):
        return None
    if pd.api.types.is_object_dtype(series) or pd.api.types.is_string_dtype(series):
        series = series.map(lambda cell: SWITCHED.get(str(cell).strip().lower(), cell))
    if pd.api.types.is_datetime64_any_dtype(series):
        values = seconds_of_dates(series)
    else:
        values = np.asarray(pd.to_numeric(series, errors="coerce").to_numpy(dtype=np.float64, na_value=np.nan))
    return values if np.isfinite(values).any() else None


def describe(
    name: str, values: FloatArray | None, told: Meaning | None, time_unit: str, beside: FloatArray | None = None
) -> Column:
    """What a column seems to be.

    Args:
        name: In the file.
        values: (T,); None where it holds no numbers.
        told: What its name tells.
        time_unit: Unit of the time.
        beside: (S,) values of a column that has the same unit: a position beside its command, or the other way round.
            The unit is then that of both together.
    """
    if values is None:
        return Column(name, "", "", "holds no numbers", np.nan, np.nan, 0.0, 1.0)
    finite = values[np.isfinite(values)]
    low, high = float(finite.min()), float(finite.max())
    step, missing = grid_step(values), 1.0 - finite.size / values.size
    if told is None:
        return Column(name, "", "", "the name is not recognised", low, high, step, missing)
    both = finite if beside is None else np.concatenate([finite, beside[np.isfinite(beside)]])
    whole = bool((both == np.round(both)).all())
    unit, why = time_unit, "" if time_unit == "s" else f"only in {time_unit} is the rate that of a joint's log"
    if told.unit:
        unit, why = told.unit, f"{told.unit_by} states {told.unit}"
    elif told.unknown_unit and not (whole and told.unknown_unit.lower() in COUNTS and told.quantity in ANGLES):
        unit, why = "", f"{told.unit_by} states {told.unknown_unit}, which is not among the units of this quantity"
    elif told.by in DUTY_CYCLE:
        unit, why = "", "a duty cycle: its unit is the voltage [V] of one step of it, 0.12 for percent of 12 V"
    elif told.quantity != "time":
        unit, why = (
            ("rpm", "") if "rpm" in told.by else _unit(told.quantity, float(both.min()), float(both.max()), whole=whole)
        )
    if told.quantity == "enabled":
        unit, why = "", "0 while the drive is off"
    canonical = "time" if told.quantity == "time" else f"{told.joint or NAMELESS}/{told.quantity}"
    if told.quantity == "enabled" and not told.joint:
        canonical = "enabled"
    by = "canonical name" if name == canonical else told.told_by
    return Column(name, canonical, unit, f"{by}; {why}" if why else by, low, high, step, missing)


def _unit(quantity: str, low: float, high: float, *, whole: bool) -> tuple[str, str]:
    """The unit that values seem to be in ("" where nobody can tell), and why it is not SI."""
    span, largest = high - low, max(abs(low), abs(high))
    if quantity in ANGLES:
        if span <= MOST_TURNS and not (whole and largest > MOST_TURNS):
            return "rad", ""
        if whole and span > 0.0:
            counts = 2 ** max(10, int(np.ceil(np.log2(largest + 1.0))))
            return f"{2.0 * np.pi / counts:.10g}", f"{COUNTED}, perhaps {counts} a turn"
        if largest < MOST_DEGREES:
            return "deg", f"spans {span:.4g}, which in rad would be more than two turns"
        return "", f"spans {span:.4g}, which is too much for rad and deg"
    if quantity == "velocity" and largest > FASTEST:
        return "", f"reaches {largest:.4g}, which is too fast for rad/s"
    if quantity == "current" and largest > MOST_AMPERES:
        return "mA", f"reaches {largest:.4g}, which is too large for A"
    if quantity in ("voltage", "supply_voltage") and largest > MOST_VOLTS:
        return "mV", f"reaches {largest:.4g}, which is too large for V"
    return SI.get(quantity, ""), ""


EffortDrive = Literal["current", "torque"]
EFFORTS: Mapping[EffortDrive, str] = {"current": "current", "torque": "torque_command"}
"""Drive and the column of its effort, in the order in which it is looked for."""
LARGEST: Mapping[EffortDrive, float] = {"current": 200.0, "torque": 2000.0}
"""Effort [A, N m or N] that no joint of an arm reaches."""
LEAST_JOINTS = 3
"""Joints of an arm; a log of fewer joints is that of a bench, whose servo is looked for first."""
BUS_WORDS = ("present", "load")
"""In the names of columns that servos of a bus have: numbers of their registers."""


def _effort_drive(
    by_joint: Mapping[str, Mapping[str, Column]], meanings: Mapping[str, Meaning]
) -> tuple[EffortDrive, tuple[Column, ...]] | None:
    """The kind of drive and its columns, where all joints with a position command also have a plausible effort.

    That is a current or a torque of a clear unit, of a possible size, with both signs, that changes in each joint and
    is no whole number of a register. None where one joint has no such effort, and for fewer than `LEAST_JOINTS`.
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


def _comment_on(drive: EffortDrive, columns: tuple[Column, ...]) -> str:
    """One line for the rig file: the choice that was made, and how to change it."""
    name = "currents" if drive == "current" else "torques"
    text = (
        f"drive: this rig file uses the recorded {name} as the efforts of the drives, and ignores the position "
        "commands. With `drive: position_servo`, a stiffness between command and position is fitted instead."
    )
    if drive == "torque" and any(each.name.endswith("/effort") for each in columns):
        text += " If the efforts are currents in A, write `drive: current`, and /current for /torque_command."
    return text


def _is_effort(column: Column, told: Meaning, quantity: str, largest: float) -> bool:
    """Whether a column is an effort in physical units and not the number of a register."""
    factor = allowed_units(quantity).get(column.unit)
    raw = not told.unit and column.step >= 1.0 and all(v == round(v) for v in (column.low, column.high, column.step))
    named = any(word in told.by for word in BUS_WORDS)
    if factor is None or raw or named or column.low == column.high:
        return False
    return factor * max(abs(column.low), abs(column.high)) < largest


DRIVES = (
    ("position_servo", "position_command"),
    ("current", "current"),
    ("voltage", "voltage"),
    ("torque", "torque_command"),
)
"""What a drive is commanded with, in the order in which it is looked for."""
PLAIN = ("s", "rad", *(unit for name, unit in SI.items() if name not in SENSOR_SUFFIXES))
"""Units that need not be said: those of a revolute joint. Units of a prismatic one tell its type."""
OPTIONAL = ("motor_position", "temperature", "supply_voltage")
"""Channels that are used where they are."""


def suggested_rig(
    columns: Sequence[Column], meanings: Mapping[str, Meaning], notes: list[str]
) -> tuple[dict[str, Any], str]:
    """A rig document to start from, empty where no joint has what a log needs, and a comment on the choice of drives.

    That is a command and a position; where neither the drive nor the load depends on the position, a velocity will do.
    The comment is empty where there was no choice.
    """
    by_joint: dict[str, dict[str, Column]] = {}
    for column in columns:
        told = meanings.get(column.name)
        if told is not None and column.canonical and not told.joint.startswith(("imu_", "ft_")):
            by_joint.setdefault(column.canonical.rpartition("/")[0], {})[told.quantity] = column
    of_all = by_joint.pop("", {})
    time, enabled = of_all.get("time"), of_all.get("enabled")
    for joint, has in by_joint.items():
        if "current" not in has and "current_command" in has:
            has["current"] = replace(has["current_command"], canonical=f"{joint}/current")
        if "position" not in has and "motor_position" in has:
            has["position"] = replace(has.pop("motor_position"), canonical=f"{joint}/position")
            notes.append(
                f"Joint {joint} has only the position of its motor, {has['position'].name!r}, which is used as the"
                " position of the joint. If there is a gear, write the factor 1 / ratio under `units:`."
            )
    drives: dict[str, str] = {}
    chosen = _effort_drive(by_joint, meanings)
    order = DRIVES if chosen is None else sorted(DRIVES, key=lambda each: each[0] != chosen[0])
    for joint, has in by_joint.items():
        drive = next((kind for kind, command in order if command in has), None)
        if drive is None:
            notes.append(f"{_left_out(joint)} a command (position, current, voltage or torque).")
        elif "position" not in has and not (drive != "position_servo" and "velocity" in has and "torque" in has):
            beside = "; its velocity is enough only with a measured torque and not for a position servo"
            notes.append(f"{_left_out(joint)} a position{beside if 'velocity' in has else ''}.")
        else:
            drives[joint] = drive
            if "position" not in has:
                notes.append(
                    f"Joint {joint} has no position; its velocity is integrated, so that effects that depend on the "
                    "position cannot be looked for."
                )
    if not drives:
        notes.append("No joint has both a position and a command: name their columns under `columns:` in a rig file.")
        return {}, ""
    commands = dict(DRIVES)
    used = [time] if time else []
    for joint, drive in drives.items():
        motion = "position" if "position" in by_joint[joint] else "velocity"
        requested = [motion, commands[drive], "torque", *OPTIONAL]
        requested += [] if chosen is None else ["position_command"]  # for a user who changes the drive
        used += [by_joint[joint][name] for name in dict.fromkeys(requested) if name in by_joint[joint]]
    switches = [by_joint[joint]["enabled"] for joint in drives if "enabled" in by_joint[joint]]
    switches = [each for each in switches if _is_switch(each)]
    doubtful = [column.name for column in used if not column.unit]
    if doubtful:
        notes.append(f"The unit of {', '.join(map(repr, doubtful))} is not clear: state it under `units:`.")
    if counted := [column.name for column in used if COUNTED in column.why]:
        notes.append(
            f"The counts per turn of {', '.join(map(repr, counted))} are guessed from the largest value: correct the"
            " factors 2π/counts under `units:`."
        )
    notes += _other_drives(drives, by_joint)
    efforts = [by_joint[j]["torque_command"].name for j, kind in drives.items() if kind == "torque"]
    if chosen is None and any(name.endswith("/effort") for name in efforts):
        notes.append(
            "The efforts of the joint states are assumed to be commanded torques in N m, but many drivers publish"
            " currents there. If they are in A, write `drive: current`, and /current for /torque_command under"
            " `columns:`."
        )
    document: dict[str, Any] = {"joint": next(iter(drives))} if len(drives) == 1 else {"joints": list(drives)}
    document["drive"] = _same(drives)
    loads = {joint: "torque" if "torque" in by_joint[joint] else "unknown" for joint in drives}
    document["load"] = _same(loads)
    if "unknown" in loads.values():
        lacking = "The log has no" if "torque" not in loads.values() else "Some joints have no"
        notes.append(
            f"{lacking} measured joint torque. With `load: unknown`, the load of a revolute joint is fitted as a"
            " pendulum, and that of a prismatic joint as a mass with a constant force. With a URDF, `robot: FILE` and"
            " `load: {robot: fitted}` fit the links of the whole robot instead."
        )
    if enabled is not None and _is_switch(enabled):
        document["enabled"] = enabled.name
    renamed = {column.canonical: column.name for column in [*used, *switches] if column.canonical != column.name}
    # a column with a canonical name is used although the rig file does not name it
    found = [column for has in by_joint.values() for column in has.values() if column.name == column.canonical]
    stated = {column.canonical: column for column in [*used, *found] if column.canonical.rpartition("/")[0] in drives}
    if time:
        stated = {"time": time} | stated
    units = {name: _factor(each.unit) for name, each in stated.items() if each.unit not in ("", *PLAIN)}
    turned = {name.rpartition("/")[0] for name in units if name.endswith("/position")}
    # the unit of a joint's position would be that of its other angles
    units |= {name: "rad" for name, each in stated.items() if each.unit == "rad" and name.rpartition("/")[0] in turned}
    document |= ({"columns": renamed} if renamed else {}) | ({"units": units} if units else {})
    return document, "" if chosen is None else _comment_on(*chosen)


def _other_drives(drives: Mapping[str, str], by_joint: Mapping[str, Mapping[str, Column]]) -> list[str]:
    """Efforts that were recorded beside the command that is suggested, and how a rig file makes use of them."""
    told = []
    for kind, command in DRIVES[1:]:
        recorded = {joint: by_joint[joint][command] for joint in drives if command in by_joint[joint]}
        found = {joint: column for joint, column in recorded.items() if column.low < column.high}
        columns = {joint: column for joint, column in found.items() if drives[joint] != kind}
        if columns:
            renamed = [f"{each.canonical}: {each.name}" for each in columns.values() if each.canonical != each.name]
            told.append(
                f"The log also has the {command.replace('_', ' ')} of {', '.join(columns)}. To use it as the effort of "
                f"the drive, write `drive: {kind}`"
                + (f" and `columns: {{{', '.join(renamed)}}}`" if renamed else "")
                + " in the rig file."
            )
    return told


def _is_switch(column: Column) -> bool:
    """Whether a column that is called like a switch of the drive is one: 0 or 1, and on at least once."""
    return column.low in (0.0, 1.0) and column.high == 1.0


def _left_out(joint: str) -> str:
    return f"Joint {joint} is left out of the rig file, because it lacks"


def _factor(unit: str) -> str | float:
    """A unit as a rig file has it: a name, or a number."""
    try:
        return float(unit)
    except ValueError:
        return unit


def _same(by_joint: Mapping[str, str]) -> Any:
    """One value for all joints where they agree."""
    return next(iter(by_joint.values())) if len(set(by_joint.values())) == 1 else dict(by_joint)
