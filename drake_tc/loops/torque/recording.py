"""What a simulated loop leaves behind: arrays to study, and a log with its rig file that `close-loop` reads."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from drake_tc.actuation.model import ActuatorModel
from drake_tc.errors import LogError
from drake_tc.logs.rig import COMMAND_COLUMN
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray

IMU_AXES = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
WRENCH_AXES = ("fx", "fy", "fz", "tx", "ty", "tz")


@dataclass(frozen=True)
class Recording:
    """Signals of one simulation, sampled every tick.

    Attributes:
        robot: Whose.
        models: Joint to the simulated actuator.
        time: (T,) [s].
        signals: Name of a port to its values (T, width).
        seconds: Wall time that the simulation took [s].
        flag_names: Of the fault monitor's flags, in order; empty without one.
    """

    robot: Robot
    models: Mapping[str, ActuatorModel]
    time: FloatArray
    signals: Mapping[str, FloatArray]
    seconds: float
    flag_names: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> FloatArray:
        """(T, width) of one signal.

        Raises:
            LogError: no such signal in this recording.
        """
        if name not in self.signals:
            raise LogError(f"no signal {name!r} recorded; recorded: {', '.join(sorted(self.signals))}")
        return self.signals[name]

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

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds a second of wall time."""
        return float((self.time[-1] - self.time[0]) / self.seconds)


def log_columns(recording: Recording, torque: FloatArray | None = None) -> dict[str, FloatArray]:
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


def rig_of(recording: Recording, *, torque: bool = True) -> dict[str, Any]:
    """The rig file of such a log: joints, drives, known rotor inertias.

    Args:
        recording: The simulation.
        torque: Whether the log has torque columns; without them the load is unknown.
    """
    joints = list(recording.robot.joints)
    drives = {joint: recording.models[joint].drive.kind for joint in joints}
    inertia = {joint: {"rotor_inertia": recording.models[joint].inertia} for joint in joints}
    same = set(drives.values())
    return {
        "joints": joints,
        "drive": same.pop() if len(same) == 1 else drives,
        "load": "torque" if torque else "unknown",
        "declared": inertia,
    }


def write_log(columns: Mapping[str, FloatArray], path: Path) -> Path:
    """Write columns as CSV, Parquet or NPZ, by the ending of `path`.

    Raises:
        LogError: another ending, or a file that cannot be written.
    """
    table = pd.DataFrame(dict(columns))
    writers = {
        ".csv": lambda: table.to_csv(path, index=False, float_format="%.9g"),
        ".parquet": lambda: table.to_parquet(path),
        ".npz": lambda: np.savez_compressed(path, **dict(columns)),  # type: ignore[arg-type]
    }
    if path.suffix not in writers:
        raise LogError(f"{path}: wanted a log that ends in {', '.join(writers)}; got {path.suffix or 'no ending'}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        writers[path.suffix]()
    except OSError as error:
        raise LogError(f"{path}: cannot be written: {error.strerror or error}") from None
    return path


def write_rig(recording: Recording, path: Path, *, torque: bool = True) -> Path:
    """Write the rig file beside a log; its folder is made where it is not there.

    Args:
        recording: The simulation.
        path: Of the file.
        torque: Whether the log has torque columns.

    Raises:
        LogError: a file that cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(yaml.safe_dump(rig_of(recording, torque=torque), sort_keys=False), encoding="utf-8")
    except OSError as error:
        raise LogError(f"{path}: cannot be written: {error.strerror or error}") from None
    return path
