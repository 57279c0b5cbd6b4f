"""Faraji et al. (2015)'s whole loop with sensors that fail: what the reproduction makes of runs, and some runs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pydrake.polynomial import Polynomial
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drake_tc.control.guard import LOSS_TIME, SensorLossStop
from drake_tc.control.reference_source import STOP_TIME, StoppingReference
from drake_tc.diagrams.papers.faraji2015 import faults as coman_faults
from drake_tc.diagrams.papers.faraji2015.fault_cases import STARTS, cases
from drake_tc.diagrams.papers.faraji2015.faults import FaultOutcome, outcome, reproduction, scenario_of
from drake_tc.loops.whole_body.running import simulate_tsid
from drake_tc.loops.whole_body.scenario import FALLIBLE, TsidScenario
from drake_tc.sensing.spec import SensorFault
from drake_tc.sensor_validation.standing_feet import LOST
from drake_tc.tsid.configuration import load_law

FILE = Path(__file__).resolve().parents[4] / "diagrams" / "coman.scenario.yaml"
DT = 1e-3
GOOD = FaultOutcome(None, 0.01, "imu/frozen", (), 0.001, 0.02, 0.4, 0.5, 0, True)


@pytest.fixture(scope="module")
def lost():
    """A run in which every sensor is lost from 10 ms on."""
    nan = (SensorFault("nan", 0.01),)
    scenario = TsidScenario.load(FILE, "stand", "{duration: 0.03}")
    return simulate_tsid(scenario.changed(faults={name: nan for name in FALLIBLE if name != "contacts"}))


def test_every_case_can_be_run_and_names_flags_that_there_are(lost):
    names, scenarios = lost.flag_names, {name: scenario_of(name, 0) for name in STARTS}
    for case in cases():
        assert set(case.faults) <= set(FALLIBLE)
        assert any(name.startswith(case.groups) for name in names), case.label
        scenario = scenarios[case.scenario].changed(faults=case.faults)
        assert scenario.duration == pytest.approx(STARTS[case.scenario] + 2.0)
    labels = [case.label for case in cases()]
    assert len(set(labels)) == len(labels)


def test_rows_count_what_fell_and_what_was_flagged():
    found = [GOOD] * len(cases())
    sinks = next(i for i, case in enumerate(cases()) if case.sinks)
    first, second = [i for i in range(len(found)) if i != sinks][:2]
    found[sinks] = replace(GOOD, fell=2.0, torque=0.7, base=9.0)
    found[first] = replace(GOOD, fell=1.0, torque=9.0, flagged=0.06)
    found[second] = replace(GOOD, finite=False, desired=1.01)
    rows = {row.name: row for row in reproduction(found, {"stand": ("imu/jump",), "turn_1hz": ()}).rows}
    assert rows["cases that fell"].value == 1.0
    assert rows["cases flagged within 50 ms"].value == len(found) - 1
    assert rows["cases with anything that is not finite"].value == 1.0
    assert rows["flags up in runs without a fault"].value == 1.0
    assert rows["largest torque of a robot that stands, over its limit"].value == 0.5
    assert rows["largest torque of one that sinks, over its limit"].value == 0.7
    assert rows["largest distance of the base, standing [m]"].value == 0.001
    assert rows["largest commanded torque, over its limit"].met is False


def test_a_motion_that_stops_keeps_to_its_path_and_its_rates_are_those_of_its_places():
    """A path of our own, p = t^3; the rates against central differences of what is given."""
    orders = [Polynomial(np.array(c)) for c in ([0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 3.0], [0.0, 6.0])]
    path = PiecewisePolynomial([np.array([[orders[row // 3]] for row in range(9)])], [0.0, 5.0])
    system = StoppingReference(TrajectorySource(path), DT)
    context = system.CreateDefaultContext()
    port, stop = system.GetOutputPort("reference"), system.GetInputPort("stop")

    def at(instant):
        context.SetTime(instant)
        return port.Eval(context).copy()

    stop.FixValue(context, [0.0])
    context.SetTime(1.0)
    context.SetDiscreteState(np.array(system.EvalUniquePeriodicDiscreteUpdate(context).value()))
    assert_allclose(at(1.3)[[0, 3, 6]], [1.3**3, 3 * 1.3**2, 6 * 1.3], rtol=1e-9)
    stop.FixValue(context, [1.0])
    context.SetTime(1.0)
    context.SetDiscreteState(np.array(system.EvalUniquePeriodicDiscreteUpdate(context).value()))
    stop.FixValue(context, [0.0])  # for good
    context.SetDiscreteState(np.array(system.EvalUniquePeriodicDiscreteUpdate(context).value()))
    h = 1e-5
    for instant in (1.05, 1.2, 1.0 + STOP_TIME - 1e-3):
        before, now, after = at(instant - h), at(instant), at(instant + h)
        assert_allclose(now[3:6], (after[:3] - before[:3]) / (2.0 * h), rtol=1e-6, atol=1e-9)
        assert_allclose(now[6:], (after[3:6] - before[3:6]) / (2.0 * h), rtol=1e-6, atol=1e-6)
    rest = at(3.0)
    assert_allclose(rest[:3], (1.0 + 0.5 * STOP_TIME) ** 3, rtol=1e-12)
    assert_array_equal(rest[3:], np.zeros(6))


def test_torques_fade_once_a_joint_is_lost_for_good():
    system = SensorLossStop(3, np.array([True, False]), 0.1, DT)
    context = system.CreateDefaultContext()
    system.GetInputPort("state").FixValue(context, [1.0, 2.0, 3.0])
    system.GetInputPort("torque").FixValue(context, [4.0, -2.0])
    system.GetInputPort("desired").FixValue(context, [3.0, 5.0])
    lost = system.GetInputPort("lost")

    def ticks(count, value):
        lost.FixValue(context, [value, 0.0])
        for _ in range(count):
            context.SetDiscreteState(np.array(system.EvalUniquePeriodicDiscreteUpdate(context).value()))
        return [system.GetOutputPort(name).Eval(context) for name in ("state", "torque")]

    for count, value in ((round(LOSS_TIME / DT) - 1, 1.0), (1, 0.0), (round(LOSS_TIME / DT) - 1, 1.0)):
        state, torque = ticks(count, value)
        assert_array_equal(state, [1.0, 2.0, 3.0])
        assert_array_equal(torque, [4.0, -2.0])
    state, torque = ticks(1 + 100, 1.0)
    assert np.isnan(state).all()
    assert_allclose(torque, np.array([4.0, -2.0]) / np.e, rtol=1e-9)
    state, torque = ticks(100, 0.0)  # for good
    assert np.isnan(state).all()
    assert_allclose(torque, np.array([4.0, -2.0]) / np.e**2, rtol=1e-9)


def test_a_lost_joint_that_nothing_stands_on_fades_alone():
    system = SensorLossStop(3, np.array([True, False]), 0.1, DT)
    context = system.CreateDefaultContext()
    for name, value in (("state", [1.0, 2.0, 3.0]), ("torque", [4.0, -2.0]), ("desired", [3.0, 5.0])):
        system.GetInputPort(name).FixValue(context, value)
    system.GetInputPort("lost").FixValue(context, [0.0, 1.0])
    for _ in range(round(LOSS_TIME / DT) + 100):
        context.SetDiscreteState(np.array(system.EvalUniquePeriodicDiscreteUpdate(context).value()))
    state, torque, desired = (system.GetOutputPort(name).Eval(context) for name in ("state", "torque", "desired"))
    assert_array_equal(state, [1.0, 2.0, 3.0])
    assert_allclose(torque, [4.0, -2.0 / np.e], rtol=1e-9)
    assert_allclose(desired, [3.0, 5.0 / np.e], rtol=1e-9)


def test_all_sensors_lost_at_once_leave_finite_numbers(lost):
    assert all(np.isfinite(values).all() for values in lost.signals.values())
    assert np.abs(lost["torque"]).max() < 50.0
    assert lost.raised_flags() == []  # before flags are looked at


@pytest.fixture(scope="module")
def sound():
    return simulate_tsid(TsidScenario.load(FILE, "stand", "{duration: 0.9}"))


@pytest.mark.slow
def test_no_flag_is_up_and_no_reading_replaced_while_nothing_is_wrong(sound):
    assert sound.raised_flags() == []
    assert len(sound.flag_names) == sound["flags"].shape[1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "fault", "flag", "late"),
    [
        ("gauge", SensorFault("dropped", 0.6), "gauge/missing", 0.002),
        ("motor_encoder", SensorFault("spikes", 0.6, value=0.05), "motor_encoder/odd", 0.01),
        ("imu", SensorFault("frozen", 0.6), "imu/frozen", 0.012),
        ("force_torque", SensorFault("nan", 0.6, channels=(7,)), "left_ankle/missing", 0.002),
    ],
)
def test_a_fault_is_flagged_by_its_name_and_the_robot_stands_as_it_did(sound, name, fault, flag, late):
    scenario = TsidScenario.load(FILE, "stand", "{duration: 0.9}")
    recording = simulate_tsid(scenario.changed(faults={name: (fault,)}))
    first = {item["name"]: item["first"] for item in recording.raised_flags()}
    assert 0.6 < first[flag] <= 0.6 + late
    assert recording.fell is None
    case = replace(cases()[0], scenario="stand", faults={name: (fault,)}, groups=(flag,))
    found = outcome(case, recording, sound["state"])
    assert found.flagged == pytest.approx(first[flag] - 0.6)
    assert found.finite and found.early == ()
    assert found.base < 3e-3
    assert found.joint < 0.02
    assert max(found.desired, found.torque) < 0.5


@pytest.mark.slow
def test_an_elbow_that_is_lost_hangs_and_the_robot_stands_on():
    scenario = TsidScenario.load(FILE, "stand", "{duration: 1.6}")
    joints = load_law(scenario.path(scenario.controller), scenario.changes).model.robot.joints
    elbow = joints.index("r_elbow")
    gone = (SensorFault("dropped", 0.6, channels=(elbow,)),)
    recording = simulate_tsid(scenario.changed(faults={"motor_encoder": gone, "encoder": gone}))
    assert recording.fell is None and "joint/lost" in [item["name"] for item in recording.raised_flags()]
    assert all(np.isfinite(values).all() for values in recording.signals.values())
    late, before = recording.time > 1.4, (recording.time > 0.4) & (recording.time < 0.6)
    legs = [i for i, name in enumerate(joints) if "knee" in name or "hip_pitch" in name]
    held = np.abs(recording["applied_torque"][:, legs])
    assert_allclose(held[late].mean(axis=0), held[before].mean(axis=0), rtol=0.2, atol=1.0)
    places = recording["state"][:, 4:7]
    assert np.linalg.norm(places[late] - places[before].mean(axis=0), axis=1).max() < 0.02


@pytest.mark.slow
def test_a_foot_that_jumps_by_150_n_stays_left_out():
    scenario = TsidScenario.load(FILE, "stand", "{duration: 1.2}")
    fault = SensorFault("biased", 0.6, channels=(2,), value=150.0)
    recording = simulate_tsid(scenario.changed(faults={"force_torque": (fault,)}))
    first = {item["name"]: item["first"] for item in recording.raised_flags()}
    assert 0.6 < first["right_ankle/jump"] <= 0.602
    assert recording.fell is None
    sound = simulate_tsid(scenario)
    places = slice(4, 7)
    assert np.linalg.norm(recording["state"][:, places] - sound["state"][:, places], axis=1).max() < 2e-3


@pytest.mark.slow
def test_a_motion_stops_when_the_imu_is_lost_and_not_for_a_gap():
    def speed(faults):
        scenario = TsidScenario.load(FILE, "turn_1hz", "{duration: 1.45}").changed(faults={"imu": faults})
        recording = simulate_tsid(scenario)
        late = recording.time > 1.05 + LOST + STOP_TIME
        about_vertical = recording.law.model.nq + 2  # of the pelvis
        return np.abs(recording["state"][late][:, about_vertical]).max()

    assert speed((SensorFault("dropped", 1.0),)) < 1.0
    assert speed((SensorFault("dropped", 1.0, 0.02),)) > 1.0


def test_the_reproduction_goes_through_any_executor(monkeypatch):
    monkeypatch.setattr(coman_faults, "undisturbed", lambda trial, _: (np.zeros((2, 3)), ()))
    monkeypatch.setattr(coman_faults, "watched", lambda trial, _: GOOD)
    monkeypatch.setattr(coman_faults, "sweep", lambda function, points, **_: [function(point, 0) for point in points])
    result = coman_faults.faults(3, None, executor=object())
    assert result.id == "C.faults"
    assert len(result.tables[0].rows) == len(cases())
