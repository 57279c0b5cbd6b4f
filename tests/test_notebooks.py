"""The notebooks' scripts run and say what their text relies on; those that are stored rendered hold the same cells."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "notebooks"
SCRIPTS = sorted(FOLDER.glob("*.py"))
SAID = {
    "01_close_the_loop": ("(effects_found)", "+ deadzone", "+ stribeck"),
    "02_leg_torque_control": (
        "encoder/missing flagged",
        "imu/frozen flagged",
        "all commands finite: True",
        "verdict: effects_found",
        "drive gain that switches with the direction",
    ),
    "03_stability_and_tuning": (
        "prediction and simulation judge all of them alike",
        "Kp = 4 dies away",
        "Kp = 7 grows",
        "tuned is less than half of paper: True",
        "with 6 of 6",
    ),
    "04_robust_tsid": (
        "all solved: True",
        "p_rect and p_box are lower bounds at every state: True",
        "every robust measure is safer than classic: True",
        "the robust controller misses limits a third as often or less: True",
        "independent: False",
        "contact forces stay in their cones: classic False, individual True",
        "the robust controller stands: True",
        "twice the classic p, all states             missed",
        "p_ind >= p_rect >= p_box                    missed",
    ),
    "05_coman": (
        "but for the delay the observer has the least error: True",
        "raw error, goal half the momentum observer's: missed",
        "both goals, 1 dB and 3 deg: True; predictor halves the lag: True",
        "torque ripple",
        "less than half is left: True",
        "with ours the robot stands: True; with the chain it falls: True",
        "torque control survives what stiff positions do not: True",
        "imu/frozen               flagged 10 ms after the fault",
        "the robot stands: True",
    ),
    "06_experiment_design": (
        "temperature not recorded",
        "not separable from torque_sensor_bias",
        "refused: torque_sensor_bias and encoder_offset are the same function",
        "the designed motion narrows the intervals: True",
        "the motion keeps its limits and begins and ends at rest: True",
        "a spring of 8 N·m/rad is found: True",
        "a joint without a spring is said to have one: False",
    ),
    "07_the_same_joint_next_month": (
        "the interval holds the truth: True",
        "changed: ['coulomb']",
        "the trend's interval holds the truth: True",
        "friction named at the end: True",
        "the push is told as a push: True",
    ),
}
"""What a notebook's prose takes for granted, as its cells print it."""
SHOWN = {
    "01_close_the_loop": {"image/png"},
    "02_leg_torque_control": {"image/png", "image/svg+xml"},
    "03_stability_and_tuning": {"image/png"},
    "04_robust_tsid": {"image/png"},
    "05_coman": {"image/png"},
    "06_experiment_design": {"image/png"},
    "07_the_same_joint_next_month": {"image/png"},
}
"""Plots, and the block graph."""


def test_every_notebook_is_known_here():
    assert {script.stem for script in SCRIPTS} == set(SAID) == set(SHOWN)


@pytest.mark.slow
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda p: p.stem)
def test_the_script_runs(script, tmp_path):
    environment = os.environ | {"MPLBACKEND": "Agg", "TMPDIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-W", "error::RuntimeWarning", str(script)],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    missing = [text for text in SAID[script.stem] if text not in done.stdout]
    assert not missing, done.stdout[-3000:]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda p: p.stem)
def test_the_script_defines_nothing(script):
    kinds = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef
    defined = [node.name for node in ast.walk(ast.parse(script.read_text("utf-8"))) if isinstance(node, kinds)]
    assert not defined, "what is worth a name is worth the library"


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda p: p.stem)
def test_the_rendered_notebook_is_the_script_run(script):
    jupytext = pytest.importorskip("jupytext")
    notebook = jupytext.read(script.with_suffix(".ipynb"))
    cells = [(cell.cell_type, cell.source) for cell in notebook.cells]
    assert cells == [(cell.cell_type, cell.source) for cell in jupytext.read(script).cells]
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert all(cell.execution_count for cell in code), "stored without its outputs: make notebook"
    kinds = {kind for cell in code for output in cell.outputs for kind in output.get("data", {})}
    assert SHOWN[script.stem] <= kinds, "stored without its plots: make notebook"
    assert not [output for cell in code for output in cell.outputs if output.output_type == "error"]
    assert not [output for cell in code for output in cell.outputs if output.get("name") == "stderr"]  # warnings
    printed = "".join(output.get("text", "") for cell in code for output in cell.outputs)
    assert all(text in printed for text in SAID[script.stem]), "stored from an older library: make notebook"
