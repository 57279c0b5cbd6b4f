"""A rig that lacks nothing, simulated at 1 ms and at 0.1 ms: the step of the simulation is no missing effect."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.actuation.free_run import model_to_simulate, simulate, simulated_inertia
from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.recorded_run import Recording
from drake_tc.diagnosis.run import close_loop
from drake_tc.loops.joint_bench import BenchScenario, Table, free_run, record_bench
from drake_tc.loops.recording import write_log, write_rig

VISCOUS, ROTOR, LINK, GRAVITY, DURATION = 30.0, 0.3, 0.6, 12.0, 8.0


def model():
    effects = {"viscous": VISCOUS, "coulomb": 2.0, "rotor_inertia": ROTOR}
    values = tuple(EffectValue(key, {key: value}) for key, value in effects.items())
    return ActuatorModel("knee", Drive("current", 0.4), values)


def record(step, seed):
    rng = np.random.default_rng(seed)
    time = np.arange(round(DURATION / step) + 1) * step
    w, size = 2.0 * np.pi * np.array([0.2, 0.5, 1.1, 1.9]), np.array([0.5, 0.3, 0.12, 0.05])
    angle = np.outer(time, w) + rng.uniform(0.0, 2.0 * np.pi, 4)
    q, v, a = np.sin(angle) @ size, np.cos(angle) @ (size * w), -np.sin(angle) @ (size * w**2)
    torque = (LINK + ROTOR) * a + GRAVITY * np.sin(q) + VISCOUS * v + 2.0 * np.tanh(v / 0.01)
    command = 0.4 * torque * np.clip(time, 0.0, 1.0)
    rates = {"log_period": 1e-3, "step": step, "torque_noise": 0.02, "encoder_resolution": 1e-5}
    scenario = BenchScenario(DURATION, link_inertia=LINK, gravity_moment=GRAVITY, seed=seed, **rates)
    return record_bench(model(), Table(time, command), scenario)


@pytest.mark.slow
@pytest.mark.parametrize("step", [1e-3, 1e-4])
def test_nothing_is_named_on_a_simulated_rig_that_lacks_nothing(tmp_path, step):
    logs = []
    for seed in range(3):
        run = record(step, seed)
        logs.append(write_log({"time": run.time, **run.columns}, tmp_path / f"run_{seed}.csv"))
    declared = {"rotor_inertia": simulated_inertia(model(), step)}
    rig = write_rig(
        {"joint": "knee", "drive": "current", "load": "torque", "declared": declared}, tmp_path / "rig.yaml"
    )
    found = close_loop(rig, logs[:2], logs[2:]).joints["knee"]
    assert (found.verdict, found.effects) == ("no_missing_effect", ())


def test_the_log_of_a_simulation_shows_a_larger_inertia():
    """(J + f_v h/2) qddot + f_v qdot, of central differences, is what symplectic Euler with implicit friction obeys."""
    assert simulated_inertia(model(), 1e-3) == pytest.approx(ROTOR + 0.5e-3 * VISCOUS)
    h, j, q, v = 1e-3, ROTOR, 0.0, 0.4
    positions = [q]
    for n in range(50):
        v = (v + h / j * np.sin(0.1 * n)) / (1.0 + h / j * VISCOUS)
        q += h * v
        positions.append(q)
    x = np.array(positions)
    acceleration, velocity = np.diff(x, 2) / h**2, (x[2:] - x[:-2]) / (2.0 * h)
    shown = simulated_inertia(model(), h)
    assert_allclose(shown * acceleration + VISCOUS * velocity, np.sin(0.1 * np.arange(1, 50)), atol=1e-8)


def shown_inertia(simulated, step):
    """J of  i/K - tau = J qddot + f_v qdot + tau_C sign(qdot), by least squares on a log without noise."""
    time = np.arange(round(DURATION / step) + 1) * step
    command = 12.0 * np.sin(2.0 * np.pi * 0.5 * time) + 6.0 * np.sin(2.0 * np.pi * 1.3 * time)
    scenario = BenchScenario(DURATION, log_period=step, step=step, link_inertia=LINK, gravity_moment=GRAVITY)
    columns = record_bench(simulated, Table(time, command), scenario).columns
    q = columns["knee/position"]
    v, a = (q[2:] - q[:-2]) / (2.0 * step), np.diff(q, 2) / step**2
    needed = (columns["knee/current"] / simulated.drive.gain - columns["knee/torque"])[1:-1]
    steady = np.abs(v) > 0.05  # nothing turns over within a step
    parts = np.stack([a, v, np.sign(v)], axis=-1)[steady]
    return np.linalg.lstsq(parts, needed[steady], rcond=None)[0][0]


def test_a_model_made_for_its_step_shows_its_own_inertia():
    step = 1e-3
    assert shown_inertia(model(), step) == pytest.approx(ROTOR + 0.5 * step * VISCOUS, rel=2e-3)
    assert shown_inertia(model_to_simulate(model(), step), step) == pytest.approx(ROTOR, rel=2e-3)


@pytest.mark.parametrize(
    "key, carried",
    [("payload", {"payload_moment": 0.0, "payload_inertia": 0.2}), ("unknown_load.pendulum", {"inertia": 0.2})],
)
def test_the_inertia_of_a_payload_or_of_an_unknown_load_counts_once(key, carried):
    loaded = ActuatorModel("knee", Drive("current", 0.4), (*model().effects, EffectValue(key, carried)))
    excess = 0.5e-3 * VISCOUS
    assert model_to_simulate(loaded, 1e-3).inertia == pytest.approx(ROTOR + 0.2 - excess)
    alone = tuple(value for value in loaded.effects if value.key != "rotor_inertia")
    assert model_to_simulate(replace(loaded, effects=alone), 1e-3).inertia == pytest.approx(0.2 - excess)


def test_a_step_that_is_too_long_leaves_half_of_the_inertia():
    assert model_to_simulate(model(), 0.03).inertia == pytest.approx(0.5 * ROTOR)


@pytest.mark.parametrize("run_freely", [free_run, lambda model, recording: simulate(model, recording, 1.0)])
def test_a_free_run_answers_a_step_of_torque_as_the_continuous_joint_does(run_freely):
    """qdot = tau/f_v (1 - exp(-f_v t/J)); with J in place of J - f_v h/2, some 2 % of the final speed off at first."""
    viscous = EffectValue("viscous", {"viscous": VISCOUS}), EffectValue("rotor_inertia", {"rotor_inertia": ROTOR})
    step, torque = 1e-3, 3.0
    time = np.arange(60) * step
    recording = Recording(time, np.full(60, torque), 0.0, 0.0, (0.0, 1.0), load_torque=np.zeros(60))
    speed = np.diff(run_freely(ActuatorModel("knee", Drive("torque", 1.0), viscous), recording)) / step
    final = torque / VISCOUS
    # of second order: (f_v h/J)^2/12 of f_v t/J exp(-f_v t/J), at most 3e-4
    assert_allclose(speed, final * (1.0 - np.exp(-VISCOUS / ROTOR * time[1:])), atol=4e-4 * final)
