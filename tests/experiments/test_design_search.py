"""The search for a motion: gradients are shared by near points, and a refinement never loses."""

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff

from drake_tc.effects.base import plain_signals
from drake_tc.effects.presliding_hysteresis import PreslidingHysteresis
from drake_tc.experiments.design.search import DIFFERENCE, differentiable, refined

CENTRE = np.array([0.3, -0.2, 0.1, 0.4])


def _inside(x):
    """A hill with steps, which has no useful gradient, inside a box."""
    kept = np.clip(x, -0.35, 0.35)
    return -np.floor(1e4 * np.sum((kept - CENTRE) ** 2)) / 1e4, kept


def test_a_refinement_climbs_a_hill_without_a_gradient():
    """The top of the hill in the box is known: the centre, clipped."""
    start = np.zeros(4)
    first = _inside(start)
    value, x = refined(_inside, first, np.random.default_rng(0))
    assert value > first[0]
    assert_allclose(x, np.clip(CENTRE, -0.35, 0.35), atol=0.02)


def test_a_refinement_keeps_a_best_point_that_nothing_exceeds():
    best = (1.0, CENTRE)
    value, x = refined(_inside, best, np.random.default_rng(0))
    assert value == 1.0 and x is CENTRE


def test_points_closer_than_the_difference_share_a_gradient():
    calls, visited = [], []

    def value(x):
        calls.append(x)
        return float(np.sum((x - CENTRE) ** 2))

    cost = differentiable(value, visited)
    here = cost(InitializeAutoDiff(np.zeros(4))[:, 0])
    assert_allclose(ExtractGradient(np.array([[here]]))[0], -2.0 * CENTRE, atol=1.01 * DIFFERENCE)
    assert len(calls) == 5
    near = cost(InitializeAutoDiff(np.full(4, 0.5 * DIFFERENCE))[:, 0])
    assert len(calls) == 6 and len(visited) == 1
    assert_allclose(ExtractValue(np.array([[near]]))[0, 0], value(np.full(4, 0.5 * DIFFERENCE)))
    cost(InitializeAutoDiff(np.full(4, 2.0 * DIFFERENCE))[:, 0])
    assert len(visited) == 2


def test_the_bristle_of_a_smoothed_direction_follows_dahl():
    """Dahl's equation dz/ds = (sign(v) - z)/s_p, integrated in small steps, beside a direction that turns over slowly.

    Away from the reversals the smoothed direction is 1, and the state is the same.
    """
    time = np.arange(0.0, 8.0, 1e-3)
    q, v = 0.3 * np.sin(2.0 * time), 0.6 * np.cos(2.0 * time)
    travel, z, expected = np.zeros_like(q), 0.0, np.zeros_like(q)
    for i in range(1, q.size):
        way = np.sign(v[i])
        moved = abs(q[i] - q[i - 1])
        travel[i] = moved + (travel[i - 1] if way == np.sign(v[i - 1]) else 0.0)
        z = way + (z - way) * np.exp(-moved / 0.05)
        expected[i] = z
    known = {"velocity": v, "direction": np.tanh(v / 0.02), "travel": travel}
    signals = replace(plain_signals(q.size, known), period=1e-3)
    found = PreslidingHysteresis().hysteresis(signals, {"presliding_travel": 0.05})
    away = np.abs(v) > 0.15
    # tanh(0.15/0.02) is 1 to 6e-7
    assert_allclose(found[away], expected[away], atol=2e-6)
