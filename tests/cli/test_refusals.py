"""Input that cannot be used: exit 2, one line on stderr that says what, where and what to do, nothing on stdout."""

import pandas as pd
import pytest

from drake_tc.cli.demo import JOINT


def test_no_holdout(invoke, bench, tmp_path):
    line = invoke("close-loop", *bench.arguments(), "--out", tmp_path).refusal()
    assert "--holdout" in line and "2 and 0" in line


def test_no_run_to_fit(invoke, bench, tmp_path):
    line = invoke("close-loop", "--rig", bench.rig, "--holdout", bench.holdout, "--out", tmp_path).refusal()
    assert "--log" in line


def test_logs_without_a_rig(invoke, bench, tmp_path):
    assert "--rig" in invoke("close-loop", "--log", bench.logs[0], "--out", tmp_path).refusal()


def test_a_declared_file_that_cannot_be_used(invoke, bench, tmp_path):
    robot = tmp_path / "robot.xml"
    robot.write_text('<mujoco><worldbody><body><joint name="hip"/></body></worldbody></mujoco>', encoding="utf-8")
    assert "--rig" in invoke("close-loop", "--declared", robot, "--out", tmp_path / "out").refusal()
    line = invoke("close-loop", *bench.arguments(), "--holdout", bench.holdout, "--declared", robot).refusal()
    assert f"it has no joint {JOINT}; its joints: hip" in line


@pytest.mark.parametrize("command", ["close-loop", "identify"])
def test_no_such_file(invoke, bench, tmp_path, command):
    gone = tmp_path / "gone.csv"
    more = ["--holdout", bench.holdout] if command == "close-loop" else []
    assert "gone.csv" in invoke(command, "--rig", bench.rig, "--log", gone, *more, "--out", tmp_path / "o").refusal()
    rig = tmp_path / "gone.yaml"
    line = invoke(command, "--rig", rig, "--log", bench.logs[0], *more, "--out", tmp_path / "o").refusal()
    assert "gone.yaml" in line and "no such rig file" in line


def refused(invoke, bench, tmp_path, path) -> str:
    call = ["close-loop", "--rig", bench.rig, "--log", path, "--holdout", bench.holdout, "--out", tmp_path / "out"]
    line = invoke(*call).refusal()
    assert path.name in line
    assert not (tmp_path / "out" / "report.html").exists()
    return line


def test_missing_column(invoke, bench, tmp_path):
    """What else makes a log unusable is told alike: `tests/logs` has its words."""
    path = tmp_path / "damaged.parquet"
    pd.read_parquet(bench.logs[0]).drop(columns=f"{JOINT}/torque").to_parquet(path, index=False)
    assert f"{JOINT}/torque" in refused(invoke, bench, tmp_path, path)


def test_a_file_of_no_known_kind(invoke, bench, tmp_path):
    path = tmp_path / "run.docx"
    path.write_text("not a log")
    refused(invoke, bench, tmp_path, path)


@pytest.mark.parametrize(
    "document", ["joint: knee\n", "joint: knee\ndrive: hydraulic\n", "joint: [\n", "joint: knee\ndrives: current\n"]
)
def test_a_rig_file_that_says_too_little_or_wrong(invoke, bench, tmp_path, document):
    rig = tmp_path / "rig.yaml"
    rig.write_text(document)
    line = invoke("close-loop", "--rig", rig, "--log", bench.logs[0], "--holdout", bench.holdout).refusal()
    assert "rig.yaml" in line


@pytest.mark.parametrize(
    "arguments",
    [
        ["close-lop"],
        ["close-loop", "--rigg", "x"],
        ["identify", "--method", "lasso", "--rig", "x", "--log", "y"],
        ["close-loop", "--seed", "soon"],
        ["import", "atlas", "here", "--out", "there"],
        ["import", "bam"],
        ["identify"],
    ],
)
def test_a_slip_of_the_keyboard_is_one_line(invoke, arguments):
    outcome = invoke(*arguments)
    assert outcome.code == 2
    assert outcome.out == ""
    assert len(outcome.err.strip().splitlines()) == 1 and outcome.err.startswith("drake-tc")


def test_an_output_that_is_an_input_is_refused_and_nothing_is_lost(invoke, bench, tmp_path):
    run = tmp_path / f"run{bench.logs[0].suffix}"
    run.write_bytes(bench.logs[0].read_bytes())
    rig = tmp_path / "rig.yaml"
    rig.write_bytes(bench.rig.read_bytes())
    for out in (run, rig):
        before = out.read_bytes()
        line = invoke("identify", "--rig", rig, "--log", run, "--out", out, "--force").refusal()
        assert out.name in line and "is an input" in line and out.read_bytes() == before


def test_a_scenario_file_is_not_overwritten_by_its_graph(invoke, tmp_path):
    scenario = tmp_path / "s.yaml"
    scenario.write_text("swing: {duration: 1.0}\n")
    call = ["graph", "hrp2_leg", "--scenario-file", scenario, "--out", scenario]
    assert invoke(*call).code == 2 and scenario.read_text() == "swing: {duration: 1.0}\n"


def test_a_rig_file_of_the_users_stays_beside_a_simulated_log(invoke, tmp_path):
    (tmp_path / "rig.yaml").write_text("joint: mine\n")
    line = invoke("simulate", "hrp2_leg", "--duration", 0.1, "--out", tmp_path).refusal()
    assert "rig.yaml" in line and "--force" in line
    assert [path.name for path in tmp_path.iterdir()] == ["rig.yaml"]


def test_a_file_in_the_place_of_the_folder_is_told_before_the_work(invoke, bench, tmp_path):
    place = tmp_path / "report"
    place.write_text("mine")
    call = ["close-loop", *bench.arguments(), "--holdout", bench.holdout, "--out", place]
    assert "--out" in invoke(*call).refusal() and place.read_text() == "mine"


@pytest.mark.parametrize("command", ["design", "rehearse", "close-loop"])
def test_a_negative_seed(invoke, command):
    more = ["--log", "a", "--with", "delay"] if command == "rehearse" else []
    assert "'--seed'" in invoke(command, "--rig", "r", *more, "--seed", -1).refusal()


@pytest.mark.parametrize("name", ["os:system", "json:loads"])
def test_a_function_that_is_no_diagram(invoke, name):
    line = invoke("simulate", name).refusal()
    assert name in line and "expected a function without arguments that returns a Diagram" in line


def test_a_built_in_function_that_is_no_diagram(invoke):
    assert "os:getcwd: expected a function that returns a Diagram, got str" in invoke("graph", "os:getcwd").refusal()


@pytest.mark.parametrize("command", [["schema", "rig"], ["import", "bam", "."]])
def test_a_name_of_a_result_that_is_too_long(invoke, command):
    assert "cannot be written: File name too long" in invoke(*command, "--out", "x" * 300).refusal()
