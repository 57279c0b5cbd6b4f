"""`bench real-tx40`: torques of an industrial arm with a coupled wrist, on stretches that took no part in the fit."""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import yaml

from drake_tc.bench.real_arm import joint_rows, looked_for, set_folder
from drake_tc.bench.real_rows import RealRow
from drake_tc.diagnosis.arm import ArmHeldOut, declare, declared_friction, every_other_block, hold_out_arm
from drake_tc.diagnosis.problem.arm.rows import ArmRows, JointLog, arm_rows
from drake_tc.diagnosis.problem.arm.shafts import Axis, motor_axes
from drake_tc.logs.importers.files import find
from drake_tc.logs.importers.staubli import AVERAGED, JOINTS, PERIOD, convert
from drake_tc.logs.readers import read_table
from drake_tc.robot.plant import make_plant
from drake_tc.robot.rigid_regressor import LinkTree, link_tree, regressor
from drake_tc.robot.robot import load_robot
from drake_tc.types import FloatArray

DATA_SET = "staubli-tx40"
PUBLISHED = (0.060, 0.088, 0.100, 0.108, 0.127, 0.156)
"""In-sample shares of each joint's torque that the declared model leaves, in the README of the data set."""
WANTED = 0.6
WIDTH = 0.028
"""Width of the kernel that everything passes twice [s]: together as narrow as the published 40 ms filter."""
SLOWEST = 0.05
STRETCH, FOLDS = 0.5, 5
"""Every fifth half second is held out, in turn."""
MOTOR_TURNS = np.eye(6) + np.eye(6, k=-1) * (np.arange(6) == 5)[:, None]
"""R: the sixth motor turns with joint 5 as well."""

Progress = Callable[[str, float], None]


def tree_of(folder: Path) -> LinkTree:
    """The arm's links, read from the data set's own URDF through a Drake plant.

    Raises:
        LogError: no URDF in the folder.
    """
    urdf = find(folder, "*.urdf")[0].resolve()
    document = {
        "name": "arm",
        "urdf": str(urdf),
        "base": "base_link",
        "fixed_base": True,
        "joints": list(JOINTS),
        "posture": dict.fromkeys(JOINTS, 0.0),
    }
    with TemporaryDirectory() as scratch:
        path = Path(scratch) / "robot.yaml"
        path.write_text(yaml.safe_dump(document), encoding="utf-8")
        return link_tree(make_plant(load_robot(path), 0.0))


def shafts() -> tuple[Axis, ...]:
    """The six motors, and the output of joint 6, which turns without motor 5."""
    output = (0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    return (*motor_axes(tuple(f"motor_{i}" for i in range(1, 7)), MOTOR_TURNS), Axis("joint_6", output, output))


def rows_of(data: Path) -> tuple[ArmRows, FloatArray]:
    """The trajectory, filtered.

    Raises:
        LogError: the set is not in `data`.
    """
    folder = set_folder(data, DATA_SET)
    tree = tree_of(folder)
    with TemporaryDirectory() as scratch:
        convert(folder, Path(scratch))
        table = read_table(Path(scratch) / "trajectory.parquet")
    position, torque = (
        np.column_stack([table[f"{joint}/{name}"].to_numpy(float) for joint in JOINTS])
        for name in ("position", "torque_command")
    )
    log = JointLog("trajectory", PERIOD * AVERAGED, position, torque @ MOTOR_TURNS)
    return arm_rows([log], shafts(), lambda q, v, a: regressor(tree, q, v, a), (WIDTH, WIDTH), SLOWEST)


def held_out(data: Path, progress: Progress = lambda text, share: None, *, search: bool = True) -> list[ArmHeldOut]:
    """Each fifth of the trajectory predicted from the rest."""
    rows, raw = rows_of(data)
    rows, raw, declared = declare(rows, raw, declared_friction(len(rows.axes), len(JOINTS), inertia=True))
    out = []
    for fold in range(FOLDS):
        progress("splits", fold / FOLDS)
        test = every_other_block(rows, STRETCH, FOLDS, fold)
        out.append(hold_out_arm(rows, raw, declared, test, looked_for() if search else ()))
    progress("splits", 1.0)
    return out


def rows(data: Path, progress: Progress = lambda text, share: None) -> list[RealRow]:
    """The table: share of each joint's torque that is left, beside the declared model's."""
    return joint_rows(held_out(data, progress), JOINTS, WANTED, PUBLISHED)
