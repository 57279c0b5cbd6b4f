"""Drives commanded in N m, and position servos with known gains, from log files to the report."""

from dataclasses import replace
from pathlib import Path

import pytest
from numpy.testing import assert_allclose

from .log_files import found, write_logs
from .rigs import Joint, servo

TORQUE = Joint(drive="torque", gain=1.0, torque_noise=0.05, encoder_step=1e-5)
PROPORTIONAL, DERIVATIVE = 500.0, 4.0
SERVO = servo(gain=1.0 / PROPORTIONAL, torque_noise=0.05, encoder_step=1e-5, viscous=6.0 + DERIVATIVE)
"""The servo's damping adds to the joint's own viscous friction of 6 N m s/rad."""


def _joint(report):
    return report["joints"]["joint"]


def test_a_torque_drive_is_reported_in_newton_metres(tmp_path: Path):
    report = write_logs(tmp_path, TORQUE).report(assess_residual=False)
    joint = _joint(report)
    assert found(report) == [] and joint["error"]["unit"] == "N*m"
    assert_allclose(joint["baseline"]["parameters"]["drive"]["gain"], 1.0, rtol=5e-3)
    assert not any("is expected of a torque drive" in note or "commanded in N*m" in note for note in joint["notes"])


def test_a_torque_drive_of_another_scale_is_told_and_is_an_effect_where_one_is_declared(tmp_path: Path):
    weak = replace(TORQUE, gain=1.2)
    told = _joint(write_logs(tmp_path / "told", weak).report(assess_residual=False))
    assert any("is 1.2 N*m of commanded torque for 1 N*m at the joint" in note for note in told["notes"])
    report = write_logs(tmp_path / "tested", weak, rig={"drive_gain": 1.0}).report(assess_residual=False)
    assert found(report) == ["servo_gain"]
    (effect,) = _joint(report)["effects"]
    assert_allclose(effect["parameters"]["gain_error"]["value"], 1.0 / 1.2 - 1.0, atol=0.005)


def test_a_motors_constants_that_are_wrong_are_an_effect(tmp_path: Path):
    joint = Joint(gain=1.0 / (0.07 * 100.0), torque_noise=0.05, encoder_step=1e-5)
    right = write_logs(tmp_path / "right", joint, rig={"torque_constant": 0.07, "gear_ratio": 100.0})
    assert found(right.report(assess_residual=False)) == []
    wrong = write_logs(tmp_path / "wrong", joint, rig={"torque_constant": 0.08, "gear_ratio": 100.0})
    report = wrong.report(assess_residual=False)
    assert found(report) == ["servo_gain"]
    error = _joint(report)["effects"][0]["parameters"]["gain_error"]["value"]
    assert_allclose(error, 0.07 / 0.08 - 1.0, atol=0.005)


@pytest.mark.parametrize("strength", [1.0, 1.15])
def test_the_damping_of_a_servo_is_told_apart_from_the_joints_friction(tmp_path: Path, strength: float):
    """tau = strength (Kp (q_d - q) - Kd v): a drive that is stronger than its firmware says damps more too."""
    true = replace(SERVO, gain=SERVO.gain / strength, viscous=6.0 + strength * DERIVATIVE)
    keys = {"proportional_gain": PROPORTIONAL, "derivative_gain": DERIVATIVE}
    report = write_logs(tmp_path, true, rig=keys).report(assess_residual=False)
    assert found(report) == ([] if strength == 1.0 else ["servo_gain"])
    (note,) = (note for note in _joint(report)["notes"] if "servo's damping" in note)
    figures = [float(word) for word in note.replace(";", " ").split() if word.replace(".", "").isdigit()]
    assert_allclose(figures, [6.0 + strength * DERIVATIVE, strength * DERIVATIVE, 6.0], rtol=0.02)


def test_a_derivative_gain_beyond_the_damping_of_the_logs_is_told(tmp_path: Path):
    keys = {"proportional_gain": PROPORTIONAL, "derivative_gain": 40.0}
    report = write_logs(tmp_path, SERVO, rig=keys).report(assess_residual=False)
    assert any("exceeds the identified viscous friction" in note for note in _joint(report)["notes"])
