"""The whole loop of Faraji et al. (2015): estimator, controller, torque control, springs, soft soles."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from sweeps import slow_but

from drake_tc.errors import ParamsError
from drake_tc.loops.scenarios import scenario_names
from drake_tc.loops.whole_body.ground import touching_points
from drake_tc.loops.whole_body.references import SpanSpec
from drake_tc.loops.whole_body.running import build_tsid, simulate_tsid
from drake_tc.loops.whole_body.scenario import BaseEstimationSpec, SpringDrivesSpec, TsidScenario
from drake_tc.loops.whole_body.sensors import WholeBodyBuilder, estimator_spec
from drake_tc.tsid.law import Status

FILE = Path(__file__).resolve().parents[2] / "diagrams" / "coman.scenario.yaml"
BASE = slice(4, 7)


def scenario(name, text=None):
    return TsidScenario.load(FILE, name, text)


def base_errors(recording, since=0.3):
    """Root mean squares of the base's position [m], and of its velocity without the angular one [m/s]."""
    late, nq = recording.time > since, recording.law.model.nq
    wrong = (recording["estimated_state"] - recording["state"])[late]
    return np.sqrt((wrong[:, BASE] ** 2).mean()), np.sqrt((wrong[:, nq + 3 : nq + 6] ** 2).mean())


@pytest.mark.parametrize("name", slow_but(scenario_names(FILE), "turn_half_hz", "pushed_held"))
def test_every_committed_scenario_runs_and_stays_finite(name):
    recording = simulate_tsid(scenario(name, "{duration: 0.03}"))
    assert recording.time.size == 31
    assert all(np.isfinite(values).all() for values in recording.signals.values())
    assert recording.fell is None
    assert recording.status(Status.FALLBACK).max() == 0.0


@pytest.fixture(scope="module")
def stood():
    return simulate_tsid(scenario("stand", "{duration: 0.8}"))


def test_it_stands_on_its_own_estimate_and_springs(stood):
    """15 ms of delay, noisy sensors, dry friction of 2 to 3 N m, soles that give way."""
    late = stood.time > 0.4
    joints = stood["state"][late, -stood.law.model.n :]
    assert stood.fell is None
    assert np.abs(joints).max() < 0.15
    assert np.ptp(stood["state"][late, BASE], axis=0).max() < 5e-3
    wrong = (stood["torque"] - stood["applied_torque"])[late]
    assert np.sqrt((wrong**2).mean()) < 0.6
    assert np.abs(stood["applied_torque"][late]).max() > 8.0  # knees and ankles carry


def test_the_estimate_is_the_plants_own_state(stood):
    position, velocity = base_errors(stood)
    assert position < 2e-3
    assert velocity < 5e-3
    assert np.abs(stood["estimated_state"] - stood["state"]).max() > 1e-5  # an estimate, not a wire


def test_the_centre_of_pressure_is_the_plants(stood):
    """Its moment about the world's origin is that of the contacts' true forces on the floating base, at rest."""
    late = stood.time > 0.6
    model = stood.law.model
    force = stood["contact"][late][:, :6].mean(axis=0)  # [moment about the base; force], in the world
    base = stood["state"][late, BASE].mean(axis=0)
    x = base[0] - (force[1] + base[2] * force[3]) / force[5]
    scratch, found = model.create_scratch(), []
    for row, cop in zip(stood["state"][late][::20], stood["cop"][late][::20], strict=True):
        terms = model.terms(scratch, row[: model.nq], row[model.nq :])
        for i, contact in enumerate(model.contacts):
            rotation, place = terms.pose(contact.name)
            found.append((place + rotation @ [*cop[2 * i : 2 * i + 2], 0.0])[0])
    assert_allclose(np.mean(found), x, atol=5e-3)  # F/T bias: 0.03 N m and 0.6 N over a load of 150 N


def test_springs_are_wound_and_motors_under_voltage_from_the_start():
    loop = build_tsid(scenario("stand"))
    simulator = Simulator(loop.diagram)
    context = simulator.get_mutable_context()
    loop.start(context)
    simulator.Initialize()
    actuators, control = (loop.diagram.GetSubsystemByName(name) for name in ("actuators", "torque_control"))
    mine = actuators.GetMyContextFromRoot(context)
    torque = control.GetInputPort("reference_torque").Eval(control.GetMyContextFromRoot(context))
    assert np.abs(torque).max() > 5.0
    assert_allclose(actuators.GetOutputPort("transmitted_torque").Eval(mine), torque, atol=0.3)
    assert_allclose(actuators.GetInputPort("command").Eval(mine), 0.15 * torque, atol=0.01)


def test_another_estimator_watches_and_moves_nothing():
    alone, watched = (
        simulate_tsid(scenario("stand", f"{{duration: 0.1, estimator: {{beside: {beside}}}}}"))
        for beside in ("null", "foot_centre")
    )
    assert_allclose(watched["state"], alone["state"], rtol=0.0, atol=0.0)
    assert "beside_state" not in alone.signals
    assert 1e-5 < np.abs(watched["beside_state"] - watched["estimated_state"])[:, BASE].max() < 0.01


def test_a_contact_that_is_lifted_is_held_off():
    lifted = {"right_sole": (SpanSpec(0.0),)}
    loop = build_tsid(replace(scenario("stand"), lifted=lifted))
    context = loop.diagram.CreateDefaultContext()
    estimator = loop.diagram.GetSubsystemByName("base_estimator")
    switch = estimator.GetInputPort("contact_switch").Eval(estimator.GetMyContextFromRoot(context))
    assert_allclose(switch, [-1.0, 0.0])


def test_the_estimators_soles_are_those_that_touch():
    given = scenario("stand")
    loop = build_tsid(given)
    spec = estimator_spec(WholeBodyBuilder(DiagramBuilder(), given, loop.plant, loop.period, law=loop.law))
    for contact, mine in zip(loop.law.model.contacts, spec.contacts, strict=True):
        points = touching_points(contact, given.ground)[:, :2]
        corners = np.array(mine.polygon)
        assert_allclose([corners.min(axis=0), corners.max(axis=0)], [points.min(axis=0), points.max(axis=0)])
        assert mine.mount.link == contact.frame.link
    assert [contact.sensor for contact in spec.contacts] == ["right_ankle", "left_ankle"]
    assert spec.imu_age == loop.law.period  # a tick late, as `add_whole_body_sensors` has it


def test_the_estimator_is_told_what_the_maker_knows():
    late = "{preset: realistic, gyro: {latency: 0.003}, accel: {latency: 0.003}}"
    given = scenario("stand", f"{{sensors: {late}, estimator: {{sole_stiffness: 2.0e+5}}}}")
    loop = build_tsid(given)
    spec = estimator_spec(WholeBodyBuilder(DiagramBuilder(), given, loop.plant, loop.period, law=loop.law))
    assert spec.imu_age == 0.003
    assert [contact.sole_stiffness for contact in spec.contacts] == [2e5, 2e5]
    assert [contact.sole_points for contact in spec.contacts] == [given.ground.sole.points] * 2


TUNING = "{still_rate: 0.05, ground: level, quick_start: true, yaw_time: 1.0}"
KNOWING = f"estimator: {{beside: foot_centre, sole_stiffness: 1.0e+5, tuning: {TUNING}}}"


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.8, 0.3])
def test_a_turn_on_feet_that_tilt_and_on_feet_that_slip(friction):
    """0.5 Hz; at a friction of 0.3 one foot turns by 34 mrad in three slips. Ours and the chain in the same run.

    A slip of a foot about another point than its centre of pressure is taken for yaw, 6 mrad of it at the end.
    """
    ground = f"ground: {{friction: {friction}, sole: {{stiffness: 1.0e+5}}}}"
    recording = simulate_tsid(scenario("turn_half_hz", f"{{{ground}, {KNOWING}}}"))
    late, nq = recording.time[1:] > 0.5, recording.law.model.nq
    true = recording["state"][:-1][late]
    found = {name: recording[name][1:][late] - true for name in ("estimated_state", "beside_state")}
    assert recording.fell is None
    for part in (slice(4, 7), slice(nq + 3, nq + 6)):
        ours, chain = (np.sqrt((wrong[:, part] ** 2).sum(axis=1).mean()) for wrong in found.values())
        assert ours < 0.2 * chain
    w, x, y, z = recording["estimated_state"][1:][late][:, :4].T
    a, b, c, d = true[:, :4].T  # of any length: a discrete plant's quaternion grows
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    truth = np.arctan2(2.0 * (a * d + b * c), a * a + b * b - c * c - d * d)
    wrong = np.sqrt((np.remainder(yaw - truth + np.pi, 2.0 * np.pi) - np.pi) ** 2)
    assert wrong.max() < (1.5e-3 if friction > 0.5 else 8e-3)


@pytest.mark.slow
def test_the_default_does_not_learn_slow_rocking_for_a_bias():
    """Four seconds of standing with the default `still_rate`: the estimate's tilt stays that of the plant."""
    recording = simulate_tsid(scenario("stand", "{duration: 4.0, estimator: {tuning: {still_rate: 0.05}}}"))
    last = [recording[name][-1, :4] for name in ("state", "estimated_state")]
    true, found = (quaternion / np.linalg.norm(quaternion) for quaternion in last)
    assert recording.fell is None
    assert 2.0 * np.sqrt(max(0.0, 1.0 - float(true @ found) ** 2)) < 6e-3


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: BaseEstimationSpec(method="guess"), "estimator.method: expected one of cop, foot_centre, .*'guess'"),
        (
            lambda: BaseEstimationSpec(tuning={"period": 0.01}),
            "estimator.tuning.period: expected fields that are a matter",
        ),
        (
            lambda: BaseEstimationSpec(tuning={"quick_start": 1}),
            "estimator.tuning.quick_start: expected true or false, got 1",
        ),
        (lambda: BaseEstimationSpec(tuning={"yaw_time": True}), "estimator.tuning.yaw_time: expected a number"),
        (
            lambda: scenario("stand", "{faults: {contacts: [{kind: nan}]}}"),
            "faults.contacts: expected `lifted` beside it",
        ),
        (
            lambda: scenario("genuflection", "{series_elastic: {position_gain: 5800.0}}"),
            "series_elastic.position_gain: expected neither motion nor lifted",
        ),
        (lambda: BaseEstimationSpec(make=0.01), "expected 0 < break_ <= make < 1, got break_ 0.02, make 0.01"),
        (
            lambda: BaseEstimationSpec(sole_points=(5, 3, 2)),
            "sole_points: expected two numbers, got .5, 3, 2.",
        ),
        (lambda: BaseEstimationSpec(velocity_window=3), "velocity_window: expected a number >= 4 .samples., got 3"),
        (lambda: SpringDrivesSpec(link_from="air"), "link_from: expected one of motor, link, got 'air'"),
        (lambda: SpringDrivesSpec(delay=-1.0), "delay: expected a number >= 0"),
        (
            lambda: SpringDrivesSpec(model_factors={"gain": -1.0}),
            "series_elastic.model_factors.gain: expected a factor >= 0",
        ),
        (
            lambda: TsidScenario("x.yaml", estimator=BaseEstimationSpec("foot_centre")),
            "estimator: expected state: base_estimator beside it; with state: plant there are none",
        ),
        (
            lambda: TsidScenario("x.yaml", series_elastic=SpringDrivesSpec(delay=0.0)),
            "series_elastic: expected torque: series_elastic beside it; with torque: direct there are none",
        ),
        (
            lambda: TsidScenario("x.yaml", torque="series_elastic", sensors="perfect"),
            "sensors: expected state: estimated or torque: drives beside it; with neither nothing is sensed",
        ),
        (
            lambda: build_tsid(scenario("stand", "{series_elastic: {delay: 0.0005}}")),
            "series_elastic.delay: expected a multiple of the period 0.001 s, got 0.0005 s",
        ),
        (
            lambda: build_tsid(scenario("stand", "{series_elastic: {model_factors: {ripple: 1.0}}}")),
            "series_elastic.model_factors: the models have no 'ripple'; possible: coulomb, elasticity, gain",
        ),
        (lambda: build_tsid(scenario("stand", "{estimator: {tuning: {guess: 1.0}}}")), "estimator.tuning: .*'guess'"),
    ],
)
def test_what_is_refused(make, message):
    with pytest.raises(ParamsError, match=message):
        make()
