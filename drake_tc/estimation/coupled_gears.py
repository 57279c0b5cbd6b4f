"""Gears that couple joints: a motor that turns with more than its own joint.

Motor angles in joint units are q_m = R q, and by power balance the joints' torques are tau = R' tau_m. Friction, rotors
and drives act on the motors, so each joint's balance is written at its motor: position (R q)_j and load (R'^-1 tau)_j.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from drake_tc.errors import RigError
from drake_tc.logs.record import Run
from drake_tc.types import FloatArray

ACCELERATION = "smoothed_acceleration"
"""Last part of the column of a joint's acceleration from the filters of the links' columns, where these are fitted."""
TURNING = ("position", "position_command", "velocity", ACCELERATION)
"""Channels of a joint that turn with its motor."""


def motor_turns(coupled: Mapping[str, Mapping[str, float]], joints: Sequence[str]) -> FloatArray:
    """R (n, n).

    Args:
        coupled: By joint, turns of its motor for one turn of another joint, gear ratio taken out.
        joints: Names.

    Raises:
        RigError: R has no inverse: two motors turn alike.
    """
    turns = np.eye(len(joints))
    for joint, others in coupled.items():
        for other, share in others.items():
            turns[joints.index(joint), joints.index(other)] += share
    if np.linalg.cond(turns) > 1e8:
        raise RigError(f"coupled: {dict(coupled)!r}: expected motors whose angles tell all joints' positions")
    return turns


def motor_loads(turns: FloatArray, torque: FloatArray) -> FloatArray:
    """R'^-1 tau (T, n, ...) of joint torques tau (T, n, ...)."""
    return np.asarray(np.einsum("ji,tj...->ti...", np.linalg.inv(turns), torque))


def at_motors(turns: FloatArray, joints: Sequence[str], runs: Sequence[Run]) -> list[Run]:
    """The runs with the motors' positions, position commands and velocities in place of the joints'."""
    if (turns == np.eye(len(joints))).all():
        return list(runs)
    out = []
    for run in runs:
        changed: dict[str, FloatArray] = {}
        for name in TURNING:
            columns = [run.columns.get(f"{joint}/{name}") for joint in joints]
            for i, joint in enumerate(joints):
                parts = [(turns[i, j], columns[j]) for j in np.flatnonzero(turns[i])]
                if all(column is not None for _, column in parts):
                    changed[f"{joint}/{name}"] = np.sum([r * c for r, c in parts if c is not None], axis=0)
        out.append(replace(run, columns=dict(run.columns) | changed))
    return out
