"""From bags to a rig file and a verdict in two commands, without a column map written by hand."""

import json

import numpy as np
import pytest

from drake_tc.cli.main import run
from drake_tc.logs.inspection import inspect_log, trial

pytest.importorskip("rosbags")
from .recorded import T, arrays, bag, imus, joint_states, nanoseconds, wrenches

NAME = "elbow_joint"
GAIN, INERTIA, MOMENT = 2e-3, 0.4, 6.0
"""Position error of the servo per torque [rad/(N m)], inertia [kg m^2] and gravity moment [N m] of the link."""


PEAK, PEAK_VELOCITY = 1.5, 0.3
"""Stribeck friction of the bag whose model lacks it: at rest above Coulomb friction [N m], and its velocity [rad/s]."""


def motion(number: int, peak: float = 0.0) -> tuple[np.ndarray, ...]:
    """Time, position, velocity, command and motor torque of a pendulum with viscous and Coulomb friction.

    `peak` [N m] is Stribeck friction at rest, of exponent 1.
    """
    rng = np.random.default_rng(number)
    t = np.arange(0.0, 15.0, 0.002)
    slow, fast = 2.0 + 0.3 * number, 5.0 + 0.4 * number
    q = 0.6 * np.sin(slow * t) + 0.15 * np.sin(fast * t)
    v = 0.6 * slow * np.cos(slow * t) + 0.15 * fast * np.cos(fast * t)
    a = -0.6 * slow**2 * np.sin(slow * t) - 0.15 * fast**2 * np.sin(fast * t)
    dry = 1.5 + peak * np.exp(-np.abs(v) / PEAK_VELOCITY)
    motor = INERTIA * a + MOMENT * np.sin(q) + 1.2 * v + dry * np.sign(v)
    read = q + 2e-5 * rng.standard_normal(t.size)
    return t, read, v, q + GAIN * motor, motor + 0.02 * rng.standard_normal(t.size)


def states_only(path, number):
    time, position, velocity, _, effort = motion(number)
    return bag(path, joint_states("/joint_states", time, {NAME: [position, velocity, effort]}))


def commands_and_states(path, number, peak=0.0):
    time, position, velocity, command, effort = motion(number, peak)
    states = joint_states("/joint_states", time, {NAME: [position, velocity, effort]})
    return bag(path, states, arrays("/forward_position_controller/commands", time, command[:, None]))


def commands_and_states_with_stribeck(path, number):
    return commands_and_states(path, number, PEAK)


def with_imu_and_wrench(path, number):
    time, position, _, command, _ = motion(number)
    slow = time[::4]
    still = np.ones((slow.size, 3))
    return bag(
        path,
        joint_states("/joint_states", time, {NAME: [position]}),
        joint_states("/joint_commands", time, {NAME: [command]}),
        imus("/forearm/imu", "forearm", slow, 0.0 * still, 9.8 * still),
        wrenches("/hand/wrench", "hand", slow, still, still),
    )


SERVO = {"drive": "position_servo"}
TORQUE = {"drive": "torque", "columns": {f"{NAME}/torque_command": f"{NAME}/effort"}}
"""The effort of the joint states is taken for the torque that the drive was commanded."""


@pytest.mark.parametrize(
    ("recorded", "rig"), [(states_only, TORQUE), (commands_and_states, SERVO), (with_imu_and_wrench, SERVO)]
)
def test_the_rig_file_of_a_bag(tmp_path, recorded, rig):
    found = inspect_log(recorded(tmp_path / "run", 1))
    assert dict(found.rig) == {"joint": NAME, "load": "unknown"} | rig
    assert trial(found) == ""
    units = {column.canonical: column.unit for column in found.columns}
    sensors = {"imu_forearm/gyro_x": "rad/s", "imu_forearm/accel_z": "m/s^2", "ft_hand/fx": "N", "ft_hand/tz": "N*m"}
    assert recorded is not with_imu_and_wrench or sensors.items() <= units.items()


def test_topics_are_listed_also_those_that_are_not_read(tmp_path, capsys):
    time, position, _, command, _ = motion(1)
    slow = time[::50]
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


def report_of_two_commands(folder, recorded):
    """report.json of bags of three runs, the last one held out."""
    first, second, third = (str(recorded(folder / f"run{number}", number)) for number in (1, 2, 3))
    rig, out = str(folder / "rig.yaml"), folder / "out"
    assert run(["inspect", first, "--rig", rig]) == 0
    logs = ["--log", first, "--log", second, "--holdout", third]
    assert run(["close-loop", "--rig", rig, *logs, "--out", str(out), "--no-closed-loop"]) == 0
    return json.loads((out / "report.json").read_text("utf-8"))


@pytest.mark.slow
@pytest.mark.parametrize("recorded", [states_only, commands_and_states, with_imu_and_wrench])
def test_two_commands_give_a_verdict(tmp_path, recorded):
    report = report_of_two_commands(tmp_path, recorded)
    assert report["verdict"] == "no_missing_effect"
    assert report["joints"][NAME]["effects"] == []


@pytest.mark.slow
def test_two_commands_name_a_missing_effect(tmp_path):
    report = report_of_two_commands(tmp_path, commands_and_states_with_stribeck)
    assert report["verdict"] == "effects_found"
    joint = report["joints"][NAME]
    (effect,) = joint["effects"]
    assert effect["id"] == "stribeck"
    found = {name: parameter["value"] for name, parameter in effect["parameters"].items()}
    assert found["stribeck"] == pytest.approx(GAIN * PEAK, rel=0.05)  # [rad], as the effort of this rig
    assert found["stribeck_velocity"] == pytest.approx(PEAK_VELOCITY, rel=0.05)
    assert joint["error"]["after"]["heldout"] < 0.25 * joint["error"]["before"]["heldout"]
