"""What is fitted of an unknown load: columns, parameters, torque and kernel tell the same."""

import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import BSpline

from drake_tc.actuation.model import EffectValue
from drake_tc.effects.base import Context, plain_signals
from drake_tc.effects.library import LIBRARY, UNCOMMON, effect
from drake_tc.effects.position_dependent_load import spline_columns, spline_curve
from drake_tc.effects.unknown_load import PENDULUM, UNKNOWN_LOADS

RNG = np.random.default_rng(3)
Q, A = RNG.uniform(-3.0, 3.0, 50), RNG.uniform(-5.0, 5.0, 50)
MOTION = plain_signals(50, {"position": Q, "acceleration": A})
SHAPE = {"curve_start": -2.0, "curve_end": 2.5}


def test_the_parameters_of_a_pendulum_are_those_of_its_closed_form() -> None:
    moment, zero, constant, inertia = 2.5, -2.2, 0.3, 0.07
    theta = np.array([moment * np.cos(zero), -moment * np.sin(zero), constant, inertia])
    torque = moment * np.sin(Q - zero) + constant + inertia * A
    assert_allclose(PENDULUM.columns(MOTION, {}) @ theta, torque, atol=1e-12)
    named = PENDULUM.physical(theta, {}, 1.0)
    assert_allclose([named[n] for n in ("moment", "zero", "constant", "inertia")], [moment, zero, constant, inertia])
    assert_allclose(PENDULUM.torque(MOTION, named), torque, atol=1e-12)


@pytest.mark.parametrize("load", UNKNOWN_LOADS, ids=lambda e: e.key)
def test_kernel_and_torque_are_one_equation(load) -> None:  # type: ignore[no-untyped-def]
    shape = {} if load is PENDULUM else SHAPE
    theta = np.abs(RNG.standard_normal(len(load.coefficients)))
    named = load.physical(theta, shape, 1.0)
    kernel = load.kernel(named)
    parts = [kernel(q, 0.7, 1.0, 0.0, 25.0, 0.0) for q in Q]
    assert all(level == damping == 0.0 for level, damping, _ in parts)
    still = np.array([rest for _, _, rest in parts])
    assert_allclose(load.torque(MOTION, named), still + load.inertia(named) * A, atol=1e-12)
    assert EffectValue(load.key, named).effect is load


def test_splines_are_those_of_scipy_and_stay_level_beyond_the_ends() -> None:
    intervals, start, end = 5, -2.0, 2.5
    levels, width = RNG.standard_normal(intervals + 3), (end - start) / intervals
    knots = start + width * np.arange(-3, intervals + 4)
    inside = np.clip(Q, start, end)
    curve = BSpline(knots, levels, 3)(inside)
    assert_allclose(spline_columns(Q, start, end, intervals) @ levels, curve, atol=1e-12)
    at = spline_curve(levels, start, end)
    assert_allclose([at(q) for q in Q], curve, atol=1e-12)


def test_no_search_meets_them_and_effects_of_the_same_form_step_aside() -> None:
    assert not {e.id for e in UNKNOWN_LOADS} & {e.id for e in (*LIBRARY, *UNCOMMON)}
    unknown = Context("position_servo", "unknown", frozenset(), {"rotor_inertia": 0.1, "drive_gain": 1.0})
    for key in ("payload", "payload.pendulum", "rotor_inertia", "cable_spring", "encoder_offset", "elasticity"):
        assert "the load is unknown" in effect(key).obstacle(unknown), key
    for key in ("position_dependent_load", "asymmetric_friction", "asymmetric_friction.coulomb", "servo_gain"):
        assert "the load is unknown" in effect(key).obstacle(unknown), key
    for key in ("torque_sensor_bias", "torque_sensor_gain", "torque_sensor_drift", "delay.torque_sensor"):
        assert effect(key).obstacle(unknown), key
    assert not effect("stribeck").obstacle(unknown)
    assert all("known" in e.obstacle(Context("current", "torque", frozenset())) for e in UNKNOWN_LOADS)


@pytest.mark.parametrize("load", UNKNOWN_LOADS, ids=lambda e: e.key)
def test_it_survives_a_process(load) -> None:  # type: ignore[no-untyped-def]
    copied = pickle.loads(pickle.dumps(load))
    assert type(copied) is type(load)
    shape = {} if load is PENDULUM else SHAPE
    assert_allclose(copied.columns(MOTION, shape), load.columns(MOTION, shape))
