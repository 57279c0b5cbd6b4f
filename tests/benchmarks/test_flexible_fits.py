"""Bounds on what any function of the signals can reach: closed forms on made-up rows."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.benchmarks.flexible_fits import LogRows, evaluated_errors, offset_of, repeatability, smallest

NOISE = 0.1
OFFSET = 0.3


def made_up(seed: int, noise: float = NOISE, offset: float = 0.0, bend: float = 0.0) -> LogRows:
    """Rows of tau = i - 0.2 sign(v) - 0.01 a + bend |v|^3 + offset + noise, on a motion that repeats every 2 s."""
    rng = np.random.default_rng(seed)
    time = np.arange(4000) * 0.01
    velocity, current = 1.0 + 0.8 * np.sin(np.pi * time), 2.0 * np.cos(2.0 * np.pi * time)
    acceleration, direction = 0.8 * np.pi * np.cos(np.pi * time), np.ones_like(time)
    direction[time % 4.0 >= 2.0] = -1.0
    velocity, acceleration = direction * velocity, direction * acceleration
    torque = current - 0.2 * direction - 0.01 * acceleration + bend * np.abs(velocity) ** 3 + offset
    torque = torque + noise * rng.standard_normal(time.size)
    slip = velocity / (0.1 + np.abs(velocity))
    size, nil = np.abs(current), np.zeros_like(time)
    one = np.ones_like(time)
    columns = (one, current, velocity, direction, size * direction, acceleration, slip, size * slip, size * current)
    signals = (current, velocity, acceleration, direction, nil, nil, nil, nil)
    return LogRows(torque, np.stack(columns, axis=-1), np.stack(signals, axis=-1), time)


def test_equal_motions_differ_by_the_noise() -> None:
    value, pairs = repeatability(made_up(0))
    assert pairs == 4000
    assert_allclose(value, NOISE, rtol=0.05)  # standard error of an RMS over 4000 pairs: 1.5 %


def test_motions_of_another_log_differ_by_its_offset_too() -> None:
    value, _ = repeatability(made_up(0), [made_up(1, offset=OFFSET)])
    assert_allclose(value, np.sqrt(NOISE**2 + OFFSET**2 / 2.0), rtol=0.05)


def test_without_equal_motions_there_is_no_figure() -> None:
    log = made_up(0)
    far = replace(log, signals=log.signals + 100.0)
    value, pairs = repeatability(log, [far])
    assert pairs == 0
    assert np.isnan(value)


def test_the_offset_of_a_log_is_its_constant() -> None:
    assert_allclose(offset_of(made_up(0, offset=OFFSET)), OFFSET, atol=0.02)


def test_a_fit_with_the_right_columns_leaves_the_noise() -> None:
    errors = evaluated_errors([made_up(1)], made_up(0))
    name = "load-dependent friction, inertia"
    assert_allclose(errors[name], NOISE, rtol=0.05)
    assert errors["friction"] > NOISE


def test_trees_find_a_function_that_no_column_has() -> None:
    errors = evaluated_errors([made_up(1, bend=0.3)], made_up(0, bend=0.3))
    linear = errors["all columns"]
    trees = min(value for key, value in errors.items() if "trees" in key)
    assert trees < 0.5 * linear
    assert trees == pytest.approx(NOISE, rel=0.3)  # trees are steps


def test_the_best_fit_is_another_than_the_one_compared_with() -> None:
    assert smallest({"published": 0.1, "a": 0.3, "b": 0.2}) == ("b", 0.2)
