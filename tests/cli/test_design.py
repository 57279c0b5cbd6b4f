"""`drake-tc design`."""

import json
from dataclasses import fields
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import save_models
from drake_tc.cli.demo import JOINT
from drake_tc.experiments.design.run import DesignOptions
from drake_tc.logs.rig import parse_rig

pytestmark = pytest.mark.usefixtures("fitted_once", "few_motions")


@pytest.fixture
def few_motions(monkeypatch) -> None:
    """A search tries few motions after its candidates."""
    defaults = tuple(10 if each.name == "iterations" else each.default for each in fields(DesignOptions))
    monkeypatch.setattr(DesignOptions.__init__, "__defaults__", defaults)


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


@pytest.mark.parametrize(
    ("told", "goal"),
    [
        ([["delay", "current_lag"]], []),
        pytest.param([], ["--goal", "tell:delay,current_lag"], marks=pytest.mark.slow),
    ],
)
def test_after_a_report_it_tells_its_alternatives_or_a_named_pair_apart(invoke, bench, quick, tmp_path, told, goal):
    found = {"id": "delay", "parameters": {"delay": {"value": 6.5e-3}}}
    report = {
        "logs": [str(path) for path in bench.logs],
        "joints": {JOINT: {"indistinguishable": told, "effects": [found]}},
    }
    path = tmp_path / "report.json"
    path.write_text(json.dumps(report), encoding="utf-8")
    done = invoke("design", "--rig", bench.rig, "--after", path, *goal, *quick, "--json")
    assert done.code == 0, done.err
    entry = json.loads(done.out)["joints"][JOINT]
    assert entry["goal"] == "tell:delay,current_lag"
    assert "delay.command (0.0065 s) and current_lag (0.0065 s)" in entry["sentences"][0]


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


LOADS = ["--load", "0", "--load", "5@0.4@0", "--torque", "150"]
GOAL = ["--goal", "parameters:load_dependent_friction,stribeck"]


@pytest.mark.slow
def test_with_loads_it_writes_one_motion_for_each_and_says_what_they_gain(invoke, bench, quick, tmp_path):
    done = invoke("design", *bench.arguments(), *quick, *GOAL, *LOADS, "--json")
    assert done.code == 0, done.err
    ((joint, entry),) = json.loads(done.out)["joints"].items()
    assert entry["loads"]["gain"] > 1.1 and entry["loads"]["without_loads"] == "" and entry["rig"] == {}
    runs, out = entry["runs"], tmp_path / "next"
    assert [run["file"] for run in runs] == [f"trajectory_{k + 1}.csv" for k in range(len(runs))]
    assert sum(run["seconds"] for run in runs) == pytest.approx(8.0)
    first = pd.read_csv(out / "trajectory.csv")
    for run in runs:
        table = pd.read_csv(out / run["file"])
        assert set(table[f"{joint}/load_mass"]) == {run["mass"]} and set(table[f"{joint}/load_arm"]) == {run["arm"]}
        assert yaml.safe_load((out / run["file"].replace(".csv", ".yaml")).read_text("utf-8"))["joint_names"] == [joint]
    assert first.equals(pd.read_csv(out / runs[0]["file"])[list(first)])
    page = (out / "design.html").read_text(encoding="utf-8")
    assert "best motion without loads" in page and "5 kg at 0.4 m" in page and "The rig file stays as it is" in page
    # without loads the files of an earlier call go
    assert invoke("design", *bench.arguments(), *quick).code == 0
    assert not list(out.glob("trajectory_*"))


def test_the_rig_file_of_a_pendulum_gets_the_masses_of_the_new_logs(invoke, tmp_path):
    rig, model = tmp_path / "rig.yaml", tmp_path / "model.yaml"
    rig.write_text(
        "{joint: j, drive: current, declared: {rotor_inertia: 0.1}, load: {pendulum: {mass: 2.0, length: 0.3}}}",
        encoding="utf-8",
    )
    values = (EffectValue("viscous", {"viscous": 0.5}), EffectValue("coulomb", {"coulomb": 0.4}))
    save_models(
        {
            "j": ActuatorModel(
                "j", Drive("current", 0.1), (*values, EffectValue("rotor_inertia", {"rotor_inertia": 0.1}))
            )
        },
        model,
    )
    limits = ["--position", "-0.8", "0.8", "--velocity", "2", "--acceleration", "10", "--torque", "30"]
    known = ["--rig", rig, "--model", model, *limits, "--duration", "8", "--bandwidth", "2", "--out", tmp_path / "next"]
    goal = ["--goal", "parameters:load_dependent_friction", "--load", "0", "--load", "2@0.4", "--starts", "1"]
    done = invoke("design", *known, *goal)
    assert done.code == 0, done.err
    assert "put the lines of rig_load.yaml into the rig file" in done.out
    lines = (tmp_path / "next" / "rig_load.yaml").read_text(encoding="utf-8")
    document = yaml.safe_load(rig.read_text(encoding="utf-8")) | yaml.safe_load(lines)
    load = parse_rig(document).load["j"]
    assert set(document["load"]["pendulum"]["mass"].values()) == {2.0, 4.0}
    assert [pattern for pattern, _ in load.by_run][-1] == "*"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--load", "-1@0.3"], "a mass of at least 0 kg"),
        (["--load", "1.5"], "the arm is missing"),
        (["--load", "100@0.5"], "N m, and the torque limit is"),
        (["--load", "0"], "at least one load beside 0"),
    ],
)
def test_loads_that_cannot_be_hung_are_one_line(invoke, bench, quick, arguments, words):
    assert words in invoke("design", *bench.arguments(), *quick, *arguments).refusal()


def test_loads_of_several_joints_or_of_a_whole_robot_are_refused(invoke, tmp_path):
    rig = tmp_path / "rig.yaml"
    rig.write_text("{joints: [a, b], drive: current}", encoding="utf-8")
    assert "name one with --joint" in invoke("design", "--rig", rig, "--load", "1@0.3").refusal()
    leg = Path("drake_tc/logs/examples/leg_rig.yaml")
    assert "name it with --joint" in invoke("design", "--rig", leg, "--load", "1@0.3").refusal()
