"""Efforts of an arm's log are those of its drives where they can be; numbers of a servo's registers are not."""

import numpy as np
import pandas as pd
import pytest
import yaml

from drake_tc.cli.main import run
from drake_tc.logs.inspection import trial
from drake_tc.logs.prepare import load_run
from drake_tc.logs.rig import load_rig

from .conftest import inspected

TIME = np.arange(1500) / 250.0


def arm(effort: str, joints: int = 6, scale: float = 4.0, command: str = "{}/position_command") -> pd.DataFrame:
    """Positions, commands and efforts; `effort` and `command` are the names of the columns of one joint."""
    rng = np.random.default_rng(3)
    columns = {"time": TIME}
    for j in range(1, joints + 1):
        position = 0.6 * np.sin(1.1 * TIME + j)
        columns[f"joint{j}/position"] = position
        columns[command.format(f"joint{j}")] = 0.6 * np.sin(1.1 * TIME + j + 0.03)
        columns[effort.format(f"joint{j}")] = scale * np.cos(1.1 * TIME + j) + 0.01 * rng.normal(size=TIME.size)
    return pd.DataFrame(columns)


@pytest.mark.parametrize(
    ("effort", "drive", "column"),
    [
        ("{}/current", "current", None),
        ("{}/effort", "torque", "joint3/torque_command"),
        ("{}/torque_command", "torque", None),
        ("{} motor current [mA]", "current", "joint3/current"),
    ],
)
def test_the_efforts_of_an_arm_are_those_of_its_drives(tmp_path, effort, drive, column):
    found = inspected(tmp_path, arm(effort))
    assert (found.rig["drive"], len(found.rig["joints"])) == (drive, 6) and trial(found) == ""
    if column is not None:
        assert found.rig["columns"][column] == effort.format("joint3")
    assert found.comment.startswith("drive: this rig file uses the recorded") and "position_servo" in found.comment
    assert any(found.comment[1:] in note for note in found.notes)


def test_efforts_without_position_commands_may_be_currents_and_inspect_says_so(tmp_path):
    table = arm("{}/effort")
    found = inspected(tmp_path, table[[name for name in table if not name.endswith("_command")]])
    assert found.rig["drive"] == "torque"
    assert any("many drivers publish currents there" in note and "drive: current" in note for note in found.notes)


def test_a_motor_s_current_is_that_of_its_joint(tmp_path):
    table = arm("{}_motor_current_A", command="{}_goal")
    table.columns = [name.replace("/position", "_angle_deg") for name in table]
    found = inspected(tmp_path, table)
    assert found.rig["columns"]["joint2/current"] == "joint2_motor_current_A"
    assert found.rig["joints"] == [f"joint{j}" for j in range(1, 7)] and trial(found) == ""


def test_the_rig_file_says_what_was_chosen_and_how_to_change_it(tmp_path):
    path, rig = tmp_path / "run.csv", tmp_path / "rig.yaml"
    arm("{}/effort", command="{} q_ref").to_csv(path, index=False)
    assert run(["inspect", str(path), "--rig", str(rig)]) == 0
    text = rig.read_text()
    (comment,) = [line for line in text.splitlines() if line.startswith("# drive:")]
    assert "With `drive: position_servo`" in comment and "write `drive: current`" in comment
    assert load_run(path, load_rig(rig)).columns["joint1/torque_command"].shape == TIME.shape
    # the two changes that the comment names give rig files that read the log
    servo, amperes = tmp_path / "servo.yaml", tmp_path / "amperes.yaml"
    servo.write_text(text.replace("drive: torque", "drive: position_servo"))
    amperes.write_text(text.replace("drive: torque", "drive: current").replace("/torque_command:", "/current:"))
    assert "joint1/position_command" in load_run(path, load_rig(servo)).columns
    assert "joint1/current" in load_run(path, load_rig(amperes)).columns
    assert yaml.safe_load(text)["columns"]["joint2/position_command"] == "joint2 q_ref"


@pytest.mark.parametrize(
    ("effort", "change"),
    [
        ("{}/present_current", lambda values: values),  # a register of a bus
        ("{}/current", lambda values: np.round(20.0 * values)),  # whole numbers of an unknown unit
        ("{}/current", np.abs),  # a size without a sign
        ("{}/effort", lambda values: 1e3 * values),  # no torque of an arm
        ("{}/current", lambda values: 0.0 * values),  # nothing was recorded
    ],
)
def test_what_is_no_effort_of_a_drive_leaves_a_servo(tmp_path, effort, change):
    table = arm(effort)
    for name in (effort.format(f"joint{j}") for j in range(1, 7)):
        table[name] = change(table[name])
    found = inspected(tmp_path, table)
    assert found.rig["drive"] == "position_servo" and found.comment == ""


def test_one_joint_without_an_effort_and_a_bench_of_two_joints_leave_servos(tmp_path):
    for table in (arm("{}/current").drop(columns="joint4/current"), arm("{}/current", joints=2)):
        assert inspected(tmp_path, table).rig["drive"] == "position_servo"
