"""Effects that the search over several joints looks for: kernels, closed forms, and found again by least squares."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.effects.base import TorqueEffect, plain_signals
from drake_tc.effects.library import LIBRARY, MULTI_JOINT, UNCOMMON, effect
from drake_tc.effects.run_in_friction import RunInFriction
from drake_tc.effects.viscous_power import ViscousPower


def test_they_are_known_to_models_but_not_searched_for_one_joint():
    assert not {e.id for e in MULTI_JOINT} & {e.id for e in (*LIBRARY, *UNCOMMON)}
    for member in MULTI_JOINT:
        assert effect(member.id) is member


def test_power_law_is_viscous_at_one_and_grows_by_the_power():
    v = np.linspace(-4.0, 4.0, 33)
    signals = plain_signals(v.size, {"velocity": v, "direction": np.sign(v)})
    linear = ViscousPower().torque(signals, {"viscous_power": 2.5, "viscous_exponent": 1.0})
    assert_allclose(linear, 2.5 * v, rtol=1e-14, atol=1e-14)
    root = ViscousPower().torque(signals, {"viscous_power": 3.0, "viscous_exponent": 0.5})
    assert_allclose(root[-1], 6.0, rtol=1e-14)  # 3 sqrt(4)
    assert np.all(root * v >= 0.0)  # dissipates


def test_run_in_friction_falls_by_e_in_its_time():
    t = np.array([0.0, 2.0])
    known = {"time": t, "velocity": np.full(2, 1.5), "direction": np.ones(2)}
    signals = plain_signals(2, known)
    object.__setattr__(signals, "period", 2.0)
    torque = RunInFriction().torque(signals, {"run_in_coulomb": 2.0, "run_in_viscous": 0.4, "run_in_time": 2.0})
    assert_allclose(torque, [2.6, 2.6 / np.e], rtol=1e-14)
    assert_allclose(RunInFriction().columns(plain_signals(2, known), {"run_in_time": 2.0}), 0.0)  # settled


@pytest.mark.parametrize("member", MULTI_JOINT, ids=lambda e: e.id)
@pytest.mark.parametrize(("v", "direction"), [(1.3, 1.0), (-0.4, -1.0), (0.0, 1.0)])
def test_kernel_is_the_column_at_an_instant(member: TorqueEffect, v, direction):
    parameters = {p.name: 0.7 for p in member.parameters}
    level, damping, rest = member.kernel(parameters)(0.2, v, direction, 3.0, 25.0, 0.0)
    known = {"velocity": np.array([v]), "direction": np.array([direction]), "travel": np.array([1.0])}
    expected = member.torque(plain_signals(1, known), parameters)[0]
    assert_allclose(level * direction + damping * v + rest, expected, rtol=1e-12, atol=1e-14)
