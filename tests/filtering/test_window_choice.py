"""The chosen window against the error that every window really makes, and what moves the choice."""

from itertools import product

import numpy as np
import pytest
from numpy.testing import assert_allclose
from sweeps import slow_but

from drake_tc.filtering.savitzky_golay import ORDERS, Window, choose_window, smooth

PERIOD = 2e-3
TIME = np.arange(6000) * PERIOD
WAVES = ((0.3, 0.31, 0.4), (0.08, 1.7, 1.9), (0.004, 9.0, 0.2))
"""(size [rad], frequency [Hz], phase): the acceleration of the last is the largest."""


def _motion(derivative: int) -> np.ndarray:
    total = np.zeros_like(TIME)
    for size, frequency, phase in WAVES:
        w = 2.0 * np.pi * frequency
        total += size * w**derivative * np.sin(w * TIME + phase + 0.5 * np.pi * derivative)
    return total


def _error(x: np.ndarray, window: Window, derivative: int) -> float:
    found = smooth(x, window.samples, window.order, PERIOD)
    values = (found.value, found.first_derivative, found.second_derivative)[derivative]
    return float(np.sqrt(np.mean((values - _motion(derivative))[150:-150] ** 2)))


@pytest.mark.parametrize(
    ("derivative", "noise"), slow_but(product((0, 1, 2), (1e-5, 1e-4, 1e-3)), (1, 1e-5), (2, 1e-3))
)
def test_the_choice_is_nearly_as_good_as_the_best_of_all_windows(derivative, noise):
    x = _motion(0) + noise * np.random.default_rng(1).standard_normal(TIME.size)
    chosen = choose_window([(x[:, None], derivative)], PERIOD)
    sizes = (5, 9, 15, 21, 31, 41, 51, 65, 81, 101, 121)
    errors = [_error(x, Window(n, order), derivative) for n in sizes for order in ORDERS if n > order + 1]
    assert _error(x, chosen, derivative) < 1.15 * min(errors)


def test_more_noise_asks_for_longer_windows_and_units_do_not_matter():
    rng = np.random.default_rng(2)
    e = rng.standard_normal(TIME.size)
    chosen = [choose_window([((_motion(0) + size * e)[:, None], 2)], PERIOD) for size in (1e-6, 1e-4, 1e-2)]
    lengths = [w.samples / (w.order + 1) for w in chosen]
    assert lengths[0] < lengths[1] < lengths[2]
    x = (_motion(0) + 1e-4 * e)[:, None]
    assert choose_window([(-57.3 * x, 2)], PERIOD) == choose_window([(x + 4.0, 2)], PERIOD) == chosen[1]


def test_groups_count_by_their_own_scale():
    """A loud, slow group does not decide for a quiet, fast one."""
    rng = np.random.default_rng(3)
    fast = 1e-3 * np.sin(2.0 * np.pi * 20.0 * TIME) + 1e-6 * rng.standard_normal(TIME.size)
    slow = 100.0 * np.sin(2.0 * np.pi * 0.2 * TIME) + 1e-1 * rng.standard_normal(TIME.size)
    clean = 1e-3 * np.sin(2.0 * np.pi * 20.0 * TIME)
    errors = []
    for groups in ([(fast[:, None], 0)], [(fast[:, None], 0), (slow[:, None], 0)]):
        window = choose_window(groups, PERIOD)
        found = smooth(fast, window.samples, window.order, PERIOD).value
        errors.append(float(np.std((found - clean)[150:-150])))
    assert errors[1] < 1.5 * errors[0]


def test_a_channel_that_rests_and_a_short_stretch_are_no_trouble():
    assert choose_window([(np.zeros((400, 3)), 0)], PERIOD).samples == 5
    short = np.sin(np.arange(40) * 0.2)[:, None]
    window = choose_window([(short, 0)], 0.01)
    assert window.samples <= 10
    assert_allclose(smooth(short, window.samples, window.order, 0.01).value, short, atol=0.02)
