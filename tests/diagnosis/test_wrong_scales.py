"""A drive gain and a torque sensor's gain that are wrong, told apart beside a noisy torque sensor."""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.effects.library import effect
from drake_tc.logs.rig import parse_rig

from .rigs import Joint, motion, record

NOISY = Joint(torque_noise=1.5, inertia=1.5)
"""Noise of the torque sensor [N m], a quarter of the torque's RMS, before the filters."""


def found(joint: Joint, declared_gain: float, *keys: str) -> JointResult:
    """Of two training runs and a held-out one, where these effects alone are looked for."""
    train = [record(joint, f"run{k}", 0.4 * k, seed=k) for k in range(2)]
    rig = parse_rig(
        {
            "joint": "joint",
            "drive": joint.drive,
            "drive_gain": declared_gain,
            "declared": {"rotor_inertia": joint.inertia},
        }
    )
    options = DiagnosisOptions(effects=tuple(map(effect, keys)), assess_residual=False)
    return diagnose_joint(train, [record(joint, "held", 2.1, seed=9)], rig, "joint", options)


@pytest.mark.parametrize("error", [-0.2, 0.25])
def test_a_wrong_scale_of_the_sensor_is_not_taken_for_a_wrong_drive_gain(error):
    joint = replace(NOISY, sensor=lambda m: error * m.tau)
    result = found(joint, joint.gain, "servo_gain", "torque_sensor_gain")
    assert [e.id for e in result.effects] == ["torque_sensor_gain"]
    low, high = result.effects[0].parameters["gain_error"].ci95
    assert low <= error <= high


@pytest.mark.parametrize("error", [-0.2, 0.25])
def test_a_wrong_drive_gain_is_not_taken_for_a_wrong_scale_of_the_sensor(error):
    result = found(NOISY, NOISY.gain * (1.0 + error), "servo_gain", "torque_sensor_gain")
    assert [e.id for e in result.effects] == ["servo_gain"]
    low, high = result.effects[0].parameters["gain_error"].ci95
    assert low <= error <= high


def test_a_wrong_drive_gain_contributes_its_error_of_the_effort_that_the_load_needs():
    """And not all of the effort, of which a gain that is held at its declared value takes over the most."""
    joint, error = Joint(), 0.02
    result = found(joint, joint.gain * (1.0 + error), "servo_gain")
    held = motion(joint, 2.1)
    need = joint.gain * (held.tau + joint.inertia * held.a)
    assert result.effects[0].contribution == pytest.approx(error * np.sqrt(np.mean(need**2)), rel=0.2)
