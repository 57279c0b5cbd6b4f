"""From bags to a verdict in two commands, `inspect` and `close-loop`, without a column map written by hand."""

import json

import numpy as np
import pytest

from drake_tc.cli.main import run

pytest.importorskip("rosbags")
from .recorded import arrays, bag, imus, joint_states, wrenches

NAME = "elbow_joint"
GAIN, INERTIA, MOMENT = 2e-3, 0.4, 6.0
"""Position error of the servo per torque [rad/(N m)], inertia [kg m^2] and gravity moment [N m] of the link."""


def motion(number: int) -> tuple[np.ndarray, ...]:
    """Time, position, velocity, command and motor torque of a pendulum with viscous and Coulomb friction."""
    rng = np.random.default_rng(number)
    t = np.arange(0.0, 15.0, 0.002)
    slow, fast = 2.0 + 0.3 * number, 5.0 + 0.4 * number
    q = 0.6 * np.sin(slow * t) + 0.15 * np.sin(fast * t)
    v = 0.6 * slow * np.cos(slow * t) + 0.15 * fast * np.cos(fast * t)
    a = -0.6 * slow**2 * np.sin(slow * t) - 0.15 * fast**2 * np.sin(fast * t)
    motor = INERTIA * a + MOMENT * np.sin(q) + 1.2 * v + 1.5 * np.sign(v)
    read = q + 2e-5 * rng.standard_normal(t.size)
    return t, read, v, q + GAIN * motor, motor + 0.02 * rng.standard_normal(t.size)


def states_only(path, number):
    time, position, velocity, _, effort = motion(number)
    return bag(path, joint_states("/joint_states", time, {NAME: [position, velocity, effort]}))


def commands_and_states(path, number):
    time, position, velocity, command, effort = motion(number)
    states = joint_states("/joint_states", time, {NAME: [position, velocity, effort]})
    return bag(path, states, arrays("/forward_position_controller/commands", time, command[:, None]))


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


@pytest.mark.slow
@pytest.mark.parametrize("recorded", [states_only, commands_and_states, with_imu_and_wrench])
def test_two_commands_give_a_verdict(tmp_path, recorded):
    first, second, third = (str(recorded(tmp_path / f"run{number}", number)) for number in (1, 2, 3))
    rig, out = str(tmp_path / "rig.yaml"), tmp_path / "out"
    assert run(["inspect", first, "--rig", rig]) == 0
    logs = ["--log", first, "--log", second, "--holdout", third]
    assert run(["close-loop", "--rig", rig, *logs, "--out", str(out), "--no-closed-loop"]) == 0
    report = json.loads((out / "report.json").read_text("utf-8"))
    assert report["verdict"] == "no_missing_effect"
    assert report["joints"][NAME]["effects"] == []
