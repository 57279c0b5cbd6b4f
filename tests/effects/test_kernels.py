"""Kernels, columns, transforms and sensor maps of one effect are the same equation."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from drake_tc.effects.base import DriveEffect, Effect, SensorEffect, TorqueEffect, plain_signals
from drake_tc.effects.kernel import DriveSurroundings
from drake_tc.effects.library import LIBRARY, effect
from drake_tc.effects.presliding_hysteresis import PreslidingHysteresis

TORQUE = [e for e in LIBRARY if isinstance(e, TorqueEffect)]
DRIVE = [e for e in LIBRARY if isinstance(e, DriveEffect)]
SENSOR = [e for e in LIBRARY if isinstance(e, SensorEffect)]


def key(effect: Effect) -> str:
    return effect.key


def draw(effect: Effect, seed: int, largest: float = 3.0) -> dict[str, float]:
    rng = np.random.default_rng(seed)
    if effect.given_shapes:  # a range has a start and an end
        return {p.name: float(rng.uniform(-1, 1)) for p in effect.coefficients} | {
            p.name: p.default for p in effect.given_shapes
        }
    lows = {p.name: max(p.lower, -largest) for p in effect.parameters}
    bounds = ((p.name, lows[p.name], max(lows[p.name], min(p.upper, largest))) for p in effect.parameters)
    return {name: float(rng.uniform(low, high)) for name, low, high in bounds}


@pytest.mark.parametrize("effect", TORQUE, ids=key)
@given(
    q=st.floats(-7, 7),
    v=st.floats(-9, 9),
    direction=st.sampled_from([-1.0, 1.0]),
    tau=st.floats(-50, 50),
    celsius=st.floats(0, 90),
    travel=st.floats(0, 5),
    seed=st.integers(0, 99),
)
@settings(max_examples=25, deadline=None)
def test_kernel_is_the_column_at_an_instant(effect, q, v, direction, tau, celsius, travel, seed):
    v = abs(v) * direction
    parameters = draw(effect, seed)
    hysteresis = 0.0
    if isinstance(effect, PreslidingHysteresis):  # Dahl after a reversal from full sliding, in closed form
        hysteresis = direction * (1.0 - 2.0 * np.exp(-travel / parameters["presliding_travel"]))
    level, damping, rest = effect.kernel(parameters)(q, v, direction, tau, celsius, hysteresis)
    known = {"position": q, "velocity": v, "direction": direction, "load_torque": tau, "temperature": celsius}
    signals = plain_signals(1, {n: np.array([x]) for n, x in known.items()} | {"travel": np.array([travel])})
    expected = effect.torque(signals, parameters)[0]
    # the same few operations in another order: rounding only, of terms of size up to 3 * 81 * 65
    assert_allclose(level * direction + damping * v + rest, expected, rtol=1e-10, atol=1e-9)


@pytest.mark.parametrize("effect", [e for e in TORQUE if not isinstance(e, PreslidingHysteresis)], ids=key)
def test_default_kernel_serves_an_effect_that_brings_none(effect):
    parameters = draw(effect, 5)
    now = (0.3, 1.2, 1.0, 4.0, 60.0, 0.0)
    own = effect.kernel(parameters)(*now)
    default = TorqueEffect.kernel(effect, parameters)(*now)
    total = [level * 1.0 + damping * 1.2 + rest for level, damping, rest in (own, default)]
    assert_allclose(total[0], total[1], rtol=1e-12, atol=1e-12)  # rounding


@pytest.mark.parametrize("effect", TORQUE, ids=key)
def test_inertia_is_the_coefficient_of_the_acceleration(effect):
    parameters = draw(effect, 3)
    two = plain_signals(2, {"acceleration": np.array([0.0, 2.5]), "travel": np.full(2, np.inf)})
    torque = effect.torque(two, parameters)
    assert_allclose((torque[1] - torque[0]) / 2.5, effect.inertia(parameters), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("effect", TORQUE, ids=key)
def test_columns_of_a_log_are_those_of_its_instants(effect):
    rng = np.random.default_rng(0)
    names = ("position", "velocity", "acceleration", "load_torque", "temperature")
    known = {name: rng.normal(size=20) for name in names}
    known |= {"direction": np.sign(known["velocity"]), "travel": rng.uniform(0, 1, 20)}
    log = plain_signals(20, known)
    shape = {p.name: draw(effect, 1)[p.name] for p in (*effect.shapes, *effect.given_shapes)}
    at_once = effect.columns(log, shape)
    one_by_one = np.concatenate([effect.columns(log.take(slice(i, i + 1)), shape) for i in range(20)])
    assert_allclose(at_once, one_by_one, rtol=1e-14, atol=0)  # elementwise: the same operations


def walk(size: int, seed: int) -> np.ndarray:
    return np.cumsum(np.random.default_rng(seed).normal(size=size)) * 0.1


def run_kernel(kernel, values, log, memory) -> np.ndarray:
    """The kernel over a log, told of its speed, temperature and supply before every sample."""
    steps = []
    for k, value in enumerate(values.tolist()):
        if kernel.observe is not None:
            now = DriveSurroundings(log.position[k], log.velocity[k], log.temperature[k], log.supply_voltage[k])
            kernel.observe(now, memory, 0)
        steps.append(kernel.step(value, log.effort[k], log.direction[k], memory, 0))
    return np.array(steps)


@pytest.mark.parametrize("effect", [e for e in DRIVE if not e.coefficients], ids=key)
@pytest.mark.parametrize("seed", range(3))
def test_transform_of_a_log_is_the_kernel_one_sample_at_a_time(effect, seed):
    """Delays are whole samples: between them a kernel draws straight lines, and the transform of a log splines."""
    period = 2e-3
    parameters = {p.name: (0.05 if p.unit.startswith("effort") else 0.01 * (seed + 1)) for p in effect.parameters}
    command, position = walk(300, seed), walk(300, seed + 50)
    effort, supply = command - position, 24.0 + walk(300, seed + 9)
    log = plain_signals(300, {"effort": effort, "command": command, "supply_voltage": supply})
    log = type(log)(**(vars(log) | {"period": period}))
    whole = effect.transform(effort, log, parameters)
    kernel = effect.kernel(parameters, period)
    of_command = effect.acts_on == "command"
    values = command if of_command else effort
    memory = kernel.start(values[0], effort[0])
    assert len(memory) == kernel.size
    steps = run_kernel(kernel, values, log, memory)
    assert_allclose(steps - position if of_command else steps, whole, rtol=1e-9, atol=1e-12)  # rounding of recursions


@pytest.mark.parametrize("effect", [e for e in DRIVE if e.coefficients], ids=key)
def test_a_drive_effect_with_a_column_adds_the_torque_of_that_column(effect):
    period, gain = 1e-3, 0.02
    effort, velocity = walk(400, 1), walk(400, 2)
    known = {"effort": effort, "direction": np.sign(velocity), "velocity": velocity}
    known |= {"supply_voltage": 24.0 + walk(400, 3), "temperature": 40.0 + 10.0 * walk(400, 4)}
    log = replace(plain_signals(400, known), period=period)
    theta = 3.0
    shape = {p.name: p.default or 0.0123 for p in (*effect.shapes, *effect.given_shapes)}
    supplied = effect.transform(effort, log, shape) / gain - theta * effect.columns(log, shape)[:, 0]
    kernel = effect.kernel(effect.physical(np.array([theta]), shape, gain), period)
    steps = run_kernel(kernel, effort, log, kernel.start(effort[0], effort[0]))
    assert_allclose(steps / gain, supplied, rtol=1e-9, atol=1e-9)  # rounding of a running sum
    assert np.ptp(supplied - effort / gain) > 0.1


def test_a_supply_that_is_not_known_counts_as_the_nominal_one():
    effort = walk(50, 1)
    for supply in (np.nan, 0.0):
        log = plain_signals(50, {"effort": effort, "supply_voltage": np.full(50, supply)})
        assert_allclose(effect("supply_sag").columns(log, {"nominal_voltage": 24.0}), 0.0)
        limit = effect("saturation.supply")
        assert_allclose(limit.transform(effort, log, {"limit_per_volt": 0.01}), effort)
        for key, numbers in (
            ("supply_sag", {"supply_sensitivity": 1.0, "nominal_voltage": 24.0}),
            ("saturation.supply", {"limit_per_volt": 0.01}),
        ):
            kernel = effect(key).kernel(numbers, 1e-3)
            assert_allclose(run_kernel(kernel, effort, log, kernel.start(effort[0], effort[0])), effort)


def test_a_winding_follows_its_differential_equation():
    """L di/dt + R i = V - k_e qdot against 4th-order Runge-Kutta at a hundredth of the period."""
    period, resistance, inductance, constant, ratio = 1e-3, 0.8, 0.012, 0.4, 50.0
    per_amp, back = constant * ratio, constant * ratio  # k_t N and k_e on the joint's side
    time = np.arange(400) * period
    volts, speed = 10 * np.sin(40 * time), 0.3 * np.sin(23 * time + 0.4)
    current = np.zeros(400)
    i = (volts[0] - back * speed[0]) / resistance
    current[0] = i
    for n in range(399):
        for k in range(100):
            now, then = (n + k / 100, n + (k + 1) / 100)
            at = np.array([now, 0.5 * (now + then), then]) * period
            drive = np.interp(at, time, volts) - back * np.interp(at, time, speed)
            h = period / 100
            k1 = (drive[0] - resistance * i) / inductance
            k2 = (drive[1] - resistance * (i + 0.5 * h * k1)) / inductance
            k3 = (drive[1] - resistance * (i + 0.5 * h * k2)) / inductance
            k4 = (drive[2] - resistance * (i + h * k3)) / inductance
            i += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        current[n + 1] = i
    winding, gain = effect("current_lag.winding"), resistance / per_amp
    log = replace(plain_signals(400, {"time": time, "velocity": speed, "effort": volts}), period=period)
    shape, damping = {"lag": inductance / resistance}, back / gain
    torque = winding.transform(volts, log, shape) / gain - damping * (speed + winding.columns(log, shape)[:, 0])
    # both are exact for inputs that are linear between samples; the start of the lags is that of a resting input
    start = per_amp * current[0]
    assert_allclose(torque[0], start, rtol=1e-9)
    assert_allclose(torque, per_amp * current, rtol=1e-6, atol=1e-6 * np.ptp(torque))


def test_a_late_torque_is_moved_back():
    time = np.linspace(0, 3, 3001)
    true = plain_signals(3001, {"time": time, "load_torque": np.sin(2 * time)})
    late = effect("delay.torque_sensor").corrupt(true, {"delay": 0.0503})
    assert_allclose(late.load_torque[100:], np.sin(2 * (time[100:] - 0.0503)), atol=1e-6)  # linear between samples
    back = effect("delay.torque_sensor").restore(late, {"delay": 0.0503})
    assert_allclose(back.load_torque[100:-100], true.load_torque[100:-100], atol=2e-6)


def test_a_late_position_is_moved_back():
    time = np.linspace(0, 3, 3001)
    true = plain_signals(3001, {"time": time, "position": np.sin(2 * time), "velocity": 2 * np.cos(2 * time)})
    late = effect("delay.position_sensor").corrupt(true, {"delay": 0.0503})
    assert_allclose(late.position[100:], np.sin(2 * (time[100:] - 0.0503)), atol=1e-6)  # linear between samples
    assert_allclose(late.velocity[100:], 2 * np.cos(2 * (time[100:] - 0.0503)), atol=2e-6)
    back = effect("delay.position_sensor").restore(late, {"delay": 0.0503})
    assert_allclose(back.position[100:-100], true.position[100:-100], atol=2e-6)


DELAYS = ("delay.torque_sensor", "delay.position_sensor")


@pytest.mark.parametrize("effect", [e for e in SENSOR if e.key not in DELAYS], ids=key)
def test_restore_undoes_corrupt(effect):
    parameters = draw(effect, 2, 0.2)
    time = np.linspace(0, 3, 50)
    true = plain_signals(50, {"time": time, "position": np.sin(time) * 4, "load_torque": walk(50, 0)})
    measured = effect.corrupt(true, parameters)
    assert not np.array_equal(measured.position, true.position) or np.any(measured.load_torque != true.load_torque)
    back = effect.restore(measured, parameters)
    assert_allclose(back.position, true.position, atol=1e-8)  # a fixed point contracting by 0.3 a round, 12 rounds
    assert_allclose(back.load_torque, true.load_torque, rtol=1e-12, atol=1e-12)
