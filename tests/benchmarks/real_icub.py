"""`bench real-icub`: base position and yaw of a walking humanoid against motion capture.

The estimator's tuning is its default, which comes from simulated motions. Said of these logs is only what an owner
knows: the authors' thresholds of contact, the soles' extents, and that the ground is level. Both logs were looked at
while the defaults were set; the figures that have to be met are those of the long one, and the leg odometry that they
are held against is the data set's own, from its README.
"""

import gzip
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import yaml

from drake_tc.errors import LogError
from drake_tc.estimation.base_log import BaseResult, evaluate_log
from drake_tc.estimation.base_rig import load_base_rig
from tests.benchmarks.figures import BenchmarkRow

DATA_SET = "icub-walking-base"
SHORT, LONG = "walk_short", "walk_front_and_back"
PUBLISHED = {"x": 0.078, "y": 0.090, "z": 0.014, "yaw": 3.9}
"""RMSE of the data set's leg odometry on the long log [m, deg]."""
SHARE = 0.6
"""Of it, what is expected."""
IMU = {"link": "root_link", "xyz": [0.0852, -0.011, -0.1123], "rpy": [-2.0944, 0.0, -1.5708]}
SOLE = [-0.06, 0.1, -0.04, 0.04]
"""Assumed: the centres of pressure that the short log shows, and about a centimetre around them [m]."""

Progress = Callable[[str, float], None]


def rig_document(joints: list[str], *, with_tilt: bool) -> dict[str, Any]:
    """The rig file of a log: thresholds as the data's authors have them; the ground is level."""
    columns = {
        "time": "estimatorJointsTime",
        "position": "estimatorJointsPos",
        "velocity": "estimatorJointsVel",
        "joint_order": "joint_names",
        "gyro": "imuOmega",
        "accel": "imuAcc",
        "truth_position": "linkBasePos",
        "truth_rpy": "linkBaseRot",
    }
    if with_tilt:
        columns["roll_pitch"] = "imuRot"
    contact = {"sole": SOLE, "make": 150.0, "break": 120.0}
    return {
        "robot": "robot.yaml",
        "columns": columns,
        "contacts": {
            "left": {"link": "l_sole", "wrench": "lfWrench", **contact},
            "right": {"link": "r_sole", "wrench": "rfWrench", **contact},
        },
        "estimator": {"ground": "level"},
    }


def robot_document(joints: list[str]) -> dict[str, Any]:
    """The robot file: the data set's URDF, its logged joints, the IMU where the data set's README has it."""
    return {
        "name": "walker",
        "urdf": "robot.urdf",
        "base": "root_link",
        "fixed_base": False,
        "joints": joints,
        "imu": {"base": IMU},
    }


def evaluate(data: Path, run: str, progress: Progress, *, ground: str = "level") -> BaseResult:
    """Both estimates over a log of the set.

    Raises:
        LogError: the set, its URDF or the log is not in `data`.
    """
    folder = data / DATA_SET if (data / DATA_SET).is_dir() else data
    packed = sorted(folder.glob("*.urdf.gz"))
    log = folder / f"{run}.npz"
    if not packed or not log.is_file():
        raise LogError(f"{folder}: expected a *.urdf.gz and {run}.npz, as the set has them")
    with np.load(log, allow_pickle=False) as archive:
        joints, with_tilt = [str(name) for name in archive["joint_names"]], "imuRot" in archive.files
    with TemporaryDirectory() as scratch:
        place = Path(scratch)
        (place / "robot.urdf").write_bytes(gzip.decompress(packed[0].read_bytes()))
        (place / "robot.yaml").write_text(yaml.safe_dump(robot_document(joints)), encoding="utf-8")
        document = rig_document(joints, with_tilt=with_tilt)
        document["estimator"]["ground"] = ground
        (place / "rig.yaml").write_text(yaml.safe_dump(document), encoding="utf-8")
        return evaluate_log(load_base_rig(place / "rig.yaml"), log, progress)


def rows(data: Path, progress: Progress = lambda text, share: None) -> list[BenchmarkRow]:
    """The table: the long log against the published odometry; the short log, ours and the baseline only told."""
    out: list[BenchmarkRow] = []
    for run, ground in ((LONG, "level"), (SHORT, "level"), (LONG, "unknown")):
        result = evaluate(data, run, progress, ground=ground)
        if result.errors is None:
            raise LogError(f"{run}: no truth in the log")
        expected = run == LONG and ground == "level"
        for which, error in zip(("estimate", "foot_centre"), result.errors, strict=True):
            if which == "foot_centre" and ground != "level":
                continue  # knows of no ground
            prefix = {"level": "", "unknown": "unknown_ground_"}[ground] if which == "estimate" else "foot_centre_"
            values = dict(zip("xyz", error.position.tolist(), strict=True))
            values |= dict(zip(("roll", "pitch", "yaw"), np.degrees(error.angle).tolist(), strict=True))
            for what, value in values.items():
                unit = "m" if what in "xyz" else "deg"
                target = SHARE * PUBLISHED[what] if expected and which == "estimate" and what in PUBLISHED else None
                note = f"published odometry {PUBLISHED[what]:g}" if target is not None else _NOTES.get(which, "")
                out.append(BenchmarkRow(f"{run}/{prefix}{what}", value, unit, target, "max", note=note))
    return out


_NOTES = {"foot_centre": "chain from the foot's centre, here"}
