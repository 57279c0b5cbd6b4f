"""Tolerances of a joint's own sensors: what reports, model files and free runs make of them, and the intervals.

What is named beyond a tolerance and within it are rows of `cases/sensors.py`.
"""

import json
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.prepared import without_errors
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.models import model_of
from drake_tc.diagnosis.run import close_loop
from drake_tc.effects.library import effect
from drake_tc.logs.rig import Rig, parse_rig
from drake_tc.loops.joint_bench import rig_free_run
from drake_tc.report.data_files import joint_json

from . import pendulum_rig
from .log_files import write_logs
from .rigs import Joint, Motion, record, servo

TOLERANCE = {"torque": {"bias": "0.2 N*m", "gain": "1 %"}}
JOINT = Joint(torque_noise=0.1, encoder_step=1e-5, duration=12.0, period=4e-3)
QUICK = DiagnosisOptions(assess_residual=False)
FEW = replace(QUICK, effects=tuple(map(effect, ("torque_sensor_bias", "stribeck"))))
NONE = replace(QUICK, effects=())


def sensor(bias: float, gain: float = 0.0):
    """A torque sensor's error tau_meas - tau."""

    def error(m: Motion) -> np.ndarray:
        return bias + gain * m.tau

    return error


def rig_of(joint: Joint, sensors: Mapping[str, object]) -> Rig:
    """The joint's rig, its rotor inertia declared unless it has none."""
    declared = {"rotor_inertia": joint.inertia} if joint.inertia else {}
    return parse_rig({"joint": "joint", "drive": joint.drive, "declared": declared, "sensors": sensors})


def diagnose(joint: Joint, sensors: Mapping[str, object], options: DiagnosisOptions, seed: int = 0) -> JointResult:
    runs = [record(joint, name, 0.9 * k, 10 * seed + k) for k, name in enumerate(("one", "two", "held"))]
    return diagnose_joint(runs[:2], runs[2:], rig_of(joint, sensors), "joint", options)


def test_an_error_within_tolerance_is_part_of_both_models_and_of_no_report():
    result = diagnose(replace(JOINT, sensor=sensor(0.25)), TOLERANCE, FEW)
    assert result.effects == () and result.did_not_hold == ()
    assert_allclose(result.before.heldout, result.after.heldout, rtol=1e-3)  # the model before has the error as well
    assert result.after.heldout < 1.1 * result.noise_floor
    text = json.dumps(joint_json(result), default=str)
    assert "within_tolerance" not in text
    assert [e.key for e in model_of(result, final=True).effects] == ["rotor_inertia", "viscous", "coulomb"]


def test_free_runs_are_given_the_current_without_the_error():
    """50 mN m at 0.4 A/(N m) are 20 mA, the tolerance; while the joint slides, such a constant is like a friction."""
    constant, rotor = -0.08, 0.05
    swing = pendulum_rig.Swing(constant=constant, duration=12.0, period=4e-3, effort_noise=1e-3)
    load = {"mass": 1.0, "length": 2.5 / 9.81, "inertia": swing.inertia - rotor, "zero": swing.zero}
    rig = pendulum_rig.rig_of(
        swing,
        {"pendulum": load},
        drive_gain=None,
        declared={"rotor_inertia": rotor},
        sensors={"current": {"bias": "20 mA"}},
    )
    runs = [pendulum_rig.record(swing, f"run{k}", k, 0.37 * k) for k in range(3)]
    result = diagnose_joint(runs[:2], runs[2:], rig, pendulum_rig.JOINT, NONE)
    assert result.after.heldout < 1.1 * result.noise_floor
    (run,) = without_errors(runs[2:], rig, pendulum_rig.JOINT, result.final)
    moved = runs[2].columns["joint/current"] - run.columns["joint/current"]
    assert_allclose(moved, swing.gain * constant, rtol=0.05)


def test_free_runs_are_given_the_torque_without_the_error(tmp_path):
    """4 N m of bias at 500 N m/rad is 8 mrad of position, which the free runs of both models must not show."""
    joint = servo(torque_noise=0.1, encoder_step=1e-5, duration=12.0, sensor=sensor(4.0))
    logs = write_logs(tmp_path, joint, rig={"sensors": {"torque": {"bias": "3 N*m"}}})
    result = close_loop(logs.rig, logs.train, logs.held, FEW, rig_free_run).joints["joint"]
    assert result.effects == ()
    assert max(result.before.free_run_heldout, result.after.free_run_heldout) < 1e-3


RIGS = 12


@pytest.mark.slow
def test_intervals_of_friction_hold_the_truth_of_rigs_with_errors_within_tolerance():
    """Every other rig knows its rotor inertia, which tells the sensor's scale; the others know its tolerance alone."""
    inside: list[bool] = []
    plain: list[bool] = []
    for seed in range(RIGS):
        rng = np.random.default_rng([seed, 7])
        joint = replace(JOINT, duration=8.0, inertia=0.3 * (seed % 2), viscous=rng.uniform(4.0, 8.0))
        joint = replace(joint, sensor=sensor(*(np.array([0.2, 0.01]) * rng.standard_normal(2))))
        for held, sensors in ((inside, TOLERANCE), (plain, {})):
            found = diagnose(joint, sensors, NONE, seed).final_parameters
            for name, true in (("viscous", joint.viscous), ("coulomb", joint.coulomb)):
                low, high = found[name][name].ci95
                held.append(low <= true <= high)
    assert len(inside) == 2 * RIGS
    assert np.mean(inside) >= 0.85  # fewer than 41 of 48 at 95 %: one case in 10^2.5
    assert np.mean(plain) < 0.75  # without the tolerances the biases are in the friction
