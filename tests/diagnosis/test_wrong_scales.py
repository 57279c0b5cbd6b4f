"""A drive gain and a torque sensor's gain that are wrong, told apart beside a noisy torque sensor."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

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


@pytest.mark.parametrize("error", [-0.2, pytest.param(0.25, marks=pytest.mark.slow)])
def test_a_wrong_scale_of_the_sensor_is_not_taken_for_a_wrong_drive_gain(error):
    joint = replace(NOISY, sensor=lambda m: error * m.tau)
    result = found(joint, joint.gain, "servo_gain", "torque_sensor_gain")
    assert [e.id for e in result.effects] == ["torque_sensor_gain"]
    low, high = result.effects[0].parameters["gain_error"].ci95
    assert low <= error <= high


@pytest.mark.slow
@pytest.mark.parametrize("error", [-0.2, 0.25])
def test_a_wrong_drive_gain_is_not_taken_for_a_wrong_scale_of_the_sensor(error):
    result = found(NOISY, NOISY.gain * (1.0 + error), "servo_gain", "torque_sensor_gain")
    assert [e.id for e in result.effects] == ["servo_gain"]
    low, high = result.effects[0].parameters["gain_error"].ci95
    assert low <= error <= high


def test_a_wrong_drive_gain_contributes_its_error_of_the_effort_that_the_load_needs():
    """And not all of the effort, of which a gain that is held at its declared value takes over the most."""
    joint, error = Joint(period=4e-3), 0.02
    result = found(joint, joint.gain * (1.0 + error), "servo_gain")
    held = motion(joint, 2.1)
    need = joint.gain * (held.tau + joint.inertia * held.a)
    assert result.effects[0].contribution == pytest.approx(error * np.sqrt(np.mean(need**2)), rel=0.2)


@pytest.mark.parametrize("error", [pytest.param(-0.35, marks=pytest.mark.slow), 0.3])
def test_a_wrong_scale_of_the_sensor_does_not_change_the_delay_beside_it(error):
    """The balance at a held drive gain has the effort that acts, not the recorded one, which is earlier."""
    joint, late = replace(Joint(torque_noise=0.05), sensor=lambda m: error * m.tau), 0.012

    def recorded(name, phase, seed):
        run = record(joint, name, phase, seed=seed)
        effort = f"joint/{joint.drive}"
        early = CubicSpline(run.time, run.columns[effort])(np.minimum(run.time + late, run.time[-1]))
        return replace(run, columns=dict(run.columns) | {effort: early})

    declared = {"rotor_inertia": joint.inertia}
    rig = parse_rig({"joint": "joint", "drive": joint.drive, "drive_gain": joint.gain, "declared": declared})
    options = DiagnosisOptions(effects=(effect("delay.loop"), effect("torque_sensor_gain")), assess_residual=False)
    train = [recorded(f"run{k}", 0.4 * k, k) for k in range(2)]
    result = diagnose_joint(train, [recorded("held", 2.1, 9)], rig, "joint", options)
    assert sorted(e.key for e in result.effects) == ["delay.loop", "torque_sensor_gain"]
    parameters = {name: p for e in result.effects for name, p in e.parameters.items()}
    low, high = parameters["gain_error"].ci95
    assert low <= error <= high
    assert abs(parameters["delay"].value - late) < 0.25e-3  # a quarter of a sample
