"""What a log holds, column by column, and the rig file that it suggests."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from drake_tc.errors import DrakeTcError, LogError
from drake_tc.logs.checks.plausible import turns_of_motor
from drake_tc.logs.files.bag import Topic, is_bag, topics
from drake_tc.logs.files.bag_joined import LEADERS, OTHERS
from drake_tc.logs.files.mcap_messages import is_without_ros
from drake_tc.logs.files.readers import read_table
from drake_tc.logs.names import LINE_BELOW, Meaning, meaning, with_unit, without_unit, words
from drake_tc.logs.prepare import load_run
from drake_tc.logs.rig import parse_rig
from drake_tc.logs.suggestion import COUNTED, NAMELESS, Column, describe, suggested_rig
from drake_tc.logs.suggestion import numbers as in_numbers
from drake_tc.logs.units import TIME, allowed_units, joint_type_of_unit
from drake_tc.types import FloatArray

AGREES = 0.15
"""Difference of a velocity from the rate of the position, as a share of it, within which their units fit."""
CORRELATED = 0.8
"""Correlation of a velocity with the rate of the position from which on their ratio tells the unit."""


def _with_positions(
    columns: Sequence[Column], meanings: Mapping[str, Meaning], numbers: Mapping[str, FloatArray | None], quantity: str
) -> Iterator[tuple[Column, FloatArray, Column, FloatArray]]:
    """Each column of a quantity with its numbers (T,), and the position of its joint with those."""
    positions = {meanings[each.name].joint: each for each in columns if _is(meanings, each, "position")}
    for column in columns:
        position = positions.get(meanings[column.name].joint) if _is(meanings, column, quantity) else None
        own, q = numbers[column.name], None if position is None else numbers[position.name]
        if position is not None and own is not None and q is not None:
            yield column, own, position, q


def _is(meanings: Mapping[str, Meaning], column: Column, quantity: str) -> bool:
    return column.name in meanings and meanings[column.name].quantity == quantity


def _with_units_of_rates(
    columns: Sequence[Column],
    meanings: Mapping[str, Meaning],
    numbers: Mapping[str, FloatArray | None],
    time: FloatArray,
) -> tuple[Column, ...]:
    """The columns, where a velocity without a stated unit has the one in which it is the rate of the position.

    With the position q in its unit of factor f_q to SI, the velocity's factor to SI is f_q |dq/dt| / |v|, in RMS.
    """
    changed = {}
    for column, v, position, q in _with_positions(columns, meanings, numbers, "velocity"):
        told = meanings[column.name]
        unit = "" if told.unit or "rpm" in told.by else _unit_of_rate(q, v, time, position.unit)
        if unit and unit != column.unit:
            why = f"{told.told_by}; in {unit} it is the rate of {position.name!r}"
            changed[column.name] = replace(column, unit=unit, why=why)
    return tuple(changed.get(column.name, column) for column in columns)


def _with_gears(
    columns: Sequence[Column], meanings: Mapping[str, Meaning], numbers: Mapping[str, FloatArray | None]
) -> tuple[Column, ...]:
    """The columns, where the position of a motor that moves farther than the joint's is divided by the gear ratio."""
    changed = {}
    for column, motor, position, q in _with_positions(columns, meanings, numbers, "motor_position"):
        of_joint, of_motor = _factor(position.unit), _factor(column.unit)
        ratio = turns_of_motor(of_joint * q, of_motor * motor) if of_joint and of_motor else 1.0
        if ratio != 1.0:
            why = f"{meanings[column.name].told_by}; moves {ratio:.4g} times as far as {position.name!r}"
            changed[column.name] = replace(column, unit=f"{of_motor / ratio:.10g}", why=why)
    return tuple(changed.get(column.name, column) for column in columns)


def _factor(unit: str) -> float:
    """The factor to SI of a unit of a position; 0 where none is known."""
    try:
        return allowed_units("position").get(unit) or float(unit)
    except ValueError:
        return 0.0


def _unit_of_rate(position: FloatArray, velocity: FloatArray, time: FloatArray, unit: str) -> str:
    """The unit in which a velocity (T,) is the rate of a position (T,) in `unit`; empty where none fits."""
    factor = _factor(unit)
    if not factor:
        return ""
    kind = joint_type_of_unit(unit) or "revolute"
    good = np.isfinite(position) & np.isfinite(velocity) & np.isfinite(time)
    q, v, t = position[good], velocity[good], time[good]
    if q.size < 20 or np.any(np.diff(t) <= 0.0) or v.std() == 0.0:
        return ""
    # over stretches of some samples, the mean of the velocity is the way over the time, whatever the encoder's step
    step = max(1, min(q.size // 20, round(0.05 / float(np.median(np.diff(t))))))
    way = factor * (q[step:] - q[:-step]) / (t[step:] - t[:-step])
    summed = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))])
    mean = (summed[step:] - summed[:-step]) / (t[step:] - t[:-step])
    if mean.std() == 0.0 or way.std() == 0.0 or abs(float(np.corrcoef(way, mean)[0, 1])) < CORRELATED:
        return ""
    ratio = float(way.std() / mean.std())
    fits = [
        (abs(np.log(ratio / scale)), name)
        for name, scale in allowed_units("velocity").items()
        if joint_type_of_unit(name) == kind
    ]
    best = min(fits, default=(np.inf, ""))
    return best[1] if best[0] < AGREES else ""


ESTIMATED = ("ext", "external", "est", "estimate", "estimated", "hat", "observer")
"""Words of a signal that was computed and not measured."""
OBSERVED = re.compile(r"((?:observation[./])?(?:sensor_data|observations?|states?|obs))(_\d+)?", re.IGNORECASE)
"""What data sets for learning call what a robot is in, beside its actions."""
RATES = (5.0, 20_000.0)
"""Rates that logs of joints have [Hz]."""

SAME_UNIT = {"position": "position_command", "position_command": "position"}
"""Quantities of a joint that a log has in one unit."""
SLIDING = dict.fromkeys(("position", "position_command", "motor_position"), "m") | {
    "velocity": "m/s",
    "torque": "N",
    "torque_command": "N",
}
"""SI units of a joint that slides."""


@dataclass(frozen=True)
class Inspection:
    """What a log holds.

    Attributes:
        path: The file.
        rows: Number of rows.
        rate: Median rate [Hz]; NaN without a time.
        gaps: Steps of the clock longer than five periods.
        duration: [s].
        columns: All of them.
        rig: The document of a rig file; empty where no joint was found.
        notes: How a bag's topics were joined, and what is doubtful.
        topics: Of a bag; empty for other logs.
        comment: On the choice of the drive in the rig file, in one line; empty where there was none.
    """

    path: Path
    rows: int
    rate: float
    gaps: int
    duration: float
    columns: tuple[Column, ...]
    rig: Mapping[str, Any]
    notes: tuple[str, ...]
    topics: tuple[Topic, ...] = ()
    comment: str = ""


def inspect_log(path: Path) -> Inspection:
    """Read a log, a ROS bag included, and say what its columns seem to be.

    Raises:
        LogError: a file that cannot be read.
    """
    table = read_table(path)
    notes = [str(note) for key in ("notes", "hints") for note in table.attrs.get(key, ())]
    aside: Mapping[str, str] = table.attrs.get("aside", {})
    numbers = {str(name): in_numbers(table[name]) for name in table.columns}
    beside: Mapping[str, str] = table.attrs.get("units", {})
    by = str(table.attrs.get("units_by", LINE_BELOW))
    found = {
        name: with_unit(told, beside.get(name, ""), by)
        for name, values in numbers.items()
        if values is not None and name not in aside and (told := meaning(name)) is not None
    }
    found = _in_turns(found, notes)
    found |= _dates_as_time(table, found)
    unnamed = [name for name, values in numbers.items() if values is not None and name not in {*aside, *found}]
    found |= _observed_beside_actions(found, unnamed, notes)
    found = {name: found[name] for name in numbers if name in found}
    meanings = _distinct(_of_the_only_joint(_of_one_joint(_of_parts(_with_whole_names(found)), notes)), notes)
    time_name = next((name for name, m in meanings.items() if m.quantity == "time"), None)
    stated = "" if time_name is None else meanings[time_name].unit
    unit, period, gaps, duration = _clock(None if time_name is None else numbers[time_name], stated)
    columns = tuple(
        describe(name, values, meanings.get(name), unit, _beside(name, meanings, numbers))
        for name, values in numbers.items()
    )
    columns = tuple(replace(column, why=aside.get(column.name, column.why)) for column in columns)
    columns = _with_common_units(_in_units_of_their_joints(columns, meanings), meanings, notes)
    if time_name is not None and (time := numbers[time_name]) is not None:
        columns = _with_units_of_rates(columns, meanings, numbers, time * TIME[unit])
    columns = _with_gears(columns, meanings, numbers)
    if time_name is None:
        notes.append("No column was recognised as the time; name it under `columns: {time: ...}`.")
    rig, comment = suggested_rig(columns, meanings, notes)
    notes += [f"{comment[0].upper()}{comment[1:]}"] if comment else []
    rate = 1.0 / period if period > 0 else float("nan")
    held = topics(path) if is_bag(path) and not is_without_ros(path) else ()
    return Inspection(path, len(table), rate, gaps, duration, columns, rig, tuple(notes), held, comment)


def _dates_as_time(table: pd.DataFrame, found: Mapping[str, Meaning]) -> dict[str, Meaning]:
    """The only column of dates as the time, where no column is called like a time."""
    dates = [str(name) for name in table.columns if pd.api.types.is_datetime64_any_dtype(table[name])]
    called = any(told.quantity == "time" for told in found.values())
    return {dates[0]: Meaning("", "time", dates[0])} if len(dates) == 1 and not called else {}


def _observed_beside_actions(
    found: Mapping[str, Meaning], unnamed: Sequence[str], notes: list[str]
) -> dict[str, Meaning]:
    """`sensor_data` and the like as the position, where a log has no position and as many `actions`.

    Data sets for learning that have one vector of each mean the positions and their commands, as LeRobot's have. So do
    columns `hip` beside `hip_target`, called like the joints alone.
    """
    commands = {told.joint for told in found.values() if told.quantity == "position_command"}
    if any(told.quantity == "position" for told in found.values()):
        return {}
    positions = {}
    for name in unnamed:
        joint = "_".join(words(name))
        if joint and joint in commands:
            positions[name] = Meaning(joint, "position", name)
        elif match := OBSERVED.fullmatch(name):
            positions[name] = Meaning(f"joint{match[2]}" if match[2] else "", "position", match[1])
    if not positions or {each.joint for each in positions.values()} != commands:
        return {}
    notes.append(f"Assumed positions: {', '.join(map(repr, positions))}, one for each command.")
    return positions


def _in_units_of_their_joints(columns: Sequence[Column], meanings: Mapping[str, Meaning]) -> tuple[Column, ...]:
    """The columns, where those without a unit in their names are in m, m/s and N if the joint slides.

    The name of another column of the joint says so. A position and its command have one unit.
    """
    stated = {(told.joint, told.quantity): told.unit for told in meanings.values() if told.unit}
    sliding = {joint for (joint, _), unit in stated.items() if joint_type_of_unit(unit) == "prismatic"}
    out = []
    for column in columns:
        told = meanings.get(column.name)
        if told is not None and not told.unit and told.joint in sliding and told.quantity in SLIDING:
            unit = stated.get((told.joint, SAME_UNIT.get(told.quantity, "")), SLIDING[told.quantity])
            why = f"{told.told_by}; another column of the joint has a unit of length or force"
            column = replace(column, unit=unit, why=why)
        out.append(column)
    return tuple(out)


SHOWN = 6
"""Names in one note."""
LARGER = {"deg": "rad", "mA": "A"}
"""Units that large values tell, and those in which small values of the same kind could be."""


def _with_common_units(
    columns: Sequence[Column], meanings: Mapping[str, Meaning], notes: list[str]
) -> tuple[Column, ...]:
    """The columns, where guessed units of the joints agree: a joint that moves little has the unit of most others.

    Positions in counts have the encoder of the largest of them: each joint's range is a part of a turn.
    """
    guessed = [c for c in columns if c.name in meanings and not meanings[c.name].unit and "/" in c.canonical]
    counted = sorted((c for c in guessed if COUNTED in c.why), key=lambda column: float(column.unit))
    changed = {each.name: replace(each, unit=counted[0].unit, why=counted[0].why) for each in counted}
    for larger, smaller in LARGER.items():
        told, others = ([each for each in guessed if each.unit == unit] for unit in (larger, smaller))
        if told and len(told) > len(others):
            changed |= {each.name: replace(each, unit=larger, why=f"in {larger}, like most joints") for each in others}
        elif told and others:
            here, there = (", ".join(repr(each.name) for each in own[:SHOWN]) for own in (told, others))
            notes.append(f"Assumed units: {larger} for {here}, {smaller} for {there}. State the units under `units:`.")
    return tuple(changed.get(column.name, column) for column in columns)


def _of_one_joint(found: Mapping[str, Meaning], notes: list[str]) -> dict[str, Meaning]:
    """The meanings, where a log that has no quantity of two joints is the log of one joint.

    `knee_angle`, `motor_i` and `tau_sensor` then belong together: what their names say beside the quantity are parts
    of that joint. It is called like its position. Names with an owner before a slash are taken at their word, and
    leaders and filtered copies (`OTHERS` of the topics of bags) stay apart.
    """
    of_joints = {
        name: told
        for name, told in found.items()
        if told.quantity != "time" and not told.joint.startswith(("imu_", "ft_"))
    }
    owners: dict[str, set[str]] = {}
    for told in of_joints.values():
        owners.setdefault(told.quantity, set()).add(told.joint)
    joints = {told.joint for told in of_joints.values()}
    copies = {each for each in joints if not {*OTHERS, *LEADERS}.isdisjoint(word.lower() for word in words(each))}
    if copies and copies < joints:
        apart = [name for name, told in of_joints.items() if told.joint in copies]
        notes.append(
            "Columns whose names say that they are filtered or of another arm are not used:"
            f" {', '.join(map(repr, apart))}. To use one, name it under `columns:`."
        )
        return _of_one_joint({name: told for name, told in found.items() if name not in apart}, notes)
    if (
        len(joints) < 2
        or any("/" in without_unit(name) for name in of_joints)
        or any(len(own) > 1 for own in owners.values())
    ):
        return dict(found)
    motion = next((owners[quantity] for quantity in ("position", "velocity") if quantity in owners), {""})
    joint = next(iter(motion))
    others = sorted(joints - {joint, ""})
    if others:
        notes.append(
            "The log has every quantity only once, so all columns are assumed to belong to one joint "
            f"(called {joint or NAMELESS!r}). Not taken for names of joints: {', '.join(others)}."
        )
    return {name: replace(of_joints[name], joint=joint) if name in of_joints else told for name, told in found.items()}


def _of_the_only_joint(found: Mapping[str, Meaning]) -> dict[str, Meaning]:
    """The meanings, where columns that name no joint belong to the only joint whose motion the log has."""
    moving = {told.joint for told in found.values() if told.quantity in ("position", "velocity")}
    if len(moving) != 1 or "" in moving:
        return dict(found)
    (joint,) = moving
    has = {"time", *(told.quantity for told in found.values() if told.joint == joint)}
    return {
        name: told if told.joint or told.quantity in has else replace(told, joint=joint) for name, told in found.items()
    }


def _distinct(found: Mapping[str, Meaning], notes: list[str]) -> dict[str, Meaning]:
    """The column of each meaning whose name says least beside it. Others are told.

    What was measured goes before what was estimated, and canonical names go before others.
    """
    taken: dict[tuple[str, str], str] = {}

    def order(name: str) -> tuple[bool, bool, bool, int]:
        told = found[name]
        canonical = name == (f"{told.joint}/{told.quantity}" if told.joint else told.quantity)
        estimated = any(word.lower() in ESTIMATED for word in words(name))
        return estimated, not canonical, "/" not in name, len(words(without_unit(name))) - len(words(told.by))

    for name in sorted(found, key=order):
        other = taken.setdefault((found[name].joint, found[name].quantity), name)
        if other != name:
            notes.append(f"Columns {other!r} and {name!r} seem to be the same; {other!r} is used.")
    return {name: found[name] for name in taken.values()}


def _beside(name: str, meanings: Mapping[str, Meaning], numbers: Mapping[str, FloatArray | None]) -> FloatArray | None:
    """The command (T,) of a position, or the position of a command, if neither name states a unit; else None."""
    told = meanings.get(name)
    other = None if told is None else SAME_UNIT.get(told.quantity)
    if told is None or told.unit or other is None:
        return None
    partner = next((n for n, m in meanings.items() if (m.joint, m.quantity, m.unit) == (told.joint, other, "")), None)
    return None if partner is None else numbers[partner]


def _of_joints(found: Mapping[str, Meaning], joints: Mapping[str, str]) -> dict[str, Meaning]:
    """The meanings with other names of some joints."""
    return {name: replace(told, joint=joints.get(told.joint, told.joint)) for name, told in found.items()}


def _with_whole_names(found: Mapping[str, Meaning]) -> dict[str, Meaning]:
    """The meanings, where a joint that other columns call `NAME_joint` is the same as `NAME`."""
    joints = {told.joint for told in found.values()}
    return _of_joints(found, {each: f"{each}_joint" for each in joints if each and f"{each}_joint" in joints})


PARTS = ("motor", "encoder", "controller", "drive", "driver", "sensor")
"""Last parts of an owner that are a part of the joint."""


def _of_parts(found: Mapping[str, Meaning]) -> dict[str, Meaning]:
    """The meanings, where `axis0/encoder` and `axis0/motor` are parts of the joint `axis0`, as an ODrive calls them.

    They are where no quantity is of two of them, and none is the position of the motor.
    """
    owners: dict[str, dict[str, list[str]]] = {}
    for told in (each for each in found.values() if each.quantity != "time"):
        owner, _, part = told.joint.rpartition("/")
        if base := owner if part in PARTS else told.joint:
            owners.setdefault(base, {}).setdefault(told.joint, []).append(told.quantity)
    joined: dict[str, str] = {}
    for base, parts in owners.items():
        quantities = [quantity for each in parts.values() for quantity in each]
        distinct = len(set(quantities)) == len(quantities)
        if len(parts) > 1 and distinct and "position" not in parts.get(f"{base}/motor", ()):
            joined |= dict.fromkeys(parts, base)
    return _of_joints(found, joined)


OF_ODRIVE: Mapping[str, str] = MappingProxyType(
    dict.fromkeys(("pos_estimate", "input_pos", "pos_setpoint"), "rev")
    | dict.fromkeys(("vel_estimate", "input_vel", "vel_setpoint"), "rev/s")
)
"""Units of the endpoints of an ODrive, by the last parts of their names."""


def _in_turns(found: Mapping[str, Meaning], notes: list[str]) -> dict[str, Meaning]:
    """The meanings, where two names that only an ODrive has say that the angles are turns."""
    last = {name: re.split("[/.]", name)[-1] for name in found}
    angles = [name for name, told in found.items() if not told.unit and last[name] in OF_ODRIVE]
    if len({last[name] for name in angles} | ({"Iq_measured", "Iq_setpoint"} & set(last.values()))) < 2:
        return dict(found)
    notes.append("The names are those of an ODrive, so the positions and speeds are in turns and turns/s.")
    by = "the manual of ODrive"
    return {**found, **{name: replace(found[name], unit=OF_ODRIVE[last[name]], unit_by=by) for name in angles}}


def _clock(time: FloatArray | None, stated: str = "") -> tuple[str, float, int, float]:
    """Unit, period [s], gaps and duration [s] of a time (T,) in its own unit; a stated unit goes first."""
    if time is None:
        return "s", float("nan"), 0, float("nan")
    finite = time[np.isfinite(time)]
    steps = np.diff(finite)
    steps = steps[steps > 0.0]
    if steps.size == 0:
        return "s", float("nan"), 0, 0.0
    median = float(np.median(steps))
    possible = (name for name, scale in TIME.items() if RATES[0] <= 1.0 / (median * scale) <= RATES[1])
    unit = stated or next(possible, "s")
    scale = TIME[unit]
    return unit, median * scale, int((steps > 5.0 * median).sum()), float(finite[-1] - finite[0]) * scale


def trial(inspection: Inspection) -> str:
    """What `close-loop` would say against the log with the suggested rig file; empty where it would take it."""
    if not inspection.rig:
        return "no joint was found"
    try:
        load_run(inspection.path, parse_rig(dict(inspection.rig), "rig.yaml"))
    except LogError as error:
        return str(error)
    except DrakeTcError as error:
        return f"the suggested rig file does not fit: {error}"
    return ""
