"""Every effect states its equation; it is the one that the effect computes, and the page shows the model's numbers."""

import ast
import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.problem.parameters import Estimate
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.effects.base import DriveEffect, Effect, SensorEffect, Signals, TorqueEffect, plain_signals
from drake_tc.effects.check import EQUATION_SIGNALS, _check_equation
from drake_tc.effects.kernel import DriveSurroundings
from drake_tc.effects.library import LIBRARY, MULTI_JOINT, UNCOMMON, effect
from drake_tc.effects.position_dependent_load import spline_columns
from drake_tc.effects.unknown_load import UNKNOWN_LOADS
from drake_tc.report.equation import SYMBOLS, equations, model_equations
from drake_tc.report.numbers import interval

EVERY = (*LIBRARY, *UNCOMMON, *MULTI_JOINT, *UNKNOWN_LOADS)
WITH_MEMORY = ("presliding_hysteresis", "winding_heat", "winding_temperature", "elasticity", "backlash")
"""Their equations need a state or stand for another signal; tests of their own hold them."""
T = 400


@pytest.mark.parametrize("one", EVERY, ids=lambda one: one.key)
def test_what_a_registration_accepts_is_what_a_report_can_write(one):
    _check_equation(one.key, one)
    assert set(SYMBOLS) == EQUATION_SIGNALS


def values_of(one: Effect, seed: int = 0, *, negative: bool = False) -> dict[str, Estimate]:
    rng = np.random.default_rng(seed)
    found = {}
    for p in one.parameters:
        value = float(rng.uniform(0.3, 0.9))
        if negative and p.lower < 0.0 and p.name not in ("curve_end",):
            value = -value
        value = {"curve_start": -1.5, "curve_end": 1.5}.get(p.name, value)
        found[p.name] = Estimate(value, p.unit.replace("effort", "A"), (value - 1e-3, value + 1e-3), False)
    return found


def signals() -> Signals:
    rng = np.random.default_rng(1)
    velocity = rng.normal(size=T)
    known = {
        "time": np.linspace(0.0, 4.0, T),
        "position": rng.uniform(-1.4, 1.4, T),
        "velocity": velocity,
        "direction": np.sign(velocity),
        "acceleration": rng.normal(size=T),
        "load_torque": rng.normal(size=T),
        "effort": rng.normal(size=T),
        "temperature": rng.uniform(20.0, 60.0, T),
        "supply_voltage": rng.uniform(0.5, 2.0, T),
    }
    made = plain_signals(T, known)
    return Signals(**{**made.__dict__, "period": 0.01})


def evaluated(text: str, values: dict[str, Estimate], s: Signals) -> np.ndarray:
    """The right side of an equation as Python computes it."""
    names: dict[str, object] = {
        "q": s.position,
        "qdot": s.velocity,
        "qddot": s.acceleration,
        "tau": s.load_torque,
        "y": s.effort,
        "t": s.time,
        "T": s.temperature,
        "T_25": 25.0,
        "V": s.supply_voltage,
        "sign": np.sign,
        "exp": np.exp,
        "sin": np.sin,
        "cos": np.cos,
        "abs": np.abs,
        "max": np.maximum,
        "min": np.minimum,
        "levels": np.array([e.value for name, e in values.items() if name.startswith("level_")]),
        "spline": lambda q, a, b, c: spline_columns(q, a, b, c.size - 3) @ c,
    }
    tree = ast.parse(text.split(" = ")[1], mode="eval")
    for node in ast.walk(tree):
        for name, child in ast.iter_fields(node):
            if isinstance(child, ast.IfExp):
                setattr(node, name, ast.Call(ast.Name("where", ast.Load()), [child.test, child.body, child.orelse], []))
    names |= {"where": np.where} | {name: e.value for name, e in values.items()}
    found = eval(compile(ast.fix_missing_locations(tree), "equation", "eval"), {"__builtins__": {}}, names)
    return np.broadcast_to(found, (T,))


INSTANT = [e for e in EVERY if e.id not in WITH_MEMORY and not re.search(r"ddt|ddq|integral|\(t", e.equation)]


@pytest.mark.parametrize("one", [e for e in INSTANT if isinstance(e, TorqueEffect)], ids=lambda e: e.key)
@pytest.mark.parametrize("negative", [False, True])
def test_a_torque_equation_is_what_the_effect_computes(one: TorqueEffect, negative: bool) -> None:
    values, s = values_of(one, negative=negative), signals()
    torque = one.torque(s, {name: e.value for name, e in values.items()})
    assert_allclose(evaluated(one.equation, values, s), torque, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("one", [e for e in INSTANT if isinstance(e, DriveEffect)], ids=lambda e: e.key)
def test_a_drive_equation_is_what_the_drive_does(one: DriveEffect) -> None:
    values, s = values_of(one), signals()
    named = {name: e.value for name, e in values.items()}
    kernel = one.kernel(named, s.period)
    memory = list(kernel.start(0.0, 0.0))
    wanted = []
    for k in range(T):
        if kernel.observe is not None:
            now = (s.position[k], s.velocity[k], s.temperature[k], s.supply_voltage[k])
            kernel.observe(DriveSurroundings(*map(float, now)), memory, 0)
        wanted.append(kernel.step(float(s.effort[k]), float(s.effort[k]), float(s.direction[k]), memory, 0))
    assert_allclose(evaluated(one.equation, values, s), wanted, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("one", [e for e in INSTANT if isinstance(e, SensorEffect)], ids=lambda e: e.key)
def test_a_sensor_equation_is_what_the_sensor_records(one: SensorEffect) -> None:
    values, s = values_of(one), signals()
    recorded = one.corrupt(s, {name: e.value for name, e in values.items()})
    field = {"q_meas": "position", "tau_meas": "load_torque"}[one.equation.split(" = ")[0]]
    assert_allclose(evaluated(one.equation, values, s), getattr(recorded, field), rtol=1e-9)


@pytest.mark.parametrize("one", EVERY, ids=lambda e: e.key)
@pytest.mark.parametrize("negative", [False, True])
def test_every_equation_is_well_formed_and_shows_every_number(one: Effect, negative: bool) -> None:
    values = values_of(one, 3, negative=negative)
    made = equations(one, values)
    assert made
    text = "".join("".join(ElementTree.fromstring(m).itertext()) for m in made)
    for name, e in values.items():
        shown = interval(e.value, *e.ci95)[0].lstrip("−")
        assert (f"{e.value:.3g}".lstrip("-") if name.startswith("level_") else shown) in text, name
    assert "−−" not in text and "+−" not in text


def test_a_negative_coefficient_turns_the_sign_before_it() -> None:
    one = effect("torque_ripple")
    values = values_of(one)
    values["ripple_sine"] = Estimate(-0.25, "N*m", (-0.26, -0.24), False)
    (made,) = equations(one, values)
    text = "".join(ElementTree.fromstring(made).itertext())
    assert re.search(r"\)−0\.250\u00a0N·m·sin", text), text


def test_the_model_after_is_listed_with_its_numbers(joint: JointResult) -> None:
    rows = model_equations(joint)
    assert [(title, added) for title, added, _ in rows] == [
        ("torque balance", False),
        ("viscous friction", False),
        ("Coulomb friction", False),
        ("Stribeck friction", True),
        ("torque ripple", True),
    ]
    values = joint.final_parameters["stribeck"]
    text = "".join(ElementTree.fromstring(rows[3][2][0]).itertext())
    for e in values.values():
        assert interval(e.value, *e.ci95)[0] in text
    assert f"{joint.final.gain:.3f}"[:5] in "".join(ElementTree.fromstring(rows[0][2][0]).itertext())
