"""Each torque effect against its closed form: over a log, compiled for the compensation, and in a step of a joint."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.actuation.compensator import Compensator, Motion
from drake_tc.actuation.free_run import simulate
from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.recorded_run import Link, Recording
from drake_tc.effects.base import EquationEffect, plain_signals
from drake_tc.effects.library import BUILT_IN, effect
from drake_tc.kernels.torque_equations import CONSTANT
from tests.joint_program import JointInput, JointProgram


def warmth(celsius, rate):
    return (1.0 - math.exp(-rate * (celsius - 25.0))) / rate


def wave(q, p, cosine, sine):
    return p[cosine] * math.cos(p["cycles_per_turn"] * q) + p[sine] * math.sin(p["cycles_per_turn"] * q)


def sign(v):
    return 1.0 if v >= 0.0 else -1.0


CLOSED = {
    "viscous": lambda q, v, d, tau, celsius, z, p: (0.0, p["viscous"], 0.0),
    "coulomb": lambda q, v, d, tau, celsius, z, p: (p["coulomb"], 0.0, 0.0),
    "rotor_inertia": lambda q, v, d, tau, celsius, z, p: (0.0, 0.0, 0.0),
    "run_in_friction": lambda q, v, d, tau, celsius, z, p: (0.0, 0.0, 0.0),
    "effort_bias": lambda q, v, d, tau, celsius, z, p: (0.0, 0.0, p["bias_torque"]),
    "stribeck": lambda q, v, d, tau, celsius, z, p: (
        p["stribeck"] * math.exp(-((abs(v) / p["stribeck_velocity"]) ** p["stribeck_exponent"])),
        0.0,
        0.0,
    ),
    "static_friction": lambda q, v, d, tau, celsius, z, p: (
        p["static_excess"] * math.exp(-(v * v) / p["break_away_speed"] ** 2),
        0.0,
        0.0,
    ),
    "quadratic_viscous": lambda q, v, d, tau, celsius, z, p: (0.0, p["quadratic_viscous"] * abs(v), 0.0),
    "viscous_power": lambda q, v, d, tau, celsius, z, p: (
        p["viscous_power"] * math.pow(abs(v), p["viscous_exponent"]),
        0.0,
        0.0,
    ),
    "asymmetric_friction": lambda q, v, d, tau, celsius, z, p: (
        p["coulomb_asymmetry"] * d,
        p["viscous_asymmetry"] * sign(v),
        0.0,
    ),
    "asymmetric_friction.coulomb": lambda q, v, d, tau, celsius, z, p: (p["coulomb_asymmetry"] * d, 0.0, 0.0),
    "load_dependent_friction": lambda q, v, d, tau, celsius, z, p: (p["load_friction"] * abs(tau), 0.0, 0.0),
    "directional_efficiency": lambda q, v, d, tau, celsius, z, p: (
        abs(tau) * (p["driving_friction"] if tau * d > 0.0 else p["backdriven_friction"]),
        0.0,
        0.0,
    ),
    "load_stribeck": lambda q, v, d, tau, celsius, z, p: (
        p["load_stribeck"] * abs(tau) / math.exp(abs(v) / p["load_stribeck_velocity"]),
        0.0,
        0.0,
    ),
    "position_dependent_friction": lambda q, v, d, tau, celsius, z, p: (
        wave(q, p, "friction_cosine", "friction_sine"),
        0.0,
        0.0,
    ),
    "position_dependent_friction.linear": lambda q, v, d, tau, celsius, z, p: (
        p["friction_slope"] * math.copysign(min(abs(q - p["middle"]), p["half_travel"]), q - p["middle"]),
        0.0,
        0.0,
    ),
    "torque_ripple": lambda q, v, d, tau, celsius, z, p: (0.0, 0.0, wave(q, p, "ripple_cosine", "ripple_sine")),
    "load_tilt": lambda q, v, d, tau, celsius, z, p: (0.0, 0.0, p["tilt_moment"] * math.cos(q)),
    "cable_spring.beside_weight": lambda q, v, d, tau, celsius, z, p: (0.0, 0.0, p["spring_stiffness"] * q),
    "cable_spring": lambda q, v, d, tau, celsius, z, p: (0.0, 0.0, p["spring_stiffness"] * q + p["spring_preload"]),
    "thermal_friction": lambda q, v, d, tau, celsius, z, p: (
        p["coulomb_per_kelvin"] * warmth(celsius, p["thermal_rate"]),
        p["viscous_per_kelvin"] * warmth(celsius, p["thermal_rate"]),
        0.0,
    ),
    "presliding_hysteresis.sliding": lambda q, v, d, tau, celsius, z, p: (-p["presliding"], 0.0, p["presliding"] * z),
    "presliding_hysteresis": lambda q, v, d, tau, celsius, z, p: (-p["presliding"], 0.0, p["presliding"] * z),
    "payload": lambda q, v, d, tau, celsius, z, p: (0.0, 0.0, p["payload_moment"] * math.sin(q)),
    "payload.sliding": lambda q, v, d, tau, celsius, z, p: (0.0, 0.0, p["payload_weight"]),
    "payload.pendulum": lambda q, v, d, tau, celsius, z, p: (
        0.0,
        0.0,
        p["payload_moment"] * math.sin(q - p["hang_angle"]),
    ),
    "payload.own_arm": lambda q, v, d, tau, celsius, z, p: (
        0.0,
        0.0,
        p["payload_moment"] * math.sin(q - p["hang_angle"]),
    ),
    "payload.declared_gain": lambda q, v, d, tau, celsius, z, p: (0.0, 0.0, p["payload_share"] * tau),
    "unknown_load.sliding": lambda q, v, d, tau, celsius, z, p: (0.0, 0.0, p["constant"]),
    "unknown_load.pendulum": lambda q, v, d, tau, celsius, z, p: (
        0.0,
        0.0,
        p["moment"] * (math.sin(q) * math.cos(p["zero"]) - math.cos(q) * math.sin(p["zero"])) + p["constant"],
    ),
}
EQUATIONS = [e for e in BUILT_IN if isinstance(e, EquationEffect)]
CHANGING = [e.key for e in EQUATIONS if e.torque_kind != CONSTANT]
STATES = 200
JOINT = {
    "rotor_inertia": {"rotor_inertia": 0.02},
    "viscous": {"viscous": 0.05},
    "coulomb": {"coulomb": 0.3},
    "stribeck": {"stribeck": 0.2, "stribeck_velocity": 0.15, "stribeck_exponent": 1.3},
    "static_friction": {"static_excess": 0.1, "break_away_speed": 0.02},
    "quadratic_viscous": {"quadratic_viscous": 0.02},
    "viscous_power": {"viscous_power": 0.05, "viscous_exponent": 0.4},
    "asymmetric_friction": {"coulomb_asymmetry": 0.04, "viscous_asymmetry": 0.01},
    "directional_efficiency": {"driving_friction": 0.1, "backdriven_friction": 0.2},
    "load_dependent_friction": {"load_friction": 0.1},
    "load_stribeck": {"load_stribeck": 0.05, "load_stribeck_velocity": 0.3},
    "position_dependent_friction": {"friction_cosine": 0.05, "friction_sine": -0.03, "cycles_per_turn": 3.0},
    "position_dependent_friction.linear": {"friction_slope": -0.05, "middle": 0.1, "half_travel": 1.2},
    "torque_ripple": {"ripple_cosine": 0.05, "ripple_sine": 0.04, "cycles_per_turn": 20.0},
    "load_tilt": {"tilt_moment": 0.1},
    "cable_spring": {"spring_stiffness": 0.2, "spring_preload": 0.1},
    "thermal_friction": {"coulomb_per_kelvin": -0.001, "viscous_per_kelvin": -0.0005, "thermal_rate": 0.03},
    "presliding_hysteresis": {"presliding": 0.1, "presliding_travel": 0.01},
    "payload": {"payload_moment": 0.2, "payload_inertia": 0.005},
    "payload.declared_gain": {"payload_share": 0.05},
    "unknown_load.pendulum": {"moment": 0.1, "zero": 0.3, "constant": 0.02, "inertia": 0.003},
    "effort_bias": {"bias_torque": 0.03},
    "deadzone": {"deadzone": 0.002},
}


def drawn(key: str, rng: np.random.Generator) -> dict[str, float]:
    """Values within their bounds, a range's end and a speed away from 0."""
    lows = {p.name: max(p.lower, 0.05 if p in effect(key).given_shapes else -3.0) for p in effect(key).parameters}
    return {
        p.name: float(rng.uniform(lows[p.name], max(lows[p.name], min(p.upper, 3.0)))) for p in effect(key).parameters
    }


def closures(monkeypatch, keys) -> None:
    """Make these effects hand out closures over the closed forms, which no step can compile."""
    original = EquationEffect.kernel

    def kernel(self, parameters):
        if self.key not in keys:
            return original(self, parameters)
        return lambda *now: CLOSED[self.key](*now, parameters)

    monkeypatch.setattr(EquationEffect, "kernel", kernel)


def model(gear: bool = False) -> ActuatorModel:
    effects = JOINT | ({"backlash": {"backlash": 1e-3}} if gear else {})
    return ActuatorModel("j", Drive("position_servo", 0.02), tuple(EffectValue(k, p) for k, p in effects.items()))


def test_every_equation_has_a_closed_form_here_and_a_part_in_the_joint():
    assert {e.key for e in EQUATIONS} == set(CLOSED)
    left = {e.key for e in EQUATIONS} - set(JOINT)
    assert left == {
        "run_in_friction",
        "asymmetric_friction.coulomb",
        "payload.sliding",
        "presliding_hysteresis.sliding",
        "unknown_load.sliding",
        "cable_spring.beside_weight",
        "payload.pendulum",
        "payload.own_arm",
    }  # other forms are there


@pytest.mark.parametrize("key", CLOSED)
def test_compiled_it_is_the_closed_form(key):
    """The compensation of a torque drive of gain 1 is the torque itself; a hysteretic state is the direction there."""
    rng = np.random.default_rng(7)
    values = [drawn(key, rng) for _ in range(STATES)]
    law = Compensator(
        [ActuatorModel(f"j{k}", Drive("torque", 1.0), (EffectValue(key, p),)) for k, p in enumerate(values)]
    )
    assert law.interpreted == ()
    tau, v, q, d = (
        rng.normal(0, 5, STATES),
        rng.normal(0, 3, STATES),
        rng.normal(0, 2, STATES),
        rng.uniform(-1, 1, STATES),
    )
    celsius = rng.uniform(0, 90, STATES)
    expected = []
    for k, p in enumerate(values):
        level, damping, rest = CLOSED[key](q[k], v[k], d[k], tau[k], celsius[k], d[k], p)
        expected.append(tau[k] + level * d[k] + damping * v[k] + rest)
    # rounding of the same sum; relative to the load beside it
    assert_allclose(
        law.effort(tau, Motion(v, q, direction=d, temperature=celsius)),
        expected,
        rtol=1e-12,
        atol=1e-12 * np.max(np.abs(expected)),
    )


@pytest.mark.parametrize("key", [key for key in CLOSED if key != "run_in_friction"])
def test_over_a_log_it_is_the_closed_form(key):
    rng = np.random.default_rng(3)
    p = drawn(key, rng)
    known = {name: rng.normal(0, 2, STATES) for name in ("position", "velocity", "acceleration", "load_torque")}
    known |= {"direction": np.sign(known["velocity"]), "temperature": rng.uniform(0, 90, STATES)}
    log = replace(plain_signals(STATES, known | {"travel": np.full(STATES, np.inf)}), period=0.0)
    expected = []
    for k in range(STATES):
        v, d = log.velocity[k], log.direction[k]
        now = (log.position[k], v, d, log.load_torque[k], log.temperature[k], d)
        level, damping, rest = CLOSED[key](*now, p)
        inertia = p.get("inertia", p.get("rotor_inertia", p.get("payload_inertia", p.get("payload_mass", 0.0))))
        expected.append(level * d + damping * v + rest + inertia * log.acceleration[k])
    assert_allclose(effect(key).torque(log, p), expected, rtol=1e-12, atol=1e-12 * np.max(np.abs(expected)))


def steps(program: JointProgram) -> np.ndarray:
    """Outputs and memory of 300 ticks with reversals, of which every third knows its load."""
    rng, memory, rows = np.random.default_rng(11), program.initial(), []
    q = 0.0
    for tick in range(300):
        v = float(rng.normal(0, 0.5))
        q += 1e-3 * v
        load = float(rng.normal(0, 2)) if tick % 3 == 0 else None
        now = JointInput(q + float(rng.normal(0, 0.05)), q, v, load, float(rng.uniform(0, 90)))
        rows.append([*program.step(memory, now, at_tick=True), *memory])
    return np.array(rows)


@pytest.mark.parametrize("keys", [CHANGING, ["stribeck", "presliding_hysteresis"]], ids=["all", "some"])
@pytest.mark.parametrize("gear", [False, True], ids=["stiff", "gear"])
def test_a_step_with_compiled_equations_is_the_step_with_closures(monkeypatch, keys, gear):
    compiled = JointProgram(model(gear), 1e-3, 0.1)
    closures(monkeypatch, keys)
    interpreted = JointProgram(model(gear), 1e-3, 0.1)
    assert compiled.effects.compiled
    assert not interpreted.effects.compiled
    found, expected = steps(compiled), steps(interpreted)
    assert np.ptp(found[:, 0]) > 1.0
    # rounding alone; the memory holds what was computed in the steps before
    assert_allclose(found, expected, rtol=1e-12, atol=1e-12 * np.max(np.abs(expected)))


def test_a_free_run_with_compiled_equations_is_the_run_with_closures(monkeypatch):
    time = np.arange(300) * 4e-3
    warm = np.linspace(20.0, 60.0, time.size)
    run = Recording(time, 0.8 * np.sin(6.0 * time), 0.0, 0.0, (-1.0, 1.0), pendulum=Link(0.05, 0.48), temperature=warm)
    compiled = simulate(model(), run, 1e-3)
    closures(monkeypatch, CHANGING)
    interpreted = simulate(model(), run, 1e-3)
    assert np.ptp(compiled) > 0.3
    assert_allclose(compiled, interpreted, rtol=1e-10, atol=1e-10)  # rounding, carried on over 1200 steps
