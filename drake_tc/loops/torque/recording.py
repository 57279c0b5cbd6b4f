"""A recorded run of the torque loop, and its log and rig file as `close-loop` reads them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from drake_tc.actuation.half_step import simulated_inertia
from drake_tc.actuation.model import ActuatorModel
from drake_tc.logs.rig import COMMAND_COLUMN
from drake_tc.loops.recording import Recording
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray

IMU_AXES = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
WRENCH_AXES = ("fx", "fy", "fz", "tx", "ty", "tz")


@dataclass(frozen=True, eq=False, kw_only=True)
class TorqueRecording(Recording):
    """A run of the torque loop.

    Attributes:
        robot: Whose.
        models: Joint to the simulated actuator.
        plant_step: Of plant and actuators [s], for the rig file.
    """

    robot: Robot
    models: Mapping[str, ActuatorModel]
    plant_step: float = 1e-3

    @property
    def size(self) -> int:
        """Number of joints n."""
        return len(self.robot.joints)

    @property
    def position(self) -> FloatArray:
        """True joint positions (T, n) [rad]."""
        return self["joint_state"][:, : self.size]

    @property
    def velocity(self) -> FloatArray:
        """True joint velocities (T, n) [rad/s]."""
        return self["joint_state"][:, self.size :]

    @property
    def tracking_error(self) -> FloatArray:
        """q_d - q (T, n) [rad], of the true positions."""
        return np.asarray(self["reference"][:, : self.size] - self.position)


def log_columns(recording: TorqueRecording, torque: FloatArray | None = None) -> dict[str, FloatArray]:
    """Canonical columns of what the robot's own sensors saw, and the commands.

    Args:
        recording: The simulation.
        torque: (T, n) link-side torques to write [N m]; None leaves them out.
    """
    columns: dict[str, FloatArray] = {"time": recording.time}
    for i, joint in enumerate(recording.robot.joints):
        kind = recording.models[joint].drive.kind
        columns[f"{joint}/position"] = recording["encoder"][:, i]
        columns[f"{joint}/{COMMAND_COLUMN[kind]}"] = recording["command"][:, i]
        if torque is not None:
            columns[f"{joint}/torque"] = torque[:, i]
    imus, wrenches = (
        [mount.name for mount in mounts] for mounts in (recording.robot.imu, recording.robot.force_torque)
    )
    for prefix, signal, names, axes in (("imu", "imu", imus, IMU_AXES), ("ft", "force_torque", wrenches, WRENCH_AXES)):
        if signal in recording.signals:
            for i, name in enumerate(names):
                for j, axis in enumerate(axes):
                    columns[f"{prefix}_{name}/{axis}"] = recording[signal][:, 6 * i + j]
    return columns


def rig_of(recording: TorqueRecording, *, torque: bool = True) -> dict[str, Any]:
    """The rig file of such a log: joints, drives, known rotor inertias as the simulated log has them.

    Args:
        recording: The simulation.
        torque: Whether the log has torque columns; without them the load is unknown.
    """
    joints = list(recording.robot.joints)
    drives = {joint: recording.models[joint].drive.kind for joint in joints}
    step = recording.plant_step
    inertia = {joint: {"rotor_inertia": simulated_inertia(recording.models[joint], step)} for joint in joints}
    same = set(drives.values())
    return {
        "joints": joints,
        "drive": same.pop() if len(same) == 1 else drives,
        "load": "torque" if torque else "unknown",
        "declared": inertia,
    }
