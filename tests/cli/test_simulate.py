"""`drake-tc simulate`: what it prints and writes, that others read it, and what it refuses in one line."""

import json

import numpy as np
import pandas as pd
import pytest
import yaml
from numpy.testing import assert_allclose

from drake_tc.logs.files.readers import read_table
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig

JOINTS = ["r_hip_yaw", "r_hip_roll", "r_hip_pitch", "r_knee", "r_ankle_pitch", "r_ankle_roll"]
SHORT = ("--duration", 0.3)
SERVO = "{controller: servo, guard: {start_time: 0.05}}"


@pytest.mark.parametrize("diagram", ["hrp2_leg", "hrp2_leg_contact"])
def test_json_alone_stands_on_stdout(invoke, diagram):
    outcome = invoke("simulate", diagram, *SHORT, "--seed", 3, "--json")
    assert outcome.code == 0 and outcome.err == ""
    found = json.loads(outcome.out)
    assert (found["diagram"], found["seed"], found["robot"]) == (diagram, 3, "hrp2_like_leg")
    assert found["duration"] == pytest.approx(0.3)
    assert found["real_time_factor"] > 0.0
    assert (found["files"], found["faults"], found["notes"]) == ([], [], [])
    assert [row["joint"] for row in found["joints"]] == JOINTS
    for row in found["joints"]:
        assert 0.0 <= row["rms_error"] <= row["max_error"] < 0.01
        assert 0.0 <= row["max_torque"] < 100.0


def test_for_people_a_table_on_stdout_and_progress_on_stderr(invoke, monkeypatch):
    outcome = invoke("simulate", "hrp2_leg", *SHORT, "--scenario-text", SERVO)
    assert outcome.code == 0
    assert all(line.startswith("simulate hrp2_leg: ") for line in outcome.err.splitlines())
    assert len(outcome.err.splitlines()) <= 3  # sparing where there is no terminal
    assert "of 0.3 s" in outcome.err
    assert all(joint in outcome.out for joint in JOINTS)
    assert "0.3 s simulated at" in outcome.out
    assert "simulate hrp2_leg" not in outcome.out
    monkeypatch.setenv("COLUMNS", "40")
    narrow = invoke("simulate", "hrp2_leg", *SHORT, "--scenario-text", SERVO).out.splitlines()
    assert max(map(len, narrow)) <= 40
    rows = {line.split()[0]: line.split()[1:] for line in narrow if line.startswith("r_")}
    assert list(rows) == JOINTS  # no name is broken
    assert all(len([float(x) for x in row]) == 3 for row in rows.values())  # and no number


def test_faults_are_named_with_their_time(invoke):
    text = "{faults: {imu: [{kind: nan, start: 0.1}]}}"
    call = ["simulate", "hrp2_leg", *SHORT, "--scenario-text", text]
    (fault,) = [f for f in json.loads(invoke(*call, "--json").out)["faults"] if f["name"].startswith("imu/")]
    assert 0.1 <= fault["first"] <= 0.15
    assert f"fault: {fault['name']} from {fault['first']:.3f} s" in invoke(*call).out


@pytest.fixture(scope="module")
def motion(tmp_path_factory):
    """Growing sinusoids of 3 s under the servo, written as CSV."""
    from drake_tc.cli.main import run

    folder = tmp_path_factory.mktemp("motion") / "new" / "folder"
    assert (
        run(["simulate", "hrp2_leg", "--scenario-name", "identify_motion", "--duration", "3", "--out", str(folder)])
        == 0
    )
    return folder


def test_log_and_rig_file_are_read_back(motion):
    rig = load_rig(motion / "rig.yaml")
    assert list(rig.joints) == JOINTS
    assert set(rig.drive.values()) == {"position_servo"} and set(rig.load.values()) == {"torque"}
    (run,) = load_runs([motion / "log.csv"], rig)
    assert len(run) == 3001 and run.period == pytest.approx(1e-3, rel=1e-6)
    assert run.columns["imu_torso/accel_z"].mean() == pytest.approx(9.81, abs=0.05)
    for joint in JOINTS:
        assert set(rig.required_columns(joint)) <= set(run.columns)
        assert np.ptp(run.columns[f"{joint}/position"]) > 0.01


def test_identify_reads_them_and_finds_the_simulated_gain(invoke, motion, tmp_path):
    model = tmp_path / "model.yaml"
    call = [
        "--rig",
        motion / "rig.yaml",
        "--log",
        motion / "log.csv",
        "--joint",
        "r_hip_pitch",
        "--out",
        model,
        "--json",
    ]
    outcome = invoke("identify", *call)
    assert outcome.code == 0
    found = json.loads(outcome.out)["joints"]["r_hip_pitch"]["parameters"]
    # simulated is Table 1 of Del Prete et al. (2016); a dead zone, which three linear terms lack, biases the fit
    assert found["K_tau"]["value"] == pytest.approx(0.12e-3, rel=0.3)
    assert found["K_v"]["value"] == pytest.approx(7.0e-3, rel=0.2)
    assert model.exists()


@pytest.mark.slow
@pytest.mark.xfail(
    strict=True,
    reason="three seconds of motion: a lag beside an early effort is as probable, and near rest, where the dead zone "
    "acts, rows hardly count",
)
def test_close_loop_reads_them_and_finds_the_dead_zone(invoke, motion, tmp_path):
    other = tmp_path / "other"
    call = ["simulate", "hrp2_leg", "--scenario-name", "identify_motion", "--duration", 3, "--seed", 1, "--out", other]
    assert invoke(*call).code == 0
    rig = yaml.safe_load((motion / "rig.yaml").read_text())
    rig |= {"joints": ["r_hip_pitch"], "declared": {"r_hip_pitch": rig["declared"]["r_hip_pitch"]}}
    one = tmp_path / "one.yaml"
    one.write_text(yaml.safe_dump(rig))
    logs = ["--log", motion / "log.csv", "--holdout", other / "log.csv"]
    assert invoke("close-loop", "--rig", one, *logs, "--out", tmp_path / "report").code == 0
    report = json.loads((tmp_path / "report" / "report.json").read_text())
    assert report["verdict"] != "no_missing_effect"  # the torques are estimated: their errors are more than noise
    assert "deadzone" in [effect["id"] for effect in report["joints"]["r_hip_pitch"]["effects"]]


@pytest.mark.parametrize("ending", ["parquet", "npz"])
def test_other_formats_hold_the_same_numbers_and_a_seed_repeats(invoke, tmp_path, ending):
    call = ["simulate", "hrp2_leg", *SHORT, "--scenario-text", SERVO, "--seed", 5, "--json"]
    first = invoke(*call, "--out", tmp_path / "csv")
    other = invoke(*call, "--out", tmp_path / ending, "--log-format", ending)
    assert json.loads(other.out)["files"] == [str(tmp_path / ending / name) for name in (f"log.{ending}", "rig.yaml")]
    assert json.loads(other.out)["joints"] == json.loads(first.out)["joints"]
    one, two = read_table(tmp_path / "csv" / "log.csv"), read_table(tmp_path / ending / f"log.{ending}")
    assert list(one.columns) == list(two.columns)
    assert_allclose(one.to_numpy(), two.to_numpy(), rtol=1e-8, atol=1e-12)  # CSV holds nine digits


def test_another_seed_is_another_log_of_the_same_motion(invoke, tmp_path):
    tables = []
    for seed in (0, 1):
        call = ["simulate", "hrp2_leg", *SHORT, "--scenario-text", SERVO, "--seed", seed]
        assert invoke(*call, "--out", tmp_path / str(seed)).code == 0
        tables.append(read_table(tmp_path / str(seed) / "log.csv"))
    moved = (tables[0] - tables[1]).abs()
    assert moved["time"].max() == 0.0
    for name in ("r_knee/position", "imu_torso/gyro_x", "ft_right_ankle/fz"):
        assert 0.0 < moved[name].max() < 6.0  # noise: some 1e-5 rad, 0.005 rad/s, 0.5 N
    assert moved["r_knee/position"].max() < 2e-4


def test_a_log_with_lost_samples_says_why_it_has_no_torque(invoke, tmp_path):
    text = "{faults: {imu: [{kind: dropped, start: 0.1, duration: 0.02}]}}"
    call = ["simulate", "hrp2_leg", *SHORT, "--scenario-text", text, "--out", tmp_path, "--json"]
    outcome = invoke(*call)
    assert outcome.code == 0
    (note,) = json.loads(outcome.out)["notes"]
    assert "no torque columns" in note and "imu" in note and "finite" in note
    assert set(load_rig(tmp_path / "rig.yaml").load.values()) == {"unknown"}
    identified = invoke(
        "identify", "--rig", tmp_path / "rig.yaml", "--log", tmp_path / "log.csv", "--out", tmp_path / "m"
    )
    assert "load torque is not known" in identified.refusal()
    assert "no torque columns" in invoke(*call[:-1]).err


@pytest.mark.parametrize("duration", [0.0005, 0.001, 0.01])
def test_a_run_shorter_than_the_delay_of_its_drive_is_still_written(invoke, tmp_path, duration):
    outcome = invoke("simulate", "sea_joint", "--duration", duration, "--out", tmp_path, "--json")
    assert outcome.code == 0
    assert np.all(pd.read_csv(tmp_path / "log.csv")["r_knee/voltage"] == 0.0)


@pytest.mark.parametrize("duration", [0.0005, 0.001, 0.01])
def test_a_run_too_short_for_torques_is_still_written(invoke, tmp_path, duration):
    outcome = invoke("simulate", "hrp2_leg", "--duration", duration, "--out", tmp_path, "--json")
    assert outcome.code == 0
    assert "no torque columns" in json.loads(outcome.out)["notes"][0]
    assert (tmp_path / "log.csv").exists() and (tmp_path / "rig.yaml").exists()


def test_a_scenario_file_of_ones_own(invoke, tmp_path):
    from drake_tc.registry import diagrams

    robot = (diagrams()["hrp2_leg"].scenario_file.parent / "../models/hrp2_like/hrp2_like_leg.yaml").resolve()
    path = tmp_path / "own.yaml"
    path.write_text(
        f"first: {{robot: {robot}, duration: 0.1, controller: servo}}\nsecond: {{extends: first, duration: 0.3}}"
    )
    call = ["simulate", "hrp2_leg", "--scenario-file", path, "--json"]
    assert json.loads(invoke(*call).out)["duration"] == pytest.approx(0.1)
    assert json.loads(invoke(*call, "--scenario-name", "second").out)["duration"] == pytest.approx(0.3)
    assert "first, second" in invoke(*call, "--scenario-name", "third").refusal()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nothing"], ["no diagram 'nothing'", "hrp2_leg, hrp2_leg_contact"]),
        (
            ["hrp2_leg", "--scenario-name", "nothing"],
            ["hrp2_leg.scenario.yaml", "'nothing'", "stairs_swing", "hanging"],
        ),
        (["hrp2_leg", "--scenario-name", ""], ["no scenario ''"]),
        (["hrp2_leg", "--scenario-text", "{gainz: 1}"], ["unknown key 'gainz'; did you mean 'gains'", "gains"]),
        (["hrp2_leg", "--scenario-text", "{gains: {k66: 1}}"], ["gains", "'k66'", "k6"]),
        (["hrp2_leg", "--scenario-text", "[1"], ["scenario text", "YAML"]),
        (["hrp2_leg", "--scenario-text", "7"], ["scenario text", "mapping"]),
        (["hrp2_leg", "--scenario-text", "{gains: {k6: -1.0}}"], ["k6", ">= 0", "-1.0"]),
        (["hrp2_leg", "--scenario-text", "{motion: {posture: {knie: 1.0}}}"], ["'knie'", "r_knee"]),
        (["hrp2_leg", "--scenario-text", "{tare: 0.001}"], ["tare", "period"]),
        (["hrp2_leg", "--duration", "-1"], ["--duration", "positive"]),
        (["hrp2_leg", "--duration", "nan"], ["--duration", "positive"]),
        (["sea_joint", "--duration", "1e400"], ["--duration", "positive", "inf"]),
        (["hrp2_leg", "--duration", "long"], ["--duration"]),
        (["hrp2_leg", "--seed", "-1"], ["--seed"]),
        (["hrp2_leg", "--seed", "0.5"], ["--seed"]),
        (["hrp2_leg", "--log-format", "mat"], ["--log-format", "csv, parquet or npz", "'mat'"]),
        (["hrp2_leg", "twice"], ["twice"]),
        ([], ["DIAGRAM"]),
    ],
)
def test_a_slip_is_one_line(invoke, arguments, words):
    outcome = invoke("simulate", *arguments)
    line = outcome.refusal()
    assert len([part for part in outcome.err.splitlines() if not part.startswith("simulate ")]) == 1
    assert all(word in line for word in words), line


@pytest.mark.parametrize(
    ("text", "word"),
    [
        (None, "no such YAML file"),
        ("x: [", "YAML"),
        ("[1, 2]", "mapping"),
        ("{}", "at least one scenario"),
        ("a: {}", "robot"),
    ],
)
def test_a_scenario_file_that_cannot_be_used(invoke, tmp_path, text, word):
    path = tmp_path / "own.yaml"
    if text is not None:
        path.write_text(text)
    line = invoke("simulate", "hrp2_leg", "--scenario-file", path).refusal()
    assert "own.yaml" in line and word in line


def test_a_folder_that_cannot_be_made_is_told_before_anything_runs(invoke, tmp_path):
    (tmp_path / "taken").write_text("a file")
    for folder in (tmp_path / "taken", tmp_path / "taken" / "below"):
        outcome = invoke("simulate", "hrp2_leg", "--duration", 100, "--out", folder)
        assert str(folder) in outcome.refusal()
        assert outcome.err.count("\n") == 1


@pytest.mark.parametrize("name", ["log.csv", "rig.yaml"])
def test_a_file_that_cannot_be_written(invoke, tmp_path, name):
    (tmp_path / name).mkdir()
    call = ["simulate", "hrp2_leg", "--duration", 0.05, "--out", tmp_path]
    line = invoke(*call).refusal()
    assert str(tmp_path / name) in line and "cannot be written" in line


def test_a_runaway_names_system_and_time(invoke):
    push = "{pushes: [{link: r_foot, begin: 0.0, duration: 1.0, torque: [1.0e+5, 0.0, 0.0]}], joint_stops: none}"
    outcome = invoke("simulate", "hrp2_leg", *SHORT, "--scenario-text", push)
    line = outcome.refusal()
    assert "'plant' ran away" in line and "t = 0." in line and "rad/s" in line
    assert len([part for part in outcome.err.splitlines() if not part.startswith("simulate ")]) == 1


def test_a_state_that_is_no_number_names_the_time(invoke):
    push = "{pushes: [{link: r_foot, begin: 0.0, duration: 1.0, force: [1.0e+300, 0.0, 0.0]}]}"
    line = invoke("simulate", "hrp2_leg", *SHORT, "--scenario-text", push).refusal()
    assert "t = 0.0" in line


def test_absurd_gains_move_within_bounds_or_say_so(invoke):
    text = "{gains: {k6: 1.0e+8, k7: 1.0e+8, kp: 1.0e+8}}"
    outcome = invoke("simulate", "hrp2_leg", "--duration", 0.5, "--scenario-text", text, "--json")
    if outcome.code:
        assert "t = 0." in outcome.refusal()
    else:
        rows = json.loads(outcome.out)["joints"]
        assert all(row["max_error"] < 3.2 and row["max_torque"] < 500.0 for row in rows)
