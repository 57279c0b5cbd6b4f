"""Reference motions: through their knots, smooth, at rest at the ends."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.systems.primitives import TrajectorySource

from drake_tc.control.trajectories import Sinusoid, constant_trajectory, knot_trajectory, sinusoid_trajectory
from drake_tc.errors import ParamsError

TIMES = np.array([0.0, 0.4, 1.0, 1.3, 2.0])
KNOTS = np.random.default_rng(2).normal(size=(5, 3))


def test_through_the_knots_and_at_rest_at_the_ends():
    motion = knot_trajectory(TIMES, KNOTS)
    assert_allclose([motion.value(t).ravel() for t in TIMES], KNOTS, atol=1e-10)
    for t in (0.0, 2.0):
        for order in (1, 2):
            assert_allclose(motion.EvalDerivative(t, order), 0.0, atol=1e-8)


def test_jerk_and_snap_are_continuous():
    motion = knot_trajectory(TIMES, KNOTS)
    for order in range(5):
        scale = max(np.abs(motion.EvalDerivative(t, order)).max() for t in np.linspace(0, 2, 50))
        for t in TIMES[1:-1]:
            step = motion.EvalDerivative(t + 1e-9, order) - motion.EvalDerivative(t - 1e-9, order)
            assert np.abs(step).max() < 1e-5 * scale


def test_two_knots_are_minimum_jerk():
    motion = knot_trajectory([1.0, 3.0], [[2.0], [5.0]])
    for t in np.linspace(1.0, 3.0, 9):
        s = (t - 1.0) / 2.0
        assert_allclose(motion.value(t)[0, 0], 2.0 + 3.0 * (10 * s**3 - 15 * s**4 + 6 * s**5), rtol=1e-12)


def test_growing_sinusoid_and_its_derivatives():
    sinusoid = Sinusoid((0.3, -0.2), (0.05, 0.0), (0.02, 0.1), 1.5, 6.0)
    motion = sinusoid_trajectory(sinusoid)
    w = 2 * np.pi * 1.5
    for t in np.linspace(0.0, 6.0, 211):
        exact = np.array([0.3, -0.2]) + (np.array([0.05, 0.0]) + np.array([0.02, 0.1]) * t) * np.sin(w * t)
        assert_allclose(motion.value(t).ravel(), exact, atol=1e-9)
    x, v, a = sinusoid.at(np.array([2.2]))
    h = 1e-4
    ahead, behind = (sinusoid.at(np.array([2.2 + d]))[0] for d in (h, -h))
    assert_allclose((ahead - behind) / (2 * h), v, rtol=1e-5)  # central differences: h^2
    assert_allclose((ahead - 2 * x + behind) / h**2, a, rtol=1e-4)
    assert_allclose(motion.EvalDerivative(2.2, 1).ravel(), v[0], atol=1e-6)
    assert_allclose(motion.EvalDerivative(2.2, 2).ravel(), a[0], atol=1e-4)


def test_a_trajectory_source_takes_them():
    for motion in (knot_trajectory(TIMES, KNOTS), constant_trajectory([1.0, 2.0, 3.0])):
        source = TrajectorySource(motion, 2)
        context = source.CreateDefaultContext()
        context.SetTime(7.0)
        rest = np.concatenate([motion.value(7.0).ravel(), np.zeros(6)])
        assert_allclose(source.get_output_port().Eval(context), rest, atol=1e-7)
    assert_allclose(constant_trajectory([1.0, 2.0]).value(1e4).ravel(), [1.0, 2.0])


def test_refusals():
    with pytest.raises(ParamsError, match="times: expected at least 2 finite, increasing"):
        knot_trajectory([0.0, 0.0], [[1.0], [2.0]])
    with pytest.raises(ParamsError, match="times"):
        knot_trajectory([0.0, np.nan], [[1.0], [2.0]])
    with pytest.raises(ParamsError, match=r"values: expected shape \(2, n\)"):
        knot_trajectory([0.0, 1.0], [[1.0], [2.0], [3.0]])
    with pytest.raises(ParamsError, match="row 1 has"):
        knot_trajectory([0.0, 1.0], [[1.0], [np.nan]])
    with pytest.raises(ParamsError, match="of one length"):
        Sinusoid((0.0,), (1.0, 2.0), (0.0,), 1.0, 1.0)
    with pytest.raises(ParamsError, match="frequency_hz"):
        Sinusoid((0.0,), (1.0,), (0.0,), 0.0, 1.0)
    with pytest.raises(ParamsError, match="finite numbers"):
        constant_trajectory([np.inf])
