"""Channels that never change: a sensor that was off, or a column that is not what the rig file says."""

import numpy as np

from drake_tc.errors import LogError
from drake_tc.logs.columns import RawLog
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray


def require_live(raw: RawLog, rig: Rig) -> tuple[str, ...]:
    """Refuse a log in which no joint moves, or a moving joint's torque is constant; note joints that rest.

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
    for joint in rig.joints:
        name = f"{joint}/torque"
        if rig.load[joint] == "torque" and joint not in resting and _constant(raw.columns[name]):
            raise LogError(
                f"{raw.path}: column {rig.columns.get(name, name)!r} is {_value(raw.columns[name]):.6g} in all rows"
                f" while {joint} moves: the torque was not measured; map the right column, or say with `load:` what"
                " the joint carries (`load: unknown` fits it)"
            )
    return tuple(f"Column {joint}/position is constant: this joint did not move." for joint in resting)


def _constant(values: FloatArray) -> bool:
    finite = values[np.isfinite(values)]
    return finite.size > 0 and float(np.ptp(finite)) == 0.0


def _value(values: FloatArray) -> float:
    return float(values[np.isfinite(values)][0])
