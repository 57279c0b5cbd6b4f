"""What the logs of an arm say against its rig file and robot file, and what to change there."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from drake_tc.config.quoted import json_value
from drake_tc.diagnosis.result.rig_result import SET_UP_ERRORS, SetUpCheck, SetUpError
from drake_tc.report.numbers import percent, significant
from drake_tc.report.sentences.words import joined

COMMON = 1.1
"""Factor within which the drive gains of several joints are wrong by the same factor."""
TESTED = (
    "reversed joints, positions and efforts, exchanged columns and efforts, other zeros, drive gains and mountings, "
    "gears that couple two joints, and payloads"
)


def set_up_sentences(check: SetUpCheck | None) -> tuple[str, ...]:
    """One text a line: what is wrong and what to change; a single one where nothing that was tried explains it.

    Empty where the declared model leaves little of every effort.
    """
    if check is None:
        return ()
    joint = _worst(check)
    of_joint = f"of the effort of {joint}"
    before, after = percent(check.before[joint]), percent(check.after.get(joint, math.nan))
    if not check.errors:
        return (
            f"The declared model leaves {before} {of_joint}. Errors of the set-up were tried: {TESTED}. "
            "None of them explains it.",
        )
    lines = ["The logs contradict the rig file or the URDF.", *(_error(error) for error in check.errors)]
    if check.alternatives:
        others = "; ".join(_error(error) for error in check.alternatives)
        lines.append(f"These logs cannot distinguish the last point from another one: {others}")
    changes = "this change" if len(check.errors) == 1 else "these changes"
    lines.append(
        f"With {changes}, the declared model leaves {after} {of_joint} instead of {before}. No effects were looked "
        "for, because a wrong set-up imitates them. Correct the files and run the command again."
    )
    return tuple(lines)


def _worst(check: SetUpCheck) -> str:
    """The joint whose error is largest, or falls by the largest factor where errors were found."""
    if not check.errors:
        return max(check.before, key=lambda joint: check.before[joint])
    return max(check.after, key=lambda joint: check.before[joint] / max(check.after[joint], 1e-12))


def _error(error: SetUpError) -> str:
    names = joined(error.joints)
    if error.kind == "gravity":
        return _gravity(error)
    if error.kind == "drive_gain":
        return _gains(error.gains)
    if error.kind == "payload":
        return _payload(error)
    if error.kind == "coupled":
        motor, other = error.joints
        turns = f"{error.turns:.3g}"  # as YAML reads it
        return (
            f"The motor of {motor} also turns with {other}, by {turns} for 1: a gear couples the two joints. State "
            f"`coupled: {{{motor}: {{{other}: {turns}}}}}` in the rig file."
        )
    if error.kind == "columns_exchanged":
        return f"The columns of {names} are exchanged: exchange them under `columns:` in the rig file."
    if error.kind == "efforts_exchanged":
        return (
            f"The efforts of {names} are exchanged, and the positions are not: exchange the effort columns under "
            "`columns:` in the rig file."
        )
    if error.kind == "zero":
        return (
            f"The position of {names} reads {significant(error.zero)} rad ({math.degrees(error.zero):.1f} deg) at the "
            "zero of the URDF: subtract this angle from the column."
        )
    entries = ", ".join(f"{column}: {unit}" for column, unit in error.units.items())
    change = f"change the rig file to `units: {{{entries}}}`"
    if error.kind == "position_reversed":
        return f"The recorded position of {names} has the wrong sign: {change}."
    if error.kind == "effort_reversed":
        return f"The recorded effort of {names} has the wrong sign: {change}."
    verb = "has its axis" if len(error.joints) == 1 else "have their axes"
    return f"{names} {verb} in the direction opposite to that in the URDF: {change}."


def _gains(gains: Mapping[str, tuple[float, float]]) -> str:
    factors = [fitted / declared for fitted, declared in gains.values()]
    low, high = min(factors), max(factors)
    by = f"{significant(float(np.median(factors)))} times"
    entries = ", ".join(f"{joint}: {significant(fitted)}" for joint, (fitted, _) in gains.items())
    change = f"change `drive_gain` to {{{entries}}}"
    if high > COMMON * low:  # joints with little load tell their gain only roughly
        by, change = f"{significant(low)} to {significant(high)} times", "leave `drive_gain` out, so that it is fitted"
    return (
        f"The recorded effort of {joined(list(gains))} is {by} as large as `drive_gain` says. Its unit may be another "
        "one, such as mA or percent of a rated torque, or the torque constant is wrong: correct `units`, or "
        f"{change}."
    )


def _payload(error: SetUpError) -> str:
    body = f"{error.carrier} carries about {significant(error.mass)} kg that"
    if not error.runs:
        return (
            f"{body} the URDF does not have: add it there, or write `load: {{robot: fitted}}` in the rig file, so that "
            "the links are fitted."
        )
    names, logs = ", ".join(error.runs), "the log" if len(error.runs) == 1 else "the logs"
    if error.held_out:
        return (
            f"In the held-out log {names}, {body} it does not carry in the training logs. Hold out a log with the same "
            "load as in training."
        )
    entry = f"unknown_payload: [{names}]"
    change = f"add `{entry}` to `load`" if error.links_fitted else f"write `load: {{robot: fitted, {entry}}}`"
    return (
        f"In {logs} {names}, {body} it does not carry in the other logs: {change} in the rig file, or leave "
        f"{'it' if logs == 'the log' else 'them'} out."
    )


def _gravity(error: SetUpError) -> str:
    """By the angles of the fixed joint between `mount` and the base that `docs/whole_arm.md` describes."""
    up = -np.array(error.gravity)
    pitch, roll = math.asin(float(np.clip(-up[0], -1.0, 1.0))), math.atan2(float(up[1]), float(up[2]))
    if math.hypot(float(up[1]), float(up[2])) < 0.02:  # pitch of 90 deg: roll is a turn about gravity
        roll = 0.0
    tilt = math.degrees(math.acos(float(np.clip(up[2], -1.0, 1.0))))
    direction = ", ".join(f"{x:.2f}" for x in error.gravity)
    return (
        f"Gravity acts along ({direction}) of the robot's base, not along -z: the base is tilted by {tilt:.0f} deg. "
        "Add to the URDF a link `mount` (another name where there is one) and a fixed joint from it to the base with "
        f'<origin rpy="{roll:.3f} {pitch:.3f} 0"/>, and set `base: mount` in the robot file.'
    )


def set_up_json(check: SetUpCheck | None) -> dict[str, Any] | None:
    """The entry of report.json; null where the set-up was not looked at or the links are not fitted."""
    if check is None:
        return None
    return {
        "tested": list(SET_UP_ERRORS),
        "errors": _entries(check.errors),
        "alternatives": _entries(check.alternatives),
        "left": {
            joint: {"before": share, "after": json_value(check.after.get(joint))}
            for joint, share in check.before.items()
        },
        "statements": list(set_up_sentences(check)),
    }


def _entries(errors: Sequence[SetUpError]) -> list[dict[str, Any]]:
    """Each error with what belongs to its kind."""
    return [
        {
            "kind": error.kind,
            "joints": list(error.joints),
            "units": dict(error.units),
            "drive_gain": {j: {"fitted": f, "declared": d} for j, (f, d) in error.gains.items()},
            "zero": error.zero if error.kind == "zero" else None,
            "gravity": list(error.gravity) if error.kind == "gravity" else None,
            "turns": error.turns if error.kind == "coupled" else None,
            "mass": error.mass if error.kind == "payload" else None,
            "carrier": error.carrier or None,
            "runs": list(error.runs),
        }
        for error in errors
    ]
