"""The robot as `drake_tc.kernels.joint_torque` takes it."""

from typing import Any

import numpy as np

from drake_tc.estimation.plant import CUT_SUFFIX, EstimationPlant
from drake_tc.robot.robot import Robot
from drake_tc.robot.tree import tree_of
from drake_tc.types import FloatArray


def kernel_tables(
    robot: Robot, model: EstimationPlant, context: Any, unknown: Any, imu: Any, mode: int, still: FloatArray
) -> tuple[Any, ...]:
    """The constant arguments of `joint_torque.estimate`: places, constants, trunk, base, picks, sensors and frames.

    Args:
        robot: The robot.
        model: Its plant.
        context: Of the plant, at q = 0, with the links' inertias.
        unknown: Frame of the link that takes the unknown wrench.
        imu: Frame of the IMU; None for a base at rest.
        mode: Source of the angular acceleration, see there.
        still: (6,) [alpha; a] of a base at rest.
    """
    cuts, order = model.cuts, model.inward
    frames = {"unknown": unknown} | ({} if imu is None else {"imu": imu})
    first = len(frames)
    for i in order:
        frames |= {f"{i} sensor": cuts[i].sensor, f"{i} contact": cuts[i].contact}
    held = [mount.joint + CUT_SUFFIX for mount in robot.force_torque]
    places = np.arange(len(robot.joints))
    tree = tree_of(
        model.plant, model.base.body(), robot.joints, places, places, frames, {}, held, context, robot.followers
    )
    rows = dict(zip(frames, tree.frame_bodies.tolist(), strict=True))
    sensors = [(i, rows[f"{i} sensor"], rows[f"{i} contact"]) for i in order]
    return (
        tree.places,
        tree.constants,
        tree.trunk,
        np.concatenate([tree.frames[1] if imu is not None else np.zeros(12), still, tree.frames[0, 9:]]),
        np.array([rows.get("imu", -1), mode, rows["unknown"]]),
        np.array(sensors, dtype=np.int64).reshape(-1, 3),
        np.ascontiguousarray(tree.frames[first:]),
    )
