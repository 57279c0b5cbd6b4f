"""Channels that never change: a sensor that was off, or a column that is not what the rig file says."""

import numpy as np

from drake_tc.errors import LogError
from drake_tc.logs.columns import RawLog
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray

FOLLOWS = 0.7
"""Correlation of position and torque of a servo that is moved from its goal, at least: friction hides up to half."""


def require_live(raw: RawLog, rig: Rig) -> tuple[str, ...]:
    """Refuse a log in which no joint moves, or no moving joint's torque changes; note single joints of that kind.

    Raises:
        LogError: names the column and its value.
    """
    positions = {joint: raw.columns[f"{joint}/position"] for joint in rig.joints}
    resting = [joint for joint, values in positions.items() if _constant(values)]
    if len(resting) == len(positions):
        name = f"{resting[0]}/position"
        raise LogError(
            f"{raw.path}: column {rig.columns.get(name, name)!r} is constant"
            f" ({_value(positions[resting[0]]):.6g}) in all rows: nothing moves, or the encoder was not read;"
            " record a motion"
        )
    measured = [joint for joint in rig.joints if rig.load[joint] == "torque" and joint not in resting]
    dead = [joint for joint in measured if _constant(raw.columns[f"{joint}/torque"])]
    notes = [f"Column {joint}/position is constant: this joint did not move." for joint in resting]
    for joint in dead:
        name = f"{joint}/torque"
        if len(dead) == len(measured):
            raise LogError(
                f"{raw.path}: column {rig.columns.get(name, name)!r} is {_value(raw.columns[name]):.6g} in all rows"
                f" while {joint} moves: the torque was not measured; map the right column, or say with `load:` what"
                " the joint carries (`load: unknown` fits it)"
            )
        notes.append(f"Column {name} is constant while {joint} moves: its torque was not measured.")
    return tuple(notes)


def require_commands(raw: RawLog, rig: Rig) -> tuple[str, ...]:
    """Refuse a log in which no command changes and no servo is moved from its goal; note joints that rest.

    Raises:
        LogError: The command of every joint is constant.
    """
    names = {joint: rig.command_column(joint) for joint in rig.joints}
    resting = [joint for joint, name in names.items() if _constant(raw.columns[name])]
    if len(resting) == len(names) and not any(_moved_from_goal(raw, rig, joint) for joint in resting):
        value = _value(raw.columns[names[resting[0]]])
        shown = ", ".join(repr(rig.columns.get(name, name)) for name in names.values())
        raise LogError(
            f"{raw.path}: the command {shown} is constant ({value:.6g}) in all rows; "
            "record a motion with a changing command"
        )
    return tuple(f"Column {names[joint]} is constant: this joint was not commanded." for joint in resting)


def _moved_from_goal(raw: RawLog, rig: Rig, joint: str) -> bool:
    """Whether a servo holds a constant goal against a torque that the log tells, as that of a hand behind a sensor.

    Its effort, the distance from the goal, then follows the load. If it does not, the servo followed another goal than
    the recorded one. A load that is computed from the motion alone lacks what moves the joint.
    """
    load, position = rig.load[joint], raw.columns[f"{joint}/position"]
    if rig.drive[joint] != "position_servo" or _constant(position):
        return False
    if load != "torque":
        return isinstance(load, RobotLoad) and load.method == "estimate"
    torque = raw.columns[f"{joint}/torque"]
    both = np.isfinite(position) & np.isfinite(torque)
    if _constant(torque) or not both.any():
        return False
    return abs(float(np.corrcoef(position[both], torque[both])[0, 1])) >= FOLLOWS


def _constant(values: FloatArray) -> bool:
    finite = values[np.isfinite(values)]
    return finite.size > 0 and float(np.ptp(finite)) == 0.0


def _value(values: FloatArray) -> float:
    return float(values[np.isfinite(values)][0])
