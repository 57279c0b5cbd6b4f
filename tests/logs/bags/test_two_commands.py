"""From a bag to the rig file in one command; `close-loop` reads both as they are."""

import numpy as np
import pandas as pd
import pytest

from drake_tc.logs.inspection.inspect import inspect_log, trial

from ..conftest import bench

pytest.importorskip("rosbags")
from .recorded import T, arrays, bag, imus, joint_states, nanoseconds, wrenches

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
    units = {column.canonical: column.unit for column in found.columns}
    assert [units[f"imu_forearm/{name}"] for name in ("gyro_x", "accel_z")] == ["rad/s", "m/s^2"]
    assert [units[f"ft_hand/{name}"] for name in ("fx", "tz")] == ["N", "N*m"]
    assert trial(found) == ""


def test_topics_are_listed_also_those_that_are_not_read(tmp_path, capsys):
    from drake_tc.cli.main import run

    time, position, command, _ = motion()
    slow = time[:: round(0.1 / (time[1] - time[0]))]
    kind = "std_msgs/msg/String"
    path = bag(
        tmp_path / "run",
        joint_states("/joint_states", time, {NAME: [position]}),
        joint_states("/joint_commands", time, {NAME: [command]}),
        [("/rosout", kind, nanoseconds(t), T[kind]("said")) for t in slow],
    )
    found = {topic.name: topic for topic in inspect_log(path).topics}
    assert list(found) == ["/joint_commands", "/joint_states", "/rosout"]
    assert found["/joint_states"].read and not found["/rosout"].read
    assert (found["/rosout"].kind, found["/rosout"].messages) == (kind, slow.size)
    assert found["/joint_states"].rate == pytest.approx(500.0, rel=0.01)
    assert found["/rosout"].rate == pytest.approx(10.0, rel=0.03)
    assert run(["inspect", str(path)]) == 0
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("/rosout")]
    assert line.split()[:3] == ["/rosout", kind, str(slow.size)] and line.rstrip().endswith("not read")
