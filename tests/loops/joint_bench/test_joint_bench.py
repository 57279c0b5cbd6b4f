"""The joint bench: scenarios, simulate and identify back, free runs."""

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose
from sweeps import slow_but

from drake_tc.actuation.free_run import model_to_simulate
from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.recorded_run import Link, Recording
from drake_tc.diagrams.joint_bench import SCENARIO_FILE, main
from drake_tc.effects.base import plain_signals
from drake_tc.effects.library import effect
from drake_tc.errors import ParamsError
from drake_tc.loops.joint_bench import BenchScenario, Table, free_run, quantise, record_bench

GAIN = 0.5
BASE = (
    EffectValue("rotor_inertia", {"rotor_inertia": 0.1}),
    EffectValue("viscous", {"viscous": 0.8}),
    EffectValue("coulomb", {"coulomb": 0.9}),
)
EXTRAS = {
    "none": None,
    "stribeck": EffectValue("stribeck", {"stribeck": 0.7, "stribeck_velocity": 0.3, "stribeck_exponent": 2.0}),
    "quadratic_viscous": EffectValue("quadratic_viscous", {"quadratic_viscous": 0.15}),
    "load_dependent_friction": EffectValue("load_dependent_friction", {"load_friction": 0.12}),
    "asymmetric_friction": EffectValue("asymmetric_friction", {"coulomb_asymmetry": -0.3, "viscous_asymmetry": 0.1}),
    "torque_ripple": EffectValue("torque_ripple", {"ripple_cosine": 0.3, "ripple_sine": -0.2, "cycles_per_turn": 12.0}),
    "presliding_hysteresis": EffectValue("presliding_hysteresis", {"presliding": 0.6, "presliding_travel": 0.02}),
    "cable_spring": EffectValue("cable_spring", {"spring_stiffness": 0.5, "spring_preload": 0.2}),
    "payload": EffectValue("payload", {"payload_moment": 0.6, "payload_inertia": 0.03}),
    "thermal_friction": EffectValue(
        "thermal_friction", {"coulomb_per_kelvin": 0.02, "viscous_per_kelvin": -0.01, "thermal_rate": 0.01}
    ),
    "torque_sensor_bias": EffectValue("torque_sensor_bias", {"bias": 0.4}),
    "torque_sensor_drift": EffectValue("torque_sensor_drift", {"drift": 0.05}),
}
SCENARIO = BenchScenario(duration=6.0, log_period=1e-3, step=5e-4, link_inertia=0.08, gravity_moment=3.0)


def model_with(extra):
    return ActuatorModel("joint", Drive("current", GAIN), BASE if extra is None else (*BASE, extra))


def swing(scenario=SCENARIO):
    time = np.arange(round(scenario.duration / scenario.log_period) + 1) * scenario.log_period
    current = GAIN * (3.0 * np.sin(2 * np.pi * 0.8 * time) + 2.0 * np.sin(2 * np.pi * 0.37 * time))
    return Table(time, current, temperature=25.0 + 4.0 * time)


@pytest.mark.parametrize("name", slow_but(EXTRAS, "none", "payload", "presliding_hysteresis", "torque_sensor_drift"))
def test_simulate_then_identify_back_by_plain_least_squares(name):
    extra = EXTRAS[name]
    run = record_bench(model_with(extra), swing(), SCENARIO)
    q, tau, current = (run.columns[f"joint/{c}"] for c in ("position", "torque", "current"))
    v = np.gradient(q, run.time)
    a = np.gradient(v, run.time)
    direction = np.sign(v)
    turns = np.flatnonzero(np.diff(direction)) + 1
    last = np.zeros(q.size, int)
    last[turns] = turns
    travel = np.abs(q - q[np.maximum.accumulate(last)])
    known = {"time": run.time, "position": q, "velocity": v, "acceleration": a, "load_torque": tau, "travel": travel}
    signals = plain_signals(q.size, known | {"direction": direction, "temperature": run.columns["joint/temperature"]})
    columns = [a[:, None], v[:, None], direction[:, None]]
    truth = [0.1, 0.8, 0.9]
    if extra is not None:
        own = extra.effect
        columns.append(own.columns(signals, {p.name: extra.parameters[p.name] for p in own.shapes}))
        truth += [extra.parameters[p.name] for p in own.coefficients]
    phi = np.hstack(columns)  # the first swing starts from rest, where presliding has no history: left out below
    if name == "payload":  # its inertia is the rotor's: only their sum can be seen
        phi, truth = phi[:, :4], [0.1 + 0.03, 0.8, 0.9, 0.6]
    resolved = (np.abs(v) > 0.05) & (run.time > turns[1] * 1e-3) & (run.time < 5.99)
    theta = np.linalg.lstsq(phi[resolved], (current / GAIN - tau)[resolved], rcond=None)[0]
    # noise-free record; the step (0.5 ms of 9 N m/s) and the bristle near reversals leave well under 2 % and 0.01 N m
    assert_allclose(theta, truth, rtol=0.02, atol=0.01)


@pytest.mark.parametrize(
    ("kind", "load"), [("position_servo", "torque"), ("current", "pendulum"), ("voltage", "torque")]
)
def test_free_run_with_the_true_model_repeats_the_record(kind, load):
    model = ActuatorModel("joint", Drive(kind, 0.01 if kind == "position_servo" else GAIN), BASE)
    scenario = BenchScenario(duration=3.0, step=1e-3, log_period=1e-3, link_inertia=0.08, gravity_moment=3.0)
    table = swing(scenario)
    run = record_bench(model_to_simulate(model, scenario.step), table, scenario)
    q = run.columns["joint/position"]
    given = {"load_torque": run.columns["joint/torque"]} if load == "torque" else {"pendulum": Link(0.08, 3.0)}
    again = free_run(model, Recording(run.time, table.command, q[0], 0.0, (q.min(), q.max()), **given))
    # same step: exact with the pendulum; a recorded load enters one half-step apart
    assert_allclose(again, q, atol=1e-12 if load == "pendulum" else 2e-3 * np.ptp(q))


def test_free_run_takes_sensor_errors_off_the_load_and_puts_them_on_the_position():
    errors = (EffectValue("torque_sensor_bias", {"bias": 0.7}), EffectValue("encoder_offset", {"offset": 0.2}))
    model = ActuatorModel("joint", Drive("position_servo", 0.01), (*BASE, *errors))
    scenario = BenchScenario(duration=2.0, step=1e-3, log_period=1e-3, link_inertia=0.08, gravity_moment=3.0)
    table = swing(scenario)
    run = record_bench(model_to_simulate(model, scenario.step), table, scenario)
    q, tau = run.columns["joint/position"], run.columns["joint/torque"]
    again = free_run(model, Recording(run.time, table.command, q[0], 0.0, (q.min(), q.max()), load_torque=tau))
    assert_allclose(again, q, atol=1e-3)
    blind = ActuatorModel("joint", model.drive, BASE)
    off = free_run(blind, Recording(run.time, table.command, q[0], 0.0, (q.min(), q.max()), load_torque=tau))
    assert np.max(np.abs(off - q)) > 0.1


GEARS = [EffectValue("elasticity", {"compliance": 0.02}), EffectValue("backlash", {"backlash": 0.04})]


@pytest.mark.parametrize("value", GEARS, ids=lambda value: value.key)
def test_free_run_of_a_gear_on_a_recorded_load_follows_the_two_mass_record(value):
    model = ActuatorModel("joint", Drive("position_servo", 0.01), (*BASE, value))
    scenario = BenchScenario(duration=4.0, step=5e-4, log_period=1e-3, link_inertia=0.08, gravity_moment=6.0)
    time = np.arange(4001) * 1e-3
    table = Table(time, 0.8 + 0.4 * (1 - np.cos(2 * np.pi * 0.5 * time)))  # gravity keeps one side of the gear closed
    run = record_bench(model_to_simulate(model, scenario.step), table, scenario)
    q, tau = run.columns["joint/position"], run.columns["joint/torque"]
    recording = Recording(run.time, table.command, q[0], 0.0, (q.min(), q.max()), load_torque=tau)
    settled = slice(2000, None)
    assert_allclose(free_run(model, recording)[settled], q[settled], atol=4e-3)
    stiff = free_run(ActuatorModel("joint", model.drive, BASE), recording)
    assert np.max(np.abs(stiff - q)[settled]) > 0.015


def test_a_free_run_that_diverges_is_nan_from_there():
    model = ActuatorModel("joint", Drive("current", GAIN), BASE)
    time = np.arange(3001) * 1e-3
    record = Recording(time, np.full(3001, 50.0), 0.0, 0.0, (-0.1, 0.1), load_torque=np.zeros(3001))
    q = free_run(model, record)
    lost = np.flatnonzero(np.isnan(q))
    assert q.shape == (3001,)
    assert 0 < lost[0] < 1000
    assert lost.size == 3001 - lost[0]
    assert np.max(np.abs(q[: lost[0]])) <= 2.0


def test_substeps_refine_towards_one_answer():
    model = ActuatorModel("joint", Drive("position_servo", 0.02), BASE)
    time = np.arange(300) * 5e-3
    record = Recording(time, 0.4 * np.sin(2 * np.pi * time), 0.0, 0.0, (-0.4, 0.4), pendulum=Link(0.08, 3.0))
    runs = {n: free_run(model, record, substeps=n) for n in (1, 2, 4, 50)}
    errors = [np.max(np.abs(runs[n] - runs[50])) for n in (1, 2, 4)]
    assert errors[1] < 0.7 * errors[0]
    assert errors[2] < 0.7 * errors[1]


@pytest.mark.parametrize("rate_hz", [50, 200, 1000, 5000])
def test_the_log_rate_hardly_changes_the_answer(rate_hz):
    damped = (BASE[0], EffectValue("viscous", {"viscous": 20.0}), BASE[2])
    model = ActuatorModel("joint", Drive("position_servo", 1e-3), damped)
    time = np.arange(2 * rate_hz + 1) / rate_hz
    command = np.where(time < 1.0, 0.3, -0.2)
    record = Recording(time, command, 0.0, 0.0, (-0.3, 0.3), pendulum=Link(0.08, 3.0))
    q = free_run(model, record)
    assert q.shape == time.shape
    for at, wanted in ((0.98, 0.3), (1.98, -0.2)):  # settled: statics, within the friction band
        band = 1e-3 * (0.9 + 3.0 * abs(np.sin(wanted)))
        assert_allclose(q[round(at * rate_hz)], wanted, atol=band + 1e-4)


def test_same_seed_same_record_and_the_noise_is_as_declared():
    scenario = BenchScenario(
        duration=3.0, step=1e-3, log_period=1e-3, torque_noise=0.05, encoder_resolution=1e-3, seed=4
    )
    one, two = (record_bench(model_with(None), swing(scenario), scenario) for _ in range(2))
    for name, values in one.columns.items():
        assert_allclose(values, two.columns[name], atol=0)
    other = record_bench(model_with(None), swing(scenario), scenario, np.random.default_rng(5))
    noise = (one.columns["joint/torque"] - other.columns["joint/torque"])[1:] / np.sqrt(2)
    assert_allclose(np.std(noise), 0.05, rtol=0.08)  # 3000 samples: 3 sigma is 4 %
    steps = one.columns["joint/position"] / 1e-3
    assert_allclose(steps, np.round(steps), atol=1e-6)


def test_quantise_is_within_half_a_step():
    values = np.linspace(-1, 1, 1001)
    assert np.max(np.abs(quantise(values, 0.01) - values)) <= 0.005 + 1e-12
    assert_allclose(quantise(values, 0.0), values, atol=0)


@pytest.mark.parametrize("name", sorted(yaml.safe_load(SCENARIO_FILE.read_text())))
def test_every_committed_scenario_runs_and_stays_finite(name, tmp_path, capsys):
    shortened = yaml.safe_load(SCENARIO_FILE.read_text())
    shortened[name]["duration"] = 0.5
    (tmp_path / "s.yaml").write_text(yaml.safe_dump(shortened))
    out = tmp_path / "run.csv"
    assert main(["--scenario", name, "--scenario-file", str(tmp_path / "s.yaml"), "--out", str(out)]) == 0
    rows = np.genfromtxt(out, delimiter=",", names=True)
    assert rows.size == 501
    assert all(np.all(np.isfinite(rows[column])) for column in rows.dtype.names)


def test_refusals(tmp_path, capsys):
    assert main(["--scenario", "moon"]) == 2
    assert "pendulum, torque_rig" in capsys.readouterr().err
    with pytest.raises(ParamsError, match="over a whole number"):
        BenchScenario(step=3e-4)
    (tmp_path / "s.yaml").write_text("a: {durration: 1.0}")
    with pytest.raises(ParamsError, match="unknown key 'durration'; did you mean 'duration'"):
        BenchScenario.load(tmp_path / "s.yaml", "a")
    record = Recording(np.arange(5.0), np.zeros(5), 0.0, 0.0, (0.0, 1.0))
    with pytest.raises(ParamsError, match="load_torque or pendulum"):
        free_run(model_with(None), record)


def test_effects_are_found_under_their_key():
    assert effect("delay.command").form == "command"
