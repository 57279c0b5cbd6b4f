"""A load that an arm carries in some of its logs, or that its URDF lacks, is named with its mass and the logs."""

import numpy as np
import pytest
import yaml
from fitted_arm import JOINTS, PAYLOAD, RIG, URDF, record, rig_file
from numpy.testing import assert_allclose
from robot_files import write_robot

from drake_tc.diagnosis.set_up.search import check_set_up
from drake_tc.estimation.robot_loads import robot_logs
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig
from drake_tc.report.notes import set_up_json, set_up_sentences
from drake_tc.robot.rigid_regressor import link_model
from drake_tc.robot.robot import load_robot

KNOWN = {"robot": "inverse_dynamics"}


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Folder, and by number and payload [kg] the log of a run."""
    folder = tmp_path_factory.mktemp("arm")
    robot = load_robot(write_robot(folder, URDF, JOINTS))
    made = {}

    def log(number, payload=0.0):
        if (number, payload) not in made:
            name = f"run_{number}_{'loaded' if payload else 'empty'}"
            made[number, payload] = record(folder, robot, name, number, payload)
        return made[number, payload]

    return folder, log


def checked(folder, train, held, **rig_keys):
    rig = load_rig(rig_file(folder, **rig_keys))
    runs = load_runs([*train, *held], rig)
    robot = robot_logs(rig, runs)
    left = dict.fromkeys(rig.joints, 1.0)
    return check_set_up(
        robot, robot.links or link_model(robot.robot), runs[: len(train)], runs[len(train) :], rig, left
    )


def payloads(check):
    """Of a check that names nothing else."""
    assert {error.kind for error in check.errors} == {"payload"}
    for error in check.errors:
        assert_allclose(error.mass, PAYLOAD, rtol=0.05)
        assert error.carrier == "fore"
    return [(error.runs, error.held_out) for error in check.errors]


def test_one_loaded_log_among_those_of_the_training(logs):
    folder, log = logs
    train = [log(0), log(1, PAYLOAD), log(2)]
    check = checked(folder, train, [log(3)])
    assert payloads(check) == [(("run_1_loaded",), False)]
    (said,) = [line for line in set_up_sentences(check) if "run_1_loaded" in line]
    entry = yaml.safe_load(said.split("`")[1])
    assert entry == {"unknown_payload": ["run_1_loaded"]} and "to `load`" in said
    assert checked(folder, train, [log(3)], load=RIG["load"] | entry) is None  # mended by what it says
    (entry,) = set_up_json(check)["errors"]
    assert entry["runs"] == ["run_1_loaded"] and entry["carrier"] == "fore"


@pytest.mark.slow
def test_two_loaded_logs_of_four(logs):
    folder, log = logs
    check = checked(folder, [log(0), log(1, PAYLOAD), log(2, PAYLOAD), log(4)], [log(3)])
    assert sorted(payloads(check)) == [(("run_1_loaded",), False), (("run_2_loaded",), False)]


def test_a_loaded_log_that_is_held_out(logs):
    folder, log = logs
    check = checked(folder, [log(0), log(1)], [log(3, PAYLOAD)])
    assert payloads(check) == [(("run_3_loaded",), True)]
    assert "Hold out a log with the same load" in " ".join(set_up_sentences(check))


def test_a_load_in_all_training_logs_that_the_held_out_one_lacks(logs):
    folder, log = logs
    check = checked(folder, [log(0, PAYLOAD), log(1, PAYLOAD)], [log(3)])
    assert payloads(check) == [(("run_0_loaded", "run_1_loaded"), False)]


def test_a_load_in_all_logs_is_taken_up_by_fitted_links(logs):
    folder, log = logs
    assert checked(folder, [log(0, PAYLOAD), log(1, PAYLOAD)], [log(3, PAYLOAD)]) is None


@pytest.mark.parametrize("load", [KNOWN, {"robot": "fitted", "tolerance": 0.3}])
def test_friction_that_differs_in_one_log_is_no_payload(logs, load, tmp_path):
    """Three times the friction in one run: much of each effort is left, and no load explains it."""
    folder, log = logs
    columns = dict(np.load(log(1)))
    for joint in JOINTS:
        speed = np.gradient(columns[f"{joint}/position"], columns["time"])
        columns[f"{joint}/current"] = columns[f"{joint}/current"] + 0.3 * np.tanh(speed / 1e-2)
    stiff = tmp_path / "stiff.npz"
    np.savez(stiff, **columns)
    check = checked(folder, [log(0), stiff, log(2)], [log(3)], load=load)
    assert check is None or check.errors == ()
