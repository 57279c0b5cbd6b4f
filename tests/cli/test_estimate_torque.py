"""`drake-tc estimate-torque`: simulated logs of the leg, against the torques that Drake applied."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import yaml

from drake_tc.cli.main import run
from drake_tc.estimation.off_line import OffLineFilter, estimate_log
from drake_tc.estimation.robot_loads import robot_logs
from drake_tc.filtering.savitzky_golay import Window
from drake_tc.logs.prepare import load_run
from drake_tc.logs.rig import load_rig
from drake_tc.loops.recording import write_log
from drake_tc.loops.torque.running import log_columns
from drake_tc.robot.robot import load_robot
from tests.benchmarks.blind_leg.cases import ROBOT, leg_case, zeroed_suite
from tests.benchmarks.blind_leg.recorder import random_motion, record_leg

OLD = OffLineFilter(Window(31, 2), Window(31, 2), Window(31, 2))
"""The 31 ms that held for every log before the windows were chosen from it."""


@pytest.fixture(scope="module")
def leg(tmp_path_factory):
    """(folder, true torques by encoder): a swinging leg with a fine and a coarse encoder."""
    folder = tmp_path_factory.mktemp("leg")
    robot, case = load_robot(ROBOT), leg_case(11, 7)
    document = yaml.safe_load(ROBOT.read_text(encoding="utf-8")) | {"fixed_base": False}
    del document["actuators"]
    (folder / ROBOT.name).write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")
    shutil.copy(robot.urdf, folder)
    rig = {"robot": ROBOT.name, "drive": "position_servo", "load": {"robot": "estimate"}}
    (folder / "rig.yaml").write_text(yaml.safe_dump(rig), encoding="utf-8")
    truth = {}
    for name, step in (("fine", 1e-5), ("coarse", 1e-4)):
        suite = zeroed_suite()
        suite = replace(suite, encoder=replace(suite.encoder, noise=step, resolution=step))
        motion = random_motion(np.random.default_rng(5), robot, 0.3, robot.posture)
        recording = record_leg(robot, case.models, suite, "swing", motion, 3.0, seed=5)
        write_log(log_columns(recording), folder / f"{name}.csv")
        truth[name] = recording["joint_torque"]
    return folder, truth


def _share_of_range(found: np.ndarray, truth: np.ndarray) -> float:
    """Mean over the joints of the RMS error over the range, without 0.1 s at the ends."""
    error = (found - truth)[100:-100]
    return float(np.mean(np.sqrt(np.mean(error**2, axis=0)) / np.ptp(truth, axis=0)))


def test_it_writes_the_torques_of_each_log_and_they_are_nearer_to_the_truth_than_31_ms(leg, tmp_path, capsys):
    folder, truth = leg
    logs = [f"--log={folder / name}.csv" for name in truth]
    assert run(["estimate-torque", f"--rig={folder / 'rig.yaml'}", *logs, f"--out={tmp_path}", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [entry["file"] for entry in told["logs"]] == [str(tmp_path / f"{name}_torque.csv") for name in truth]
    rig = load_rig(folder / "rig.yaml")
    for entry, (name, torque) in zip(told["logs"], truth.items(), strict=True):
        table = pd.read_csv(entry["file"])
        assert list(table.columns) == ["time", *(f"{joint}/torque" for joint in rig.joints)]
        recorded = load_run(folder / f"{name}.csv", rig)
        assert np.allclose(table["time"], recorded.time)
        robot = robot_logs(rig, [recorded])
        old = estimate_log(robot.model, robot.sensors(recorded, slice(0, len(recorded))), OLD).torque
        ours = _share_of_range(table.iloc[:, 1:].to_numpy(), torque[: len(table)])
        assert ours < 0.9 * _share_of_range(old, torque[: len(table)])
    fine, coarse = (entry["filters"]["encoder"] for entry in told["logs"])
    assert coarse["samples"] / (coarse["order"] + 1) > fine["samples"] / (fine["order"] + 1)


def test_a_rig_without_a_robots_model_is_refused(tmp_path, leg, capsys):
    (tmp_path / "rig.yaml").write_text("{joint: r_knee, drive: position_servo, load: unknown}", encoding="utf-8")
    log = f"--log={leg[0] / 'fine.csv'}"
    assert run(["estimate-torque", f"--rig={tmp_path / 'rig.yaml'}", log, f"--out={tmp_path}"]) == 2
    assert "load: expected {robot: estimate}" in capsys.readouterr().err.splitlines()[-1]
