"""Contacts made and lost, and slipping ones left out."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.estimation.base_estimator import CopEstimator
from drake_tc.kernels.base.contacts import Slip, carries, slipping
from drake_tc.kernels.base.sample import options_of

from .constructed import spec, walker


def test_hysteresis_between_break_and_make():
    on, seen = False, []
    for load in (0.0, 25.0, 31.0, 25.0, 20.5, 19.0, 25.0):
        on = carries(load, float(on), 30.0, 20.0, 0.0)
        seen.append(on)
    assert seen == [False, False, True, True, True, False, False]


def test_the_switch_overrules_the_load():
    assert not carries(100.0, 1.0, 30.0, 20.0, -1.0)
    assert carries(0.0, 0.0, 30.0, 20.0, 1.0)
    assert not carries(0.0, 1.0, 30.0, 20.0, 0.0)


def options(**changes):
    """As the kernels take them."""
    return options_of(CopEstimator(walker(), spec(2e-3, **changes)).options)


def run(speeds, loads=(100.0, 90.0), on=(True, True), **changes):
    """Slip over ticks of (2, 3) velocities against the reference."""
    tuning, touching, loads = options(**changes), np.array(on), np.array(loads)
    slip, seen = Slip(np.zeros((2, 3)), np.zeros(2)), []
    for tick, against in enumerate(speeds):
        new = touching & (tick == 0)
        slip = slipping((touching, new, loads), np.array(against), slip, tuning)
        seen.append(list(slip.dropped))
    return np.array(seen)


def test_the_faster_of_two_contacts_is_dropped_and_comes_back_after_standing_still():
    fast, still = [[0.2, 0.0, 0.0], [0.05, 0.0, 0.0]], [[0.0, 0.0, 0.0]] * 2
    dropped = run([fast] * 50 + [still] * 100, slip_time=0.02, slip_hold=0.05)
    assert not dropped[:, 1].any()
    assert dropped[20:50, 0].all()  # 0.2 (1 - e^{-1}) m/s after 20 ms is above 0.05
    assert not dropped[-1].any()
    # back after the average has fallen below half the threshold (ln 8 x 20 ms) and 50 ms of standing still
    back = np.flatnonzero(dropped[50:, 0] == 0.0)[0] * 2e-3
    assert_allclose(back, 0.02 * np.log(8.0) + 0.05, atol=0.01)


def test_the_last_contact_is_never_dropped():
    fast = [[0.5, 0.0, 0.0], [0.5, 0.1, 0.0]]
    assert not (run([fast] * 50) > 0.0).all(axis=1).any()
    assert not run([fast] * 50, on=(True, False)).any()


@pytest.mark.parametrize("noise", [0.01])
def test_noise_drops_nothing(noise):
    rng = np.random.default_rng(0)
    assert not run(rng.normal(size=(2000, 2, 3)) * noise).any()
