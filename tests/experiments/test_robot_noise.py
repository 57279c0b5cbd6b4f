"""The noise of a robot's torques from its logs, and what a design makes of it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from optional import skip_without_robots

from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.effects.library import effect
from drake_tc.errors import ParamsError
from drake_tc.experiments.check.effects import joint_effects
from drake_tc.experiments.check.run import with_loads
from drake_tc.experiments.design import request as requests
from drake_tc.experiments.design.request import DesignRequest, designed_robot, whole_robot
from drake_tc.experiments.design.robot import RobotOptions, robot_noise
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig
from drake_tc.loops.recording import write_log
from drake_tc.robot.robot import load_robot
from tests.benchmarks.blind_arm.arms import REFERENCE, arm_named
from tests.benchmarks.blind_arm.cases import rig_file, simulated_arm, sound_case, write_files
from tests.benchmarks.blind_arm.recorder import EVERY, STEP, record_run

SECONDS = 12.0


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """(folder of a simulated arm with one log, the arm)."""
    skip_without_robots()
    folder = tmp_path_factory.mktemp("arm")
    case = sound_case(arm_named(REFERENCE), 1)
    arm = simulated_arm(case, write_files(case, folder, rig_file(case)), np.random.default_rng(case.seed))
    write_log(record_run(arm, 0, np.random.default_rng(7), SECONDS), folder / "first.npz")
    return folder, arm


def request(folder, **changes):
    return replace(DesignRequest(folder / "rig.yaml", (), None, "parameters", None, (), {}), **changes)


@pytest.fixture(scope="module")
def read(recorded):
    """(rig, robot, runs, their noise)."""
    rig = load_rig(recorded[0] / "rig.yaml")
    robot, runs = load_robot(rig.robot), load_runs([recorded[0] / "first.npz"], rig)
    return rig, robot, runs, robot_noise(rig, robot, runs)


def test_the_information_of_a_second_is_that_of_the_white_noise_of_the_currents(recorded, read):
    """1/(dt s^2) for white noise of s [N m] every dt, although the links differ from their file by up to 50 %."""
    (_, arm), (_, robot, _, found) = recorded, read
    white = np.array([arm.noise.effort[j] / arm.case.joints[j].gain for j in robot.joints])
    expected = 1.0 / (EVERY * STEP * white**2)
    ratio = np.sqrt(found.per_second / found.torque**2 / expected)
    # of intervals: the noise of the acceleration adds to that of the current, and the rate has its own scatter
    assert ((ratio > 1.0 / 1.5) & (ratio < 1.5)).all(), ratio


def test_where_links_are_not_fitted_their_errors_count_as_noise(recorded, read):
    """Of the joints that bear most of the weight; no later fit can remove them then."""
    (_, arm), (rig, robot, runs, fitted) = recorded, read
    known = robot_noise(replace(rig, load=dict.fromkeys(rig.joints, RobotLoad("inverse_dynamics"))), robot, runs)
    assert (known.per_second > 0.0).all() and np.isfinite(known.torque).all()
    loaded = [robot.joints.index(name) for name in arm.case.arm.loaded]
    assert (known.torque[loaded] > fitted.torque[loaded]).all(), known.torque / fitted.torque


def test_a_design_states_intervals_of_the_noise_of_the_logs(recorded, monkeypatch):
    folder, _ = recorded
    asked = []

    def stop(robot, limits, options, progress):
        asked.append(options.noise)

    monkeypatch.setattr(requests, "design_robot", stop)
    designed_robot(request(folder), RobotOptions())
    designed_robot(request(folder, logs=(folder / "first.npz",)), RobotOptions())
    report = folder / "report.json"
    report.write_text(json.dumps({"logs": ["first.npz"], "joints": {}}), encoding="utf-8")
    designed_robot(request(folder, after=report), RobotOptions())
    assert asked[0] is None
    assert_allclose(asked[1].torque, asked[2].torque, rtol=1e-12)
    assert asked[1].torque.shape == (6,)


def test_a_report_with_the_goal_parameters_asks_for_a_motion_of_all_joints(recorded):
    folder, _ = recorded
    after = folder / "report.json"
    assert whole_robot(request(folder, after=after))
    assert not whole_robot(request(folder, after=after, goal=None))
    assert whole_robot(request(folder, goal=None))
    assert not whole_robot(request(folder, joints=("elbow_joint",)))


def test_the_noise_of_all_joints_of_the_robot_is_needed(read):
    rig, robot, *_ = read
    with pytest.raises(
        ParamsError, match=f"{robot.joints[-1]} missing; the noise of all joints of the robot is needed"
    ):
        robot_noise(replace(rig, joints=rig.joints[:-1]), robot, [])


def test_the_check_of_a_robot_whose_links_are_fitted_names_what_close_loop_does_not_look_for(read):
    """The same obstacles as in the diagnosis, which fits the links from the recorded efforts at the declared gains."""
    keys = ("saturation", "servo_gain", "payload")
    runs, rig = with_loads(read[0], read[2])
    prepared = prepare_joint(runs, [], rig, rig.joints[1])
    found = joint_effects(prepared, tuple(map(effect, (*keys, "stribeck"))), links_fitted=True)
    told = {each.key: each for each in found.effects}
    for key in keys:
        assert told[key].status == "not_seen", key
        assert "fitted" in told[key].reason, key
