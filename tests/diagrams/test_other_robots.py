"""The same diagram on robots of others, and on a whole robot of 30 joints, from a YAML alone."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from optional import skip_without_robots

from drake_tc.loops.torque.running import simulate_scenario
from drake_tc.loops.torque.scenario import Scenario

ROOT = Path(__file__).resolve().parents[2]
OTHERS = ROOT / "diagrams" / "other_robots.scenario.yaml"
BRISK = "{duration: 1.6, tare: 0.1, guard: {start_time: 0.2}, motion: {times: [0.3, 0.65, 1.05, 1.5]}}"
WHOLE = {
    "robot": "whole.yaml",
    "duration": 1.2,
    "tare": 0.1,
    "guard": {"start_time": 0.2},
    "gains": {"k6": 1.0, "k7": 0.01, "kp": 2.0},
    "motion": {
        "times": [0.3, 0.65, 1.05],
        "knots": {
            "r_hip_pitch": [-0.4538, -0.8, -0.6],
            "r_knee": [0.8727, 1.4, 1.0],
            "r_ankle_pitch": [-0.4189, -0.6, -0.4],
            "l_hip_pitch": [-0.4538, -0.2, -0.4],
            "waist_yaw": [0.0, 0.1, -0.1],
            "r_shoulder_pitch": [0.2618, 0.6, 0.3],
            "r_elbow": [-0.5236, -1.0, -0.7],
            "l_shoulder_pitch": [0.2618, -0.1, 0.2],
        },
    },
}


def both(path, name, text=None):
    """Recordings under the servo and in torque control."""
    scenario = Scenario.load(path, name, text)
    return simulate_scenario(scenario.changed(controller="servo")), simulate_scenario(scenario)


def better(servo, torque, times):
    """Squared tracking error of every joint that moves is `times` smaller in torque control; no flag is up."""
    assert np.isfinite(torque["command"]).all()
    assert not torque["flags"].any()
    assert torque["mode"][-1, 0] == 1.0
    late = torque.time > 0.25
    moving = np.ptp(torque["reference"][:, : torque.size], axis=0) > 0.01
    ratio = squared_error(servo, late) / squared_error(torque, late)
    assert ratio[moving].min() > times


def squared_error(recording, rows):
    """(n,) by the encoders, whose noise of 1e-5 rad does not count beside errors of a mrad."""
    error = recording["reference"][:, : recording.size] - recording["encoder"]
    return (error[rows] ** 2).sum(axis=0)


@pytest.mark.parametrize("name", ["talos_leg", pytest.param("icub_leg", marks=pytest.mark.slow)])
def test_legs_of_other_makers_swing_untuned(name):
    skip_without_robots()
    better(*both(OTHERS, name, BRISK), times=10.0)


@pytest.fixture
def whole(tmp_path):
    """The whole robot hung up by its waist."""
    folder = ROOT / "models" / "hrp2_like"
    robot = yaml.safe_load((folder / "hrp2_like.yaml").read_text())
    robot |= {name: str(folder / robot[name]) for name in ("urdf", "actuators")}
    robot |= {"fixed_base": True, "base_pose": {"xyz": [0.0, 0.0, 1.1]}}
    (tmp_path / "whole.yaml").write_text(yaml.safe_dump(robot))
    (tmp_path / "whole.scenario.yaml").write_text(yaml.safe_dump({"gymnastics": WHOLE}))
    return tmp_path / "whole.scenario.yaml"


def test_a_whole_robot_of_thirty_joints_with_four_force_torque_sensors(whole):
    servo, torque = both(whole, "gymnastics")
    assert torque.size == 30
    assert torque["contact_wrench"].shape[1] == 24
    better(servo, torque, times=10.0)
    assert np.abs((torque["reference"][:, :30] - torque["encoder"])[torque.time > 0.25]).max() < 5e-3


def test_joint_states_are_recorded_in_the_order_of_the_robots_joints(whole):
    recording = simulate_scenario(Scenario.load(whole, "gymnastics", "{duration: 0.02, tare: 0.0, controller: servo}"))
    np.testing.assert_allclose(recording.position, recording["encoder"], atol=1e-4)  # ten times the encoders' noise
