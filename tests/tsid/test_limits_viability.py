"""Bounds on accelerations: never empty, never too wide, never too narrow."""

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from drake_tc.errors import ParamsError
from drake_tc.tsid.limits import JointRange, Viability

ROUNDING = 1e-9
N = 40


class Bounds(NamedTuple):
    """Of `Viability`, and by how much position and velocity limits have to give way, by definition."""

    lower: np.ndarray
    upper: np.ndarray
    beyond: np.ndarray
    too_fast: np.ndarray

    @property
    def relaxed(self) -> np.ndarray:
        return (self.beyond > ROUNDING) | (self.too_fast > ROUNDING)


def at(limits: JointRange, q: np.ndarray, v: np.ndarray) -> Bounds:
    """Braking as hard as can be, B being what stops and A what slows a joint within a period, does not do."""
    lower, upper, count = Viability(limits).bounds(q, v)
    h, a = limits.period, limits.acceleration
    up, down = np.minimum(a, -limits.velocity_lower / h), np.minimum(a, limits.velocity_upper / h)
    above = q + np.maximum(v, 0.0) ** 2 / (2 * up) - limits.upper
    below = limits.lower - q + np.maximum(-v, 0.0) ** 2 / (2 * down)
    fast = np.maximum(v - h * a - limits.velocity_upper, limits.velocity_lower - v - h * a)
    bounds = Bounds(lower, upper, np.maximum(np.maximum(above, below), 0.0), np.maximum(fast, 0.0))
    assert np.isnan(q).any() or count == np.count_nonzero(bounds.relaxed)
    return bounds


def needed(h, a, down, up) -> np.ndarray:
    """Room to turn at the narrower end: h W / 2 + W^2 / (2 B)."""
    b_up, b_low = np.minimum(a, down / h), np.minimum(a, up / h)
    one = 0.5 * h * h * b_up + (b_up * h) ** 2 / (2 * b_low)
    other = 0.5 * h * h * b_low + (b_low * h) ** 2 / (2 * b_up)
    return np.maximum(one, other)


def ranges(rng: np.random.Generator, count: int = N) -> JointRange:
    """Any: coarse and fine periods, slow and fast joints, narrow and wide ranges."""
    h = 10 ** rng.uniform(-3, -1)
    a = 10 ** rng.uniform(-1, 3, count)
    down, up = 10 ** rng.uniform(-2, 1, count), 10 ** rng.uniform(-2, 1, count)
    lower = rng.uniform(-1, 0, count)
    wider = 1 + (rng.random(count) < 0.7) * 10 ** rng.uniform(-3, 3, count)
    upper = lower + needed(h, a, down, up) * wider * (1 + 1e-9) + 1e-12
    return JointRange(tuple(map(str, range(count))), lower, upper, -down, up, a, h)


def extremes(q, v, a, h) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest q during the period, by the parabola's own turning point."""
    end = q + v * h + 0.5 * a * h * h
    with np.errstate(divide="ignore", invalid="ignore"):
        instant = np.where(a != 0, -v / a, 0.0)
        turning = np.where((instant > 0) & (instant < h), q + 0.5 * v * instant, q)
    return np.minimum(np.minimum(q, end), turning), np.maximum(np.maximum(q, end), turning)


def chosen(rng, bounds) -> np.ndarray:
    """At a bound or anywhere between."""
    between = bounds.lower + rng.random(bounds.lower.size) * (bounds.upper - bounds.lower)
    return np.choose(rng.integers(0, 3, bounds.lower.size), [bounds.lower, bounds.upper, between])


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_whoever_follows_the_bounds_never_leaves_the_box(seed):
    rng = np.random.default_rng(seed)
    limits = ranges(rng)
    h = limits.period
    q, v = rng.uniform(limits.lower, limits.upper), rng.uniform(limits.velocity_lower, limits.velocity_upper)
    viable = ~at(limits, q, v).relaxed
    assert viable.any()
    q, v = np.where(viable, q, 0.5 * (limits.lower + limits.upper)), np.where(viable, v, 0.0)
    habit = rng.integers(0, 2, N)  # half of the joints stay at one bound as long as they can
    side = rng.integers(0, 2, N)
    for _ in range(40):
        bounds = at(limits, q, v)
        assert not bounds.relaxed.any()
        assert (bounds.lower <= bounds.upper).all()
        assert (np.abs(bounds.lower) <= limits.acceleration + ROUNDING).all()
        assert (np.abs(bounds.upper) <= limits.acceleration + ROUNDING).all()
        a = np.where(habit, np.where(side, bounds.upper, bounds.lower), chosen(rng, bounds))
        least, most = extremes(q, v, a, h)
        assert (least >= limits.lower - ROUNDING).all()
        assert (most <= limits.upper + ROUNDING).all()
        q, v = q + v * h + 0.5 * a * h * h, v + a * h
        assert (v >= limits.velocity_lower - ROUNDING).all()
        assert (v <= limits.velocity_upper + ROUNDING).all()


def braked(q, v, a, brake, h) -> tuple[np.ndarray, np.ndarray]:
    """Largest q and velocity after one period at a and then braking as hard as can be, for ever."""
    _, most = extremes(q, v, a, h)
    end, speed = q + v * h + 0.5 * a * h * h, v + a * h
    return np.maximum(most, end + np.maximum(speed, 0.0) ** 2 / (2 * brake)), speed


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_no_acceleration_above_the_bound_would_do(seed):
    rng = np.random.default_rng(seed)
    limits = ranges(rng)
    h = limits.period
    q, v = rng.uniform(limits.lower, limits.upper), rng.uniform(limits.velocity_lower, limits.velocity_upper)
    fine = limits.acceleration * h <= np.minimum(-limits.velocity_lower, limits.velocity_upper)
    bounds = at(limits, q, v)
    for sign, bound in ((1.0, bounds.upper), (-1.0, -bounds.lower)):
        more = bound + 1e-4 * limits.acceleration
        end = limits.upper if sign > 0 else -limits.lower
        fastest = limits.velocity_upper if sign > 0 else -limits.velocity_lower
        reached, speed = braked(sign * q, sign * v, more, limits.acceleration, h)
        lost = (reached > end) | (speed > fastest) | (more > limits.acceleration)
        assert lost[fine & ~bounds.relaxed].all()


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_beyond_the_limits_the_bounds_are_never_empty_and_things_only_get_better(seed):
    rng = np.random.default_rng(seed)
    limits = ranges(rng)
    h = limits.period
    q = rng.uniform(limits.lower - 1, limits.upper + 1)
    v = rng.uniform(2 * limits.velocity_lower - 1, 2 * limits.velocity_upper + 1)
    before = at(limits, q, v)
    for _ in range(20):
        bounds = at(limits, q, v)
        assert (bounds.lower <= bounds.upper).all()
        assert (np.maximum(np.abs(bounds.lower), np.abs(bounds.upper)) <= limits.acceleration + ROUNDING).all()
        assert (bounds.beyond <= before.beyond + ROUNDING).all()
        assert (bounds.too_fast <= before.too_fast + ROUNDING).all()
        before = bounds
        a = chosen(rng, bounds)
        q, v = q + v * h + 0.5 * a * h * h, v + a * h


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_joints_are_counted_where_a_limit_had_to_give_way(seed):
    """Where braking as hard as can be, B and A being what stops and what slows a joint, does not do."""
    rng = np.random.default_rng(seed)
    limits = ranges(rng)
    viability, h = Viability(limits), limits.period
    q = rng.uniform(limits.lower - 0.1, limits.upper + 0.1)
    v = rng.uniform(1.5 * limits.velocity_lower, 1.5 * limits.velocity_upper)
    up, down = (np.minimum(limits.acceleration, s / h) for s in (-limits.velocity_lower, limits.velocity_upper))
    stops = [q + np.maximum(v, 0.0) ** 2 / (2 * up), q - np.maximum(-v, 0.0) ** 2 / (2 * down)]
    slowed = h * limits.acceleration
    fast = [v - slowed - limits.velocity_upper, limits.velocity_lower - v - slowed]
    worst = np.max([stops[0] - limits.upper, limits.lower - stops[1], *fast], axis=0)
    sure = np.abs(worst) > 1e-8
    q, v = np.where(sure, q, 0.5 * (limits.lower + limits.upper)), np.where(sure, v, 0.0)
    lower, upper, counted = viability.bounds(q, v)
    assert (lower <= upper).all()
    assert counted == np.count_nonzero(worst[sure] > 0.0)


def test_the_flag_says_by_how_much():
    limits = JointRange(("a", "b", "c"), -np.ones(3), np.ones(3), -np.ones(3), np.ones(3), np.full(3, 10.0), 1e-3)
    bounds = at(limits, np.array([0.0, 1.2, 0.0]), np.array([0.0, 0.0, 1.5]))
    assert bounds.relaxed.tolist() == [False, True, True]
    assert Viability(limits).bounds(np.array([0.0, 1.2, 0.0]), np.array([0.0, 0.0, 1.5]))[2] == 2
    assert_allclose(bounds.beyond, [0.0, 0.2, 0.0], atol=1e-15)
    assert_allclose(bounds.too_fast, [0.0, 0.0, 0.5 - 10.0 * 1e-3], atol=1e-15)
    assert_allclose(bounds.upper[1], 0.0, atol=1e-9)  # may not go further out
    assert_allclose(bounds.lower[1], -10.0)  # may come back as fast as it can
    assert_allclose(bounds.upper[2], -10.0)  # brakes


def test_free_joints_have_their_acceleration_alone():
    free = np.full(2, np.inf)
    limits = JointRange(("a", "b"), -free, free, -free, free, np.array([3.0, 7.0]), 1e-3)
    bounds = at(limits, np.array([1e3, -5.0]), np.array([40.0, -1e3]))
    assert_allclose(bounds.upper, [3.0, 7.0])
    assert_allclose(bounds.lower, [-3.0, -7.0])
    assert not bounds.relaxed.any()


def test_a_number_that_is_none_stays_one():
    limits = JointRange(("a", "b"), -np.ones(2), np.ones(2), -np.ones(2), np.ones(2), np.full(2, 10.0), 1e-3)
    bounds = at(limits, np.array([np.nan, 0.0]), np.array([0.0, 0.1]))
    assert np.isnan(bounds.lower[0]) and np.isnan(bounds.upper[0])
    assert np.isfinite([bounds.lower[1], bounds.upper[1]]).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"upper": [0.0]}, "upper - lower >="),
        ({"lower": [np.nan]}, "upper - lower >="),
        ({"velocity_upper": [0.0]}, "lower < 0 < upper"),
        ({"velocity_lower": [np.nan]}, "lower < 0 < upper"),
        ({"acceleration": [0.0]}, "acceleration of 'knee': expected a positive number"),
        ({"acceleration": [np.inf]}, "acceleration of 'knee': expected a positive number"),
        ({"period": 0.0}, "period: expected a positive number"),
        ({"upper": [1.0, 2.0]}, "expected 1 values"),
    ],
)
def test_refusals(change, message):
    good = {
        "lower": [0.0],
        "upper": [1.0],
        "velocity_lower": [-1.0],
        "velocity_upper": [1.0],
        "acceleration": [10.0],
        "period": 1e-3,
    }
    JointRange(("knee",), **good)
    with pytest.raises(ParamsError, match=message):
        JointRange(("knee",), **{**good, **change})


def test_a_range_in_which_a_joint_cannot_turn_is_refused_and_the_next_wider_one_is_not():
    h, a, down, up = 5e-3, 100.0, np.array([0.8]), np.array([0.5])
    room = needed(h, a, down, up)

    def make(width):
        return JointRange(("knee",), np.zeros(1), width, -down, up, np.full(1, a), h)

    with pytest.raises(ParamsError, match="in which it can turn"):
        make(0.99 * room)
    make(1.01 * room)
