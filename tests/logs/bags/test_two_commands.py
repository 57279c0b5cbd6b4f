"""From a bag to the rig file in one command; `close-loop` reads both as they are."""

import numpy as np
import pandas as pd
import pytest

from drake_tc.logs.inspection.inspect import inspect_log, trial

from ..conftest import bench

pytest.importorskip("rosbags")
from .recorded import arrays, bag, imus, joint_states, wrenches

NAME = "elbow_joint"


def motion() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Time, position, command and motor torque of the bench."""
    table: pd.DataFrame = bench(period=0.002)
    columns = ("time", "joint/position", "joint/position_command", "joint/voltage")
    time, position, command, effort = (table[name].to_numpy() for name in columns)
    return time, position, command, 2.0 * effort


def test_joint_states_only(tmp_path):
    """The effort of the joint states is taken for the torque that the drive was commanded."""
    time, position, _, effort = motion()
    velocity = np.gradient(position, time)
    found = inspect_log(
        bag(tmp_path / "run", joint_states("/joint_states", time, {NAME: [position, velocity, effort]}))
    )
    assert dict(found.rig) == {
        "joint": NAME,
        "drive": "torque",
        "load": "unknown",
        "columns": {f"{NAME}/torque_command": f"{NAME}/effort"},
    }
    assert trial(found) == ""


def test_command_and_state(tmp_path):
    time, position, command, effort = motion()
    path = bag(
        tmp_path / "run",
        joint_states("/joint_states", time, {NAME: [position, np.gradient(position, time), effort]}),
        arrays("/forward_position_controller/commands", time, command[:, None]),
    )
    found = inspect_log(path)
    assert found.rig == {"joint": NAME, "drive": "position_servo", "load": "unknown"}
    assert trial(found) == ""


def test_with_imu_and_wrench(tmp_path):
    time, position, command, _ = motion()
    slow = time[::4]
    path = bag(
        tmp_path / "run",
        joint_states("/joint_states", time, {NAME: [position]}),
        joint_states("/joint_commands", time, {NAME: [command]}),
        imus("/forearm/imu", "forearm", slow, np.zeros((slow.size, 3)), np.full((slow.size, 3), 9.8)),
        wrenches("/hand/wrench", "hand", slow, np.ones((slow.size, 3)), np.ones((slow.size, 3))),
    )
    found = inspect_log(path)
    assert found.rig == {"joint": NAME, "drive": "position_servo", "load": "unknown"}
    assert {"imu_forearm/gyro_x", "ft_hand/tz"} <= {column.canonical for column in found.columns}
    assert trial(found) == ""
