"""Tolerances of a joint's own sensors: what is named, what holds the truth, and what the free runs are given."""

import json
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis import searches as module
from drake_tc.diagnosis.joint import diagnose_joint
from drake_tc.diagnosis.notes import ZeroOfEffort
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.diagnosis.problem.sensor_errors import without_errors
from drake_tc.diagnosis.result import outcome
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.models import model_of
from drake_tc.diagnosis.result.widening import parameters_of
from drake_tc.diagnosis.run import close_loop
from drake_tc.effects.library import effect
from drake_tc.logs.rig import Rig, parse_rig
from drake_tc.loops.joint_bench.recording import rig_free_run
from drake_tc.report.report_json import joint_json
from tests.benchmarks.interval_coverage import friction_intervals

from . import pendulum_rig
from .log_files import write_logs
from .rigs import Joint, Motion, record, servo

TOLERANCE = {"torque": {"bias": "0.2 N*m", "gain": "1 %"}}
JOINT = Joint(torque_noise=0.1, encoder_step=1e-5, duration=12.0, period=4e-3)
QUICK = DiagnosisOptions(assess_residual=False)


def sensor(bias: float, gain: float = 0.0):
    """A torque sensor's error tau_meas - tau."""

    def error(m: Motion) -> np.ndarray:
        return bias + gain * m.tau

    return error


def rig_of(joint: Joint, sensors: Mapping[str, object]) -> Rig:
    """The joint's rig, its rotor inertia declared unless it has none."""
    declared = {"rotor_inertia": joint.inertia} if joint.inertia else {}
    return parse_rig({"joint": "joint", "drive": joint.drive, "declared": declared, "sensors": sensors})


def diagnose(joint: Joint, sensors: Mapping[str, object]) -> JointResult:
    runs = [record(joint, name, 0.9 * k, k) for k, name in enumerate(("one", "two", "held"))]
    return diagnose_joint(runs[:2], runs[2:], rig_of(joint, sensors), "joint", QUICK)


def holds(result: JointResult, key: str, name: str, truth: float) -> bool:
    low, high = result.final_parameters[key][name].ci95
    return low <= truth <= high


def test_a_bias_within_tolerance_is_not_named_and_friction_is_right():
    joint = replace(JOINT, sensor=sensor(0.25))
    assert [e.id for e in diagnose(joint, {}).effects] == ["torque_sensor_bias"]  # without a tolerance it is named
    result = diagnose(joint, TOLERANCE)
    assert result.effects == () and result.did_not_hold == ()
    assert holds(result, "viscous", "viscous", joint.viscous) and holds(result, "coulomb", "coulomb", joint.coulomb)
    assert holds(result, "drive", "gain", joint.gain)
    assert_allclose(result.before.heldout, result.after.heldout, rtol=1e-3)  # the model before has the error as well
    assert result.after.heldout < 1.1 * result.noise_floor
    text = json.dumps(joint_json(result), default=str)
    assert "within_tolerance" not in text
    assert [e.key for e in model_of(result, final=True).effects] == ["rotor_inertia", "viscous", "coulomb"]


def only(monkeypatch: pytest.MonkeyPatch, *keys: str) -> None:
    """Look for these effects alone."""
    for each in (module, outcome):
        monkeypatch.setattr(each, "looked_for", lambda context, effects=None: tuple(effect(k) for k in keys))


def test_a_scale_within_tolerance_is_not_named_and_one_beyond_is(monkeypatch):
    only(monkeypatch, "torque_sensor_gain", "torque_sensor_bias", "load_dependent_friction", "rotor_inertia")
    inside = diagnose(replace(JOINT, torque_noise=0.05, sensor=sensor(0.1, 0.015)), TOLERANCE)
    assert inside.effects == ()
    assert holds(inside, "coulomb", "coulomb", JOINT.coulomb) and holds(inside, "drive", "gain", JOINT.gain)
    beyond = diagnose(replace(JOINT, torque_noise=0.05, sensor=sensor(0.1, 0.06)), TOLERANCE)
    assert [e.id for e in beyond.effects] == ["torque_sensor_gain"]
    low, high = beyond.effects[0].parameters["gain_error"].ci95
    assert low <= 0.06 <= high


def test_a_scale_that_nothing_tells_widens_friction_and_gain_by_the_tolerance(monkeypatch):
    """Without an inertia to hold it against, 1 % of the sensor's scale is 1 % of every torque, times 1.96.

    What the logs leave of the interval without tolerances comes on top, as the root of the sum of squares.
    """
    only(monkeypatch, "stribeck")
    joint = replace(JOINT, inertia=0.0, torque_noise=0.02)
    plain = diagnose(joint, {"torque": {"bias": "0.2 N*m"}})
    wide = diagnose(joint, {"torque": {"bias": "0.2 N*m", "gain": "1 %"}})
    for key, name, truth in (("viscous", "viscous", 6.0), ("coulomb", "coulomb", 3.0), ("drive", "gain", 0.08)):
        before, after = (each.final_parameters[key][name].ci95 for each in (plain, wide))
        half = [0.5 * (ends[1] - ends[0]) for ends in (before, after)]
        assert_allclose(np.sqrt(half[1] ** 2 - half[0] ** 2), 1.96 * 0.01 * truth, rtol=0.01)


def swing_rig(swing: pendulum_rig.Swing, sensors: dict[str, object]) -> Rig:
    """The rig of a pendulum of 2.5 N m under a current drive, of a gain that is not declared."""
    mass, length, rotor = 1.0, 2.5 / 9.81, 0.05
    load = {"mass": mass, "length": length, "inertia": swing.inertia - rotor, "zero": swing.zero}
    return pendulum_rig.rig_of(
        swing, {"pendulum": load}, drive_gain=None, declared={"rotor_inertia": rotor}, sensors=sensors
    )


def pendulum(sensors: dict[str, object], offset: float = 0.0, constant: float = 0.0) -> JointResult:
    """Of such a pendulum whose encoder reads q + offset, and whose current is that of `constant` [N m] too high."""
    swing = pendulum_rig.Swing(constant=constant, duration=12.0, period=4e-3, effort_noise=1e-3)
    runs = [pendulum_rig.record(swing, f"run{k}", k, 0.37 * k) for k in range(3)]
    name = f"{pendulum_rig.JOINT}/position"
    runs = [replace(r, columns=dict(r.columns) | {name: r.columns[name] + offset}) for r in runs]
    return diagnose_joint(runs[:2], runs[2:], swing_rig(swing, sensors), pendulum_rig.JOINT, QUICK)


@pytest.mark.parametrize(("offset", "named"), [(0.08, ["encoder_offset"])])
def test_the_zero_of_an_encoder(offset, named):
    result = pendulum({"encoder": {"offset": "0.01 rad"}}, offset)
    assert [e.id for e in result.effects] == named
    assert holds(result, "coulomb", "coulomb", 0.4) and holds(result, "viscous", "viscous", 0.2)
    for each in result.effects:
        low, high = each.parameters["offset"].ci95
        assert low <= offset <= high
    if not named:  # the free runs are given the position without the error
        swung = [pendulum_rig.record(pendulum_rig.Swing(), "run", 0)]
        (run,) = without_errors(swung, swing_rig(pendulum_rig.Swing(), {}), "joint", result.final)
        plain = pendulum_rig.record(pendulum_rig.Swing(), "run", 0)
        moved = plain.columns["joint/position"] - run.columns["joint/position"]
        assert_allclose(moved, offset, rtol=0.05)


@pytest.mark.parametrize(("constant", "named"), [(-0.08, False)])
def test_the_zero_of_a_current(constant, named):
    """50 mN m at 0.4 A/(N m) are 20 mA, the tolerance; while the joint slides, such a constant is like a friction."""
    without = pendulum({}, constant=constant)
    assert without.effects  # without a tolerance it is an effect
    said = [note for note in without.notes if isinstance(note, ZeroOfEffort)]
    assert len(said) == (0 if named else 1)  # beyond 3 % of the largest current it is no data sheet's
    assert_allclose([note.offset for note in said], 0.4 * abs(constant), rtol=0.05)
    result = pendulum({"current": {"bias": "20 mA"}}, constant=constant)
    assert bool(result.effects) == named
    assert holds(result, "coulomb", "coulomb", 0.4) and holds(result, "viscous", "viscous", 0.2)
    if named:
        assert {e.id for e in result.effects} <= {"effort_bias", "asymmetric_friction"}
    else:  # the free runs are given the current without the error
        assert result.after.heldout < 1.1 * result.noise_floor
        swing = pendulum_rig.Swing(constant=constant)
        swung = [pendulum_rig.record(swing, "run", 0)]
        (run,) = without_errors(swung, swing_rig(swing, {}), "joint", result.final)
        moved = swung[0].columns["joint/current"] - run.columns["joint/current"]
        assert_allclose(moved, swing.gain * constant, rtol=0.05)


def test_joints_have_tolerances_of_their_own(monkeypatch):
    only(monkeypatch, "torque_sensor_bias", "stribeck")
    joint = replace(JOINT, sensor=sensor(0.25))
    sensors = {"torque": {"bias": "5 mN*m"}, "hip": {"torque": {"bias": "0.2 N*m"}}}
    document = {"joints": ["hip", "knee"], "drive": "current", "declared": {"rotor_inertia": 0.3}}
    rig = parse_rig({**document, "sensors": sensors})
    found = {}
    for label in rig.joints:
        own = [record(joint, name, 0.9 * k, k, label) for k, name in enumerate(("one", "two", "held"))]
        found[label] = [e.id for e in diagnose_joint(own[:2], own[2:], rig, label, QUICK).effects]
    assert found == {"hip": [], "knee": ["torque_sensor_bias"]}


def test_free_runs_are_given_the_torque_without_the_error(monkeypatch, tmp_path):
    """4 N m of bias at 500 N m/rad is 8 mrad of position, which the free runs of both models must not show."""
    only(monkeypatch, "torque_sensor_bias", "stribeck")
    joint = servo(torque_noise=0.1, encoder_step=1e-5, duration=12.0, sensor=sensor(4.0))
    logs = write_logs(tmp_path, joint, rig={"sensors": {"torque": {"bias": "3 N*m"}}})
    result = close_loop(logs.rig, logs.train, logs.held, QUICK, rig_free_run).joints["joint"]
    assert result.effects == ()
    assert max(result.before.free_run_heldout, result.after.free_run_heldout) < 1e-3


RIGS = 40


def test_intervals_of_friction_hold_the_truth_of_rigs_with_errors_within_tolerance():
    """Every other rig knows its rotor inertia, which tells the sensor's scale; the others know its tolerance alone."""
    inside: list[bool] = []
    plain: list[bool] = []
    for seed in range(RIGS):
        rng = np.random.default_rng([seed, 7])
        joint = replace(JOINT, duration=8.0, inertia=0.3 * (seed % 2), viscous=rng.uniform(4.0, 8.0))
        joint = replace(joint, sensor=sensor(*(np.array([0.2, 0.01]) * rng.standard_normal(2))))
        truth = {"friction": {"joint": {"viscous": joint.viscous, "coulomb": joint.coulomb}}}
        runs = [record(joint, name, 0.9 * k, 10 * seed + k) for k, name in enumerate(("one", "two", "held"))]
        for held, sensors in ((inside, TOLERANCE), (plain, {})):
            prepared = prepare_joint(runs[:2], runs[2:], rig_of(joint, sensors), "joint")
            found = parameters_of(prepared.train, fit(prepared.train, prepared.terms), joint.drive)
            entries = {k: {n: {"ci95": list(e.ci95)} for n, e in group.items()} for k, group in found.items()}
            held += friction_intervals(truth, {"final_parameters": {"joint": entries}})
    assert len(inside) == 2 * RIGS
    assert 0.90 <= np.mean(inside) <= 0.99
    assert np.mean(plain) < 0.75  # without the tolerances the biases are in the friction
