"""`drake-tc close-loop` from files to report: what it writes, what it prints, what it finds."""

import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from html import unescape

import numpy as np
import pytest

from drake_tc.actuation.model_file import load_models
from drake_tc.cli.close_loop_command import print_summary
from drake_tc.cli.demo import JOINT, ROTOR_INERTIA, DemoLength, record_demo
from drake_tc.diagnosis.result.rig_result import CloseLoopResult

from .conftest import Bench
from .report_schema import check_report


def command(arguments, folder, **environment):
    """The installed command in a process of its own, far from the source tree."""
    call = [sys.executable, "-c", "from drake_tc.cli.entry import main; main()", *arguments]
    return subprocess.run(
        call, cwd=folder, capture_output=True, text=True, timeout=300, env=os.environ | environment, check=False
    )


@pytest.fixture(scope="module")
def closed(bench, tmp_path_factory):
    """One run of the command with tables, in a terminal of 60 columns."""
    out = tmp_path_factory.mktemp("closed") / "deep" / "out"
    return out, command([*bench.close_loop(out), "--mcap"], out.parent.parent, COLUMNS="60", NO_COLOR="1")


def test_it_runs_and_names_what_was_missing(closed):
    out, done = closed
    assert done.returncode == 0, done.stderr
    report = json.loads((out / "report.json").read_text())
    check_report(report)
    assert report["verdict"] == "effects_found"
    joint = report["joints"][JOINT]
    assert {e["id"] for e in joint["effects"]} == {"stribeck", "deadzone"}
    assert "viscous" in joint["baseline"]["effects"] and "coulomb" in joint["baseline"]["effects"]


def test_the_error_falls_on_the_run_that_was_held_out(closed):
    joint = json.loads((closed[0] / "report.json").read_text())["joints"][JOINT]
    before, after = joint["error"]["before"], joint["error"]["after"]
    assert after["heldout"] < 0.25 * before["heldout"]
    assert after["free_run_heldout"] < before["free_run_heldout"]
    assert joint["noise_floor"] < before["heldout"]


def test_the_bag_of_residuals_has_the_errors_of_the_report(closed):
    rosbags = pytest.importorskip("rosbags.highlevel")
    squares = {}
    with rosbags.AnyReader([closed[0] / "residuals.mcap"]) as reader:
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            squares.setdefault(connection.topic, []).append((message.residual_before, message.residual_after))
    joint = json.loads((closed[0] / "report.json").read_text())["joints"][JOINT]
    for run in joint["runs"]:
        found = np.array(squares[f"/{run['run']}/{JOINT}/effort"])
        assert len(found) == run["rows"]
        expected = (run["before"]["rms"], run["after"]["rms"])
        np.testing.assert_allclose(np.sqrt(np.mean(found**2, axis=0)), expected, rtol=1e-12)


def test_both_models_load_and_keep_what_was_declared(closed):
    before = load_models(closed[0] / "model_before.yaml")[JOINT]
    after = load_models(closed[0] / "model_after.yaml")[JOINT]
    assert before.inertia == after.inertia == ROTOR_INERTIA
    added = {v.effect.id for v in after.effects} - {v.effect.id for v in before.effects}
    assert added == {"stribeck", "deadzone"}


def test_the_report_stands_alone(closed):
    html = (closed[0] / "report.html").read_text(encoding="utf-8")
    assert JOINT in html
    for remote in ('src="http', 'href="http', "<script src", "@import"):
        assert remote not in html


def test_a_narrow_terminal_keeps_the_columns(closed):
    _, done = closed
    assert max(map(len, done.stdout.splitlines())) <= 60
    for word in ("before", "after", "held-out", "deadzone"):
        assert word in done.stdout
    assert "reading" in done.stderr and "reading" not in done.stdout


def test_columns_that_seem_to_be_forgotten_are_told_in_one_line(capsys, tmp_path):
    hints = ("run: Column 'temp' looks like a temperature [C].", "run: Column 'knee/torq' is not used.")
    result = CloseLoopResult({}, "no_missing_effect", 1.0, (), (), "rig.yaml", hints=hints)
    print_summary(result, tmp_path)
    lines = " ".join(capsys.readouterr().out.split())
    assert lines.startswith(f"rig file or log: {hints[0]} {hints[1]}")
    print_summary(replace(result, hints=()), tmp_path)
    assert "rig file" not in capsys.readouterr().out


URDF = f"""<robot name="mine" xmlns:drake="http://drake.mit.edu">
  <link name="base"/>
  <link name="shank"/>
  <joint name="{JOINT}" type="revolute">
    <parent link="base"/>
    <child link="shank"/>
    <axis xyz="0 1 0"/>
    <limit effort="1e4" velocity="10" lower="-3" upper="3"/>
    <dynamics damping="40"/>
  </joint>
  <transmission name="servo" type="SimpleTransmission">
    <joint name="{JOINT}"/>
    <actuator name="motor">
      <drake:rotor_inertia value="{ROTOR_INERTIA}"/>
      <drake:gear_ratio value="1"/>
      <drake:controller_gains p="5000" d="0"/>
    </actuator>
  </transmission>
</robot>
"""


@pytest.mark.slow
def test_an_export_can_be_tried_in_the_same_call(invoke, look_for, monkeypatch, tmp_path):
    """The report has three errors side by side: of the model found, of its export and of the file of --declared."""
    length = DemoLength(duration=8.0, period=2e-3, step=2.5e-4)
    rig, logs, holdout = record_demo(tmp_path / "bench", 0, length, jobs=1)
    bench = Bench(rig, tuple(logs), holdout[0])
    mine = tmp_path / "mine.urdf"
    mine.write_text(URDF, encoding="utf-8")
    call = [*bench.close_loop(tmp_path / "out"), "--no-closed-loop", "--declared", str(mine)]
    look_for("stribeck", "deadzone")
    monkeypatch.setenv("COLUMNS", "110")
    done = invoke(*call, "--try-export", "drake-urdf")
    assert done.code == 0, done.err
    document = json.loads((tmp_path / "out" / "report.json").read_text())
    check_report(document)
    (row,) = document["export"]["free_runs"]
    free = document["joints"][JOINT]["error"]["after"]["free_run_heldout"]
    assert row["model"] == pytest.approx(free, rel=0.05)  # the same free run as in the table above it
    assert row["original"] > row["model"] and row["export"] > row["model"]
    assert "export (Drake's plant)" in done.out and "has no Stribeck friction" in done.out
    names, errors = export_table((tmp_path / "out" / "report.html").read_text(encoding="utf-8"))
    assert names[2:] == ["model after (Drake)", "export (Drake's plant)", "your file (Drake's plant)"]
    unit = {"mrad": 1e-3, "µrad": 1e-6}
    shown = [float(number) * unit[prefixed] for number, prefixed in map(str.split, errors[2:])]
    assert shown == pytest.approx([row["model"], row["export"], row["original"]], rel=0.01)  # three digits


def export_table(html: str) -> tuple[list[str], list[str]]:
    """Headings and the only row of the table in the report's section about the export."""
    section = re.search(r'<section id="export">(.*?)</section>', html, re.S)[1]
    cells = [re.findall(rf"<{tag}\b[^>]*>(.*?)</{tag}>", section, re.S) for tag in ("th", "td")]
    headings, row = ([unescape(re.sub(r"<[^>]+>", "", cell)).strip() for cell in part] for part in cells)
    return headings, row
