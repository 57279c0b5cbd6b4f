"""`drake-tc tune` and `drake-tc stability-map`: what they print and write, that scenarios read it, and refusals."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from pydrake.systems.framework import DiagramBuilder

import drake_tc.models
from drake_tc.actuation.model_file import load_models
from drake_tc.analysis import tuning
from drake_tc.analysis.torque_loop.tuned import Confirmed
from drake_tc.cli import stability_command, tune_command
from drake_tc.errors import ParamsError
from drake_tc.loops.function_diagram import function_entry
from drake_tc.loops.plant import add_robot_plant
from drake_tc.loops.torque.wiring import add_torque_loop
from drake_tc.registry import diagram_entry
from drake_tc.robot.robot import load_robot

SHORT = ("--scenario-text", "{duration: 0.8}")
BRISK = ("--scenario-name", "brisk_swing", *SHORT, "--begin", "0.28", "--workers", "1")
KNEE = ("--joint", "r_knee", "--window", "30")
ANKLE_MAP = ("--joint", "r_ankle_roll", "--x", "window=20,80", "--y", "kp=1,2", "--workers", "1")


@pytest.fixture(autouse=True)
def a_small_space(monkeypatch):
    small = tuning.SearchSpace(kp=(1.0, 2.0), ki=(0.0, 5.0), k7=(0.8, 1.2), rounds=0)
    monkeypatch.setattr(tuning, "SearchSpace", lambda: small)


def test_the_tuned_fields_are_what_a_scenario_reads(invoke, tmp_path):
    outcome = invoke("tune", "hrp2_leg", *BRISK, *KNEE, "--no-simulate", "--out", tmp_path / "new", "--json")
    assert outcome.code == 0 and outcome.err == ""
    found = json.loads(outcome.out)
    assert (found["diagram"], found["window"], found["tried"]) == ("hrp2_leg", 30, 8)
    (knee,) = found["joints"]
    assert knee["after"]["sensitivity_peak"] <= knee["before"]["sensitivity_peak"] * 1.001
    assert knee["after"]["delay_margin"] >= knee["before"]["delay_margin"] * 0.999
    assert found["predicted_ratio"] == pytest.approx(knee["after"]["error"] / knee["before"]["error"])
    assert found["predicted_ratio"] < 0.7
    text = (tmp_path / "new" / "tuned.yaml").read_text()
    assert yaml.safe_load(text) == found["fields"]
    scenario = diagram_entry("hrp2_leg").scenario("brisk_swing", text=text)
    setting = knee["after"]["setting"]
    assert scenario.filters.window == 30
    assert scenario.gains.by_joint["r_knee"]["ki"] == pytest.approx(setting["ki"], rel=1e-5)
    assert scenario.gains.of("kp", ("r_hip_yaw", "r_knee")) == [2.0, setting["kp"]]
    assert [file.split("/")[-1] for file in found["files"]] == ["tuned.yaml", "pareto.svg", "pareto.png"]
    assert (tmp_path / "new" / "pareto.svg").read_text().lstrip().startswith("<?xml")
    assert (tmp_path / "new" / "pareto.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_simulation_confirms_it(invoke):
    outcome = invoke("tune", "hrp2_leg", *BRISK, *KNEE, "--json", "--plants", "1")
    found = json.loads(outcome.out)["simulated"]
    assert found["joints"] == ["r_hip_yaw", "r_hip_roll", "r_hip_pitch", "r_knee", "r_ankle_pitch", "r_ankle_roll"]
    assert found["after"][3] < 0.9 * found["before"][3]
    assert np.isfinite(found["plant_ratios"]).all() and len(found["plant_ratios"]) == 1


def test_for_people_a_table_on_stdout_and_progress_on_stderr(invoke):
    outcome = invoke("tune", "hrp2_leg", *BRISK, *KNEE)
    assert outcome.code == 0
    assert all(line.startswith("tune: ") for line in outcome.err.splitlines())
    (row,) = [line for line in outcome.out.splitlines() if line.startswith("r_knee")]
    assert row.count(">") == 4
    assert "simulated error, tuned over present (geometric mean of the joints): 0." in outcome.out


def test_a_promise_that_the_simulation_does_not_keep_is_told():
    """Closed form: ratios and lines of given errors [rad]."""
    setting = SimpleNamespace(error=0.67e-3)
    tuned = SimpleNamespace(joints=[SimpleNamespace(joint=j, after=setting) for j in ("hip", "knee")], ratio=0.3)
    confirmed = Confirmed(("knee", "hip"), np.array([[[2e-3, 3e-3], [1e-3, 3.1e-3]]]), np.zeros((0, 2, 2)))
    assert confirmed.ratio(tuned) == pytest.approx(np.sqrt(0.5 * 3.1 / 3.0))
    lines = tune_command._missed(tuned, confirmed)
    assert lines[0].startswith("hip: 3.10 mrad are simulated where 0.67 are predicted")
    assert lines[1] == "hip: the tuned setting is worse in the simulation than the present one"
    assert lines[2].startswith("knee: 1.00 mrad are simulated") and len(lines) == 3


def own_loop():
    """A torque loop of ones own, and its diagram."""
    robot = load_robot(drake_tc.models.__path__[0] + "/hrp2_like/hrp2_like_leg.yaml")
    builder = DiagramBuilder()
    plant = add_robot_plant(builder, robot)
    loop = add_torque_loop(builder, plant, robot, load_models(robot.actuators))
    loop.add_log(builder, "command")
    return builder.Build(), loop


def test_a_map_and_a_joint_of_a_function_and_its_signals_by_name(invoke, tmp_path):
    module = f"{__name__}:own_loop"
    outcome = invoke("stability-map", module, *ANKLE_MAP, "--json")
    assert json.loads(outcome.out)["present"] == [80.0, 2.0]
    entry = function_entry(module, own_loop)
    loop = entry.build(entry.scenario())
    assert stability_command._channel(loop, "r_knee") == 3
    with pytest.raises(ParamsError, match="no joint 'knee'; joints: r_hip_yaw, "):
        stability_command._channel(loop, "knee")
    simulated = entry.simulate(entry.scenario().changed(duration=0.01), None, False)
    assert [row[0] for row in simulated.table.rows] == [f"command[{i}]" for i in range(6)]
    (file,) = simulated.write(tmp_path, "csv", print)
    assert file.read_text().splitlines()[0] == "time," + ",".join(f"command[{i}]" for i in range(6))


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("--joint", "knee"), "no joint 'knee'; joints: r_hip_yaw"),
        (("--scenario-text", "{controller: servo}"), "expected a loop in torque control"),
        (("--scenario-text", "{predictor: {}}"), "it differs in predictor"),
        (("--margin", "1.0"), "expected a sensitivity peak above 1"),
        (("--margin", "1.001", *KNEE), "no window and gains keep the goal on r_knee"),
        (("--window", "2"), "--window"),
        (("--out", "/dev/null/x", *KNEE), "--out /dev/null/x: cannot be written: /dev/null is a file"),
    ],
)
def test_refusals(invoke, arguments, why):
    assert why in invoke("tune", "hrp2_leg", *BRISK, *arguments).refusal()


def test_a_map_of_two_parameters(invoke, tmp_path):
    file = tmp_path / "maps" / "ankle.svg"
    outcome = invoke("stability-map", "hrp2_leg", *ANKLE_MAP, "--figure", "sensitivity_peak", "--json", "--out", file)
    assert outcome.code == 0 and outcome.err == ""
    found = json.loads(outcome.out)
    assert found["x"] == {"name": "window", "values": [20.0, 80.0]}
    assert np.shape(found["values"]) == (2, 2) and found["present"] == [80.0, 2.0]
    assert found["stable_share"] == 1.0
    assert file.read_text().lstrip().startswith("<?xml")
    text = invoke("stability-map", "hrp2_leg", *ANKLE_MAP)
    assert text.out == "r_ankle_roll: 100.0% of 4 points over window and kp are stable\n"
    assert "4 of 4" in text.err


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("--joint", "knee"), "no joint 'knee'"),
        (("--scenario-text", "{controller: servo}"), "expected a loop in torque control"),
        (("--scenario-name", "predicted_swing"), "it differs in predictor, observer"),
        (("--x", "gain=1,2"), "no parameter 'gain'; possible: inertia"),
        (("--y", "kp"), "expected NAME=FIRST:LAST:STEP"),
        (("--figure", "colour"), "no figure 'colour'"),
        (("--out", "/dev/null/x.svg"), "/dev/null/x.svg: cannot be written"),
    ],
)
def test_refusals_of_the_map(invoke, arguments, why):
    assert why in invoke("stability-map", "hrp2_leg", *ANKLE_MAP, *arguments).refusal()


@pytest.mark.slow
def test_a_dask_cluster_finds_the_same(invoke):
    distributed = pytest.importorskip("distributed")
    call = ["tune", "hrp2_leg", *BRISK, *KNEE, "--no-simulate", "--json"]
    here = json.loads(invoke(*call).out)
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        there = json.loads(invoke(*call, "--scheduler", cluster.scheduler_address).out)
    assert there == here


@pytest.mark.parametrize(
    ("option", "value", "says"),
    [
        ("--window", "99999", "expected 3 to 500 samples, got 99999"),
        ("--window", "2", "expected 3 to 500 samples, got 2"),
        ("--delay-margin", "inf", "expected a delay margin of 0 to 1 s, got inf"),
        ("--delay-margin", "nan", "expected a delay margin of 0 to 1 s, got nan"),
        ("--delay-margin", "-0.01", "expected a delay margin of 0 to 1 s, got -0.01"),
        ("--margin", "nan", "expected a sensitivity peak above 1, got nan"),
    ],
)
def test_goals_out_of_range_are_refused_before_anything_is_computed(invoke, monkeypatch, option, value, says):
    monkeypatch.setattr(tuning, "tune", lambda *_, **__: pytest.fail("it computes"))
    line = invoke("tune", "hrp2_leg", option, value).refusal()
    assert says in line and option in line
