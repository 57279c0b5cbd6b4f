"""A drive gain that the rig file declares: a right one changes nothing, a wrong one is an effect."""

from pathlib import Path

import pytest
from numpy.testing import assert_allclose

from ..log_files import found, write_logs
from ..rigs import Joint

JOINT = Joint(duration=8.0, torque_noise=0.05, encoder_step=1e-5)


def test_a_right_gain_is_no_missing_effect(tmp_path: Path) -> None:
    report = write_logs(tmp_path, JOINT, rig={"drive_gain": JOINT.gain}).report(assess_residual=False)
    assert found(report) == []
    assert_allclose(report["joints"]["joint"]["baseline"]["parameters"]["drive"]["gain"], JOINT.gain, rtol=1e-6)


@pytest.mark.parametrize("error", [-0.12, pytest.param(0.15, marks=pytest.mark.slow)])
def test_a_wrong_gain_is_an_effect_of_its_size(tmp_path: Path, error: float) -> None:
    declared = JOINT.gain * (1.0 + error)
    report = write_logs(tmp_path, JOINT, rig={"drive_gain": declared}).report(assess_residual=False)
    assert found(report) == ["servo_gain"]
    (effect,) = report["joints"]["joint"]["effects"]
    value = effect["parameters"]["gain_error"]
    assert_allclose(value["value"], error, atol=0.005)
    assert value["ci95"][0] < error < value["ci95"][1]
    assert effect["heldout_gain"] > 0.5
