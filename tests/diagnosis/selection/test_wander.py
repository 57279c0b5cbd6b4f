"""A constant beside noise that wanders: against the closed form of a random walk, and through the confirmation."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.root_mean_square import rms
from drake_tc.diagnosis.selection.wander import level_over_wander, without_wander
from drake_tc.diagnosis.thresholds import WANDER_SECONDS

from .runs import BIAS, PLAIN, offset
from .test_confirmation import confirmed, reasons

RUNS, BLOCKS, ROWS = 2, 60, 25
RUN = np.repeat(np.arange(RUNS), BLOCKS * ROWS)
BLOCK = np.repeat(np.arange(RUNS * BLOCKS), ROWS)


def walks(rng: np.random.Generator) -> np.ndarray:
    """(N,) a random walk of unit rate in each run, from 0, and white noise."""
    steps = rng.standard_normal((RUNS, BLOCKS * ROWS))
    return np.asarray(np.cumsum(steps, axis=1).ravel() + 3.0 * rng.standard_normal(RUN.size))


def test_the_mean_of_random_walks_is_one_standard_deviation_on_average():
    rng = np.random.default_rng(3)
    levels, deviations = [], []
    for _ in range(600):
        noise = walks(rng)
        bias = np.full(RUN.size, noise.mean())
        levels.append(abs(noise.mean()))
        deviations.append(levels[-1] / level_over_wander(bias, noise - bias, RUN, BLOCK))
    assert rms(np.array(deviations)) == pytest.approx(rms(np.array(levels)), rel=0.1)


def test_noise_that_does_not_wander_leaves_a_level_certain():
    white = np.random.default_rng(4).standard_normal(RUN.size)
    assert level_over_wander(np.full(RUN.size, 0.5), white, RUN, BLOCK) > 20.0


def test_what_turns_with_the_motion_is_no_level():
    rng = np.random.default_rng(5)
    wave = np.sin(np.arange(RUN.size) / 40.0)
    assert level_over_wander(wave, walks(rng), RUN, BLOCK) == np.inf
    assert level_over_wander(wave + 0.5, walks(rng), RUN, BLOCK) == np.inf
    assert np.isfinite(level_over_wander(wave + 1.0, walks(rng), RUN, BLOCK))


TIME = np.tile(np.arange(BLOCKS * ROWS) * 0.5 / ROWS, RUNS)


def test_a_line_between_knots_is_taken_off_whole_in_each_run():
    rng = np.random.default_rng(7)
    knots = np.arange(0.0, BLOCKS * 0.5 + WANDER_SECONDS, WANDER_SECONDS)
    line = np.concatenate([np.interp(TIME[r == RUN], knots, rng.standard_normal(knots.size)) for r in range(RUNS)])
    seen = (rng.uniform(size=line.size) < 0.3) | (TIME == 0.0)  # the rows in which a joint slides
    assert_allclose(without_wander(line[seen], TIME[seen], RUN[seen]), 0.0, atol=1e-6)  # the ridge leaves 1e-9


def test_little_of_a_random_walk_is_left_and_most_of_what_follows_a_motion():
    """A line through the values of the walk at the knots would leave s^2 D/6; the best line leaves less."""
    rng = np.random.default_rng(8)
    walk = np.cumsum(rng.standard_normal((RUNS, BLOCKS * ROWS)), axis=1).ravel()  # s^2 = 1 per row
    between = WANDER_SECONDS * ROWS / 0.5
    assert 0.3 * np.sqrt(between / 6.0) < rms(without_wander(walk, TIME, RUN)) < np.sqrt(between / 6.0)
    stroke = np.sin(2.0 * np.pi * 0.5 * TIME)
    assert rms(without_wander(stroke, TIME, RUN)) > 0.7 * rms(stroke)


def test_levels_of_two_signs_count_by_their_size():
    noise = walks(np.random.default_rng(6))
    same, turned = np.ones(RUN.size), np.where(RUN == 0, 1.0, -1.0)
    assert level_over_wander(turned, noise, RUN, BLOCK) == pytest.approx(level_over_wander(same, noise, RUN, BLOCK))


@pytest.mark.parametrize(("size", "reason"), [(0.1, {"torque_sensor_bias": "may_be_wander"}), (4.0, {})])
def test_a_bias_is_withdrawn_where_the_torque_wanders_as_far(size, reason):
    """The same walk in every run, so that all runs agree with the bias: only its size tells."""

    def wanders(m):
        walk = np.cumsum(np.random.default_rng(7).standard_normal(m.time.size))
        walk -= walk.mean()
        return 0.6 * walk / rms(walk) + size

    joint = replace(PLAIN, extra=wanders)
    found = confirmed([joint] * 3, [joint], BIAS)
    assert reasons(found) == reason


def test_a_bias_without_wander_holds():
    joint = replace(PLAIN, extra=offset(0.1))
    assert reasons(confirmed([joint] * 3, [joint], BIAS)) == {}
