"""Writes what the generators beside this folder record into rig files and logs."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from drake_tc.logs.record import Run

from .. import pendulum_rig
from ..log_files import Change
from ..pendulum_rig import Swing
from ..rigs import Extra, Joint, record
from .case import Record, Recorded

SHIFTS = (0.0, 0.9, 1.8, 2.7, 3.6, 4.5)
"""By which the motions of the runs of a joint differ."""


def written(folder: Path, rig: Mapping[str, Any], runs: Sequence[Run | pd.DataFrame], train: int = 2) -> Recorded:
    """A rig file and the logs; the first `train` runs are those to fit."""
    path = folder / "rig.yaml"
    path.write_text(yaml.safe_dump(json.loads(json.dumps(rig, default=float))), encoding="utf-8")
    logs = []
    for number, run in enumerate(runs):
        columns = dict(run) if isinstance(run, pd.DataFrame) else {"time": run.time, **run.columns}
        name = f"run_{number}" if isinstance(run, pd.DataFrame) else run.name
        logs.append(folder / f"{name}.npz")
        np.savez(logs[-1], **{key: np.asarray(values) for key, values in columns.items()})
    return Recorded(path, logs[:train], logs[train:])


def recorder(
    rig: Mapping[str, Any], run: Callable[[int, int], Run | pd.DataFrame], train: int = 2, held: int = 1
) -> Record:
    """Of runs by (number, seed)."""

    def write(folder: Path, seed: int) -> Recorded:
        return written(folder, rig, [run(number, seed) for number in range(train + held)], train)

    return write


def logs_of(
    joint: Joint | Sequence[Joint],
    change: Change | None = None,
    rig: Mapping[str, Any] | None = None,
    train: int = 2,
    held: int = 1,
) -> Record:
    """Of a joint by inverse dynamics whose rotor inertia is declared; `rig` has more keys, or others (None: without).

    Args:
        joint: The joint of all runs, or of each run.
        change: What is done to each table before it is written.
    """
    joints = [joint] * (train + held) if isinstance(joint, Joint) else list(joint)

    def run(number: int, seed: int) -> Run | pd.DataFrame:
        made = record(joints[number], f"run_{number}", SHIFTS[number], 1000 * seed + number)
        return made if change is None else change(pd.DataFrame({"time": made.time, **made.columns}))

    return recorder(rig_of(joints[0], **(rig or {})), run, train, held)


def rig_of(joint: Joint, **keys: Any) -> dict[str, Any]:
    """The rig file of a joint that knows the rotor inertia, with more keys, or others (None: without)."""
    declared = {"rotor_inertia": joint.inertia} if joint.inertia else None
    document = {"joint": "joint", "drive": joint.drive, "declared": declared, **keys}
    return {key: value for key, value in document.items() if value is not None}


def swings_of(
    swing: Swing | Sequence[Swing], load: Any = "unknown", train: int = 2, held: int = 1, **keys: Any
) -> Record:
    """Of a pendulum without a torque sensor; the drive gain is declared unless `keys` say otherwise (None: without)."""
    swings = [swing] * (train + held) if isinstance(swing, Swing) else list(swing)

    def run(number: int, seed: int) -> Run:
        return pendulum_rig.record(swings[number], f"run_{number}", 1000 * seed + number, 0.37 * number)

    document = {
        "joint": pendulum_rig.JOINT,
        "drive": swings[0].drive,
        "load": load,
        "drive_gain": swings[0].gain,
    } | keys
    return recorder({key: value for key, value in document.items() if value is not None}, run, train, held)


def changed(run: Run, **columns: Any) -> Run:
    """The run with other columns of its joint."""
    return replace(run, columns={**run.columns, **{f"joint/{name}": values for name, values in columns.items()}})


def scaled(**factors: float) -> Change:
    """Tables in which these columns of the joint have another scale or sign."""
    return lambda table: table.assign(**{f"joint/{name}": by * table[f"joint/{name}"] for name, by in factors.items()})


def with_sensor(joint: Joint, sensor: Extra | None) -> Joint:
    """The joint with this error of its torque sensor [N m]."""
    return replace(joint, sensor=sensor)
