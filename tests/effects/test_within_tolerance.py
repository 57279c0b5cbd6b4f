"""Sensor errors within tolerance as one effect: its columns, its inverse, its pickle."""

import pickle

import numpy as np
from numpy.testing import assert_allclose

from drake_tc.effects.base import plain_signals
from drake_tc.effects.library import effect
from drake_tc.effects.within_tolerance import CUT_OFF, within_tolerance

TOLERANCES = (("torque_sensor_bias", 0.2), ("torque_sensor_gain", 0.01), ("encoder_offset", 1e-3))


def signals():
    rng = np.random.default_rng(0)
    names = ("load_torque", "position", "acceleration", "load_slope")
    return plain_signals(50, {name: rng.standard_normal(50) for name in names})


def test_its_columns_are_those_of_its_members_side_by_side():
    made = within_tolerance(TOLERANCES)
    members = [effect(name).columns(signals(), {}) for name, _ in TOLERANCES]
    assert_allclose(made.columns(signals(), {}), np.hstack(members), rtol=0.0)
    assert [p.upper for p in made.coefficients] == [CUT_OFF * size for _, size in TOLERANCES]
    assert [p.lower for p in made.coefficients] == [-CUT_OFF * size for _, size in TOLERANCES]


def test_restoring_undoes_what_the_sensors_do():
    made = within_tolerance(TOLERANCES)
    values = made.physical(np.array([0.3, 0.02, -0.002]), {}, 1.0)
    true = signals()
    measured = made.corrupt(true, values)
    assert_allclose(measured.load_torque, 1.02 * true.load_torque + 0.3, rtol=1e-12)  # rounding
    restored = made.restore(measured, values)
    assert_allclose(restored.load_torque, true.load_torque, atol=1e-14)
    assert_allclose(restored.position, true.position, atol=1e-14)


def test_scale_and_inertia_are_those_of_the_members():
    made, theta = within_tolerance(TOLERANCES), np.array([0.3, 0.02, -0.002])
    assert_allclose(made.torque_scale(theta, {}), 1.02, rtol=1e-12)
    assert_allclose(made.balance_inertia(theta, {}, 0.5), 0.01, rtol=1e-12)


def test_it_survives_a_process():
    made = within_tolerance(TOLERANCES)
    assert pickle.loads(pickle.dumps(made)) is made
