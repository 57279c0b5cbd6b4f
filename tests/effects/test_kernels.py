"""Kernels, columns, transforms and sensor maps of one effect are the same equation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from drake_tc.effects.base import DriveEffect, Effect, SensorEffect, TorqueEffect, plain_signals
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


@pytest.mark.parametrize("effect", [e for e in DRIVE if not e.coefficients], ids=key)
@pytest.mark.parametrize("seed", range(3))
def test_transform_of_a_log_is_the_kernel_one_sample_at_a_time(effect, seed):
    period = 2e-3
    parameters = {p.name: (0.05 if p.unit == "effort" else 0.0093 * (seed + 1)) for p in effect.parameters}
    command, position = walk(300, seed), walk(300, seed + 50)
    effort = command - position
    log = plain_signals(300, {"effort": effort, "command": command})
    log = type(log)(**(vars(log) | {"period": period}))
    whole = effect.transform(effort, log, parameters)
    kernel = effect.kernel(parameters, period)
    of_command = effect.acts_on == "command"
    values = command if of_command else effort
    memory = kernel.start(values[0], effort[0])
    assert len(memory) == kernel.size
    steps = np.array([kernel.step(x, y, 1.0, memory, 0) for x, y in zip(values, effort, strict=True)])
    assert_allclose(steps - position if of_command else steps, whole, rtol=1e-9, atol=1e-12)  # rounding of recursions


@pytest.mark.parametrize("effect", [e for e in DRIVE if e.coefficients], ids=key)
def test_a_drive_effect_with_a_column_adds_the_torque_of_that_column(effect):
    period, gain = 1e-3, 0.02
    effort, direction = walk(400, 1), np.sign(walk(400, 2))
    log = plain_signals(400, {"effort": effort, "direction": direction})
    log = type(log)(**(vars(log) | {"period": period}))
    theta = 3.0
    torque = -theta * effect.columns(log, {})[:, 0]  # supplied, not needed
    kernel = effect.kernel(effect.physical(np.array([theta]), {}, gain), period)
    memory = kernel.start(effort[0], effort[0])
    steps = np.array([kernel.step(y, y, z, memory, 0) for y, z in zip(effort, direction, strict=True)])
    assert_allclose((steps - effort) / gain, torque, rtol=1e-9, atol=1e-9)  # rounding of a running sum


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
