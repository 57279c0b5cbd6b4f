"""`drake-tc design`."""

import json

import numpy as np
import pandas as pd
import pytest
import yaml


@pytest.fixture
def quick(tmp_path):
    return ["--duration", "8", "--starts", "1", "--bandwidth", "1.5", "--out", str(tmp_path / "next")]


def test_it_writes_the_motion_for_a_logger_for_ros_and_for_a_person(invoke, bench, quick, tmp_path):
    done = invoke("design", *bench.arguments(), *quick, "--velocity", 1.2, "--json")
    assert done.code == 0, done.err
    (entry,) = json.loads(done.out)["joints"].values()
    assert entry["goal"] == "parameters" and entry["limits"]["velocity"] == 1.2
    table = pd.read_csv(tmp_path / "next" / "trajectory.csv")
    joint = next(iter(json.loads(done.out)["joints"]))
    assert np.abs(table[f"{joint}/velocity_command"]).max() <= 1.2
    assert np.allclose(np.diff(table["time"]), 0.005)
    message = yaml.safe_load((tmp_path / "next" / "trajectory.yaml").read_text(encoding="utf-8"))
    assert message["joint_names"] == [joint]
    assert set(message["points"][0]) == {"positions", "velocities", "accelerations", "time_from_start"}
    assert message["points"][-1]["positions"][0] == pytest.approx(table[f"{joint}/position_command"].iloc[-1])
    page = (tmp_path / "next" / "design.html").read_text(encoding="utf-8")
    assert "The next experiment" in page and "<svg" in page


def test_after_a_report_it_makes_the_experiment_that_tells_its_alternatives_apart(invoke, bench, quick, tmp_path):
    (name,) = json.loads(invoke("check", *bench.arguments(), "--json").out)["joints"]
    report = {
        "logs": [str(path) for path in bench.logs],
        "joints": {name: {"indistinguishable": [["delay", "current_lag"]], "effects": []}},
    }
    path = tmp_path / "report.json"
    path.write_text(json.dumps(report), encoding="utf-8")
    done = invoke("design", "--rig", bench.rig, "--after", path, *quick, "--json")
    assert done.code == 0, done.err
    assert json.loads(done.out)["joints"][name]["goal"] == "tell:delay,current_lag"


def test_a_pair_that_the_user_names_has_the_sizes_of_the_report(invoke, bench, quick, tmp_path):
    (name,) = json.loads(invoke("check", *bench.arguments(), "--json").out)["joints"]
    found = {"id": "delay", "parameters": {"delay": {"value": 6.5e-3}}}
    report = {
        "logs": [str(path) for path in bench.logs],
        "joints": {name: {"indistinguishable": [], "effects": [found]}},
    }
    path = tmp_path / "report.json"
    path.write_text(json.dumps(report), encoding="utf-8")
    goal = ["--goal", "tell:delay,current_lag"]
    done = invoke("design", "--rig", bench.rig, "--after", path, *goal, *quick, "--json")
    assert done.code == 0, done.err
    sentence = json.loads(done.out)["joints"][name]["sentences"][0]
    assert "delay.command (0.0065 s) and current_lag (0.0065 s)" in sentence


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--goal", "tell:torque_sensor_bias,asymmetric_friction.coulomb"], "the same function"),
        (["--goal", "louder"], "expected parameters, tell:A,B or all"),
        (["--torque", "0.5"], "contradict each other"),
        (["--position", "0.5", "0.1"], "LOW < HIGH"),
        (["--joint", "elbow"], "no joint 'elbow'"),
        (["--basis", "wavelets"], "fourier or bspline"),
        (["--criterion", "A"], "expected intervals, D or E"),
        (["--criterion", "intervals"], "--criterion intervals: expected the motion of a whole robot"),
        (["--after", "nowhere.json"], "report.json"),
        (["--distance", "nan"], "--distance: expected a distance above 0"),
    ],
)
def test_what_cannot_be_designed_is_one_line(invoke, bench, quick, arguments, words):
    assert words in invoke("design", *bench.arguments(), *quick, *arguments).refusal()


def test_without_runs_and_model_it_says_what_to_give(invoke, bench, quick):
    assert "--log RUN" in invoke("design", "--rig", bench.rig, *quick).refusal()
