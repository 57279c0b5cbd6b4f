"""Plateaus at the end of a sensor's range, and zeros that no sensor read, are told from those that a joint makes."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from drake_tc.logs.checks.jumps import EDGE, saturated_position, saturated_torque
from drake_tc.logs.checks.outliers import unanswered_zeros, zero_rows

T = 2e-3 * np.arange(4000)
SMOOTH = 0.6 * np.sin(2.0 * T) + 0.1 * np.sin(5.0 * T)
EFFORT = 0.02 * np.sin(3.1 * T)


def encoder(values, step=1e-4, noise=5e-5):
    rng = np.random.default_rng(1)
    return np.round((values + noise * rng.standard_normal(values.size)) / step) * step


@pytest.mark.parametrize("limit", [0.2, 0.4, 0.55])
@pytest.mark.parametrize("servo", [True, False])
def test_an_encoder_that_ends_is_found(limit, servo):
    values = encoder(SMOOTH).clip(-limit, limit)
    found = saturated_position(values, SMOOTH + EFFORT if servo else None, 1e-4)
    cut = np.abs(SMOOTH) > limit + 1e-3
    assert (found[cut]).all()
    kept = np.abs(SMOOTH) < limit - 1.5 * 2e-3 * (EDGE + 3)
    assert not found[kept].any()


@pytest.mark.parametrize("limit", [2.0, 5.0, 9.0])
def test_a_torque_sensor_that_ends_is_found_by_its_noise(limit):
    torque = 10.0 * np.sin(3.1 * T) + 0.1 * np.random.default_rng(2).standard_normal(T.size)
    found = saturated_torque(torque.clip(-limit, limit))
    assert found[np.abs(torque) > limit + 0.3].all()
    assert not found[np.abs(torque) < limit - 2.0].any()
    assert not saturated_torque(torque).any()


def test_joints_that_turn_rest_or_stick_are_left_alone():
    sticking = np.maximum.accumulate(SMOOTH[:800])
    cases = {
        "turns on a coarse grid": encoder(SMOOTH, 0.01, 0.0),
        "rests at its largest": np.concatenate([SMOOTH[:400], np.full(1500, SMOOTH[:400].max()), SMOOTH[400:2000]]),
        "sticks where it turned": np.concatenate([sticking, SMOOTH[800:3000]]),
        "does not move": np.full(T.size, 0.3),
    }
    for name, values in cases.items():
        command = values + 0.02 * np.sin(3.1 * T[: values.size])
        assert not saturated_position(encoder(values), command, 1e-4).any(), name


def servo(goals, dead, bandwidth, step=1e-4):
    """(position, command): every 2 s a step of the command to the next goal, answered after a dead time [s]."""
    command = np.array([goals[min(int(t / 2.0), len(goals) - 1)] for t in HOLD])
    late = np.concatenate([np.full(round(dead / 2e-3), command[0]), command])[: HOLD.size]
    position, q, v = np.empty(HOLD.size), float(goals[0]), 0.0
    for i, goal in enumerate(late):
        v += 2e-3 * (bandwidth**2 * (goal - q) - 2.0 * bandwidth * v)
        q += 2e-3 * v
        position[i] = q
    return np.round(position / step) * step, command


HOLD = 2e-3 * np.arange(10000)
GOALS = [(0, 0.5, 1, 0.5, 0, 1, 0, 1), (0, 0.1, 0.05, 0.1, 0.05, 1, 0.05, 0.1, 0.05, 0.1), (0, 1, 0, 1, 0)]


@pytest.mark.parametrize("goals", GOALS)
@pytest.mark.parametrize("dead", [0.0, 0.01, 0.03, 0.06])
@pytest.mark.parametrize("bandwidth", [25.0, 60.0])
def test_a_servo_that_holds_its_largest_goal_until_it_answers_the_next_is_left_alone(goals, dead, bandwidth):
    position, command = servo(goals, dead, bandwidth)
    assert not saturated_position(position, command, 1e-4).any()
    assert not saturated_position(-position, -command, 1e-4).any()


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("dead", [0.01, 0.03])
def test_an_encoder_that_ends_before_the_goals_of_such_a_servo_is_found(sign, dead):
    position, command = servo(GOALS[0], dead, 60.0)
    limit = 0.8
    found = saturated_position(sign * position.clip(None, limit), sign * command, 1e-4)
    cut = position > limit + 1e-3
    beside = np.convolve(position >= limit - 1e-3, np.ones(2 * EDGE + 3), "same") > 0.0
    assert found[cut].all() and not found[~beside].any()


def test_a_servo_that_sags_at_all_its_goals_is_left_alone():
    """Its weight and its friction keep it from every goal, by up to 0.02 rad."""
    position, command = servo(GOALS[0], 0.03, 60.0)
    assert not saturated_position(position - 0.02 * position, command, 1e-4).any()
    assert not saturated_position(np.round((position - 0.02 * np.cos(position)) / 1e-4) * 1e-4, command, 1e-4).any()


def test_a_torque_that_rests_at_its_largest_is_no_end_of_a_range():
    """A simulated joint that holds a weight, without noise: it comes to rest smoothly."""
    s = np.clip((T - 1.0) / 3.0, 0.0, 1.0)
    assert not saturated_torque(5.0 * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)).any()


@pytest.mark.parametrize(("begin", "count"), [(300, 1), (300, 3), (900, 40), (1500, 400), (3990, 10), (0, 20)])
@pytest.mark.parametrize("offset", [0.0, 1.0])
def test_what_drops_out_is_found_exactly(begin, count, offset):
    values = SMOOTH + offset + 1e-4
    before = values.copy()
    values[begin : begin + count] = 0.0
    found = zero_rows(values)
    assert_array_equal(np.flatnonzero(found), np.arange(begin, begin + count))
    assert_array_equal(before[~found], values[~found])


def test_zeros_that_belong_to_the_signal_stay():
    rng = np.random.default_rng(0)
    cases = {
        "crosses zero on a coarse grid": np.round(SMOOTH / 0.01) * 0.01,
        "square wave": 0.5 * (np.sin(3.0 * T) > 0.0),
        "steps to zero and rests": np.where((T > 2.0) & (T < 4.0), 0.0, 0.5),
        "dead zone": np.sign(SMOOTH) * np.maximum(np.abs(SMOOTH) - 0.2, 0.0),
        "noise in whole numbers": np.round(rng.standard_normal(T.size) * 2.0),
        "mostly zero": np.where(T % 1.0 < 0.6, 0.0, 1.0 + SMOOTH),
    }
    for name, values in cases.items():
        assert not zero_rows(values).any(), name


def test_a_command_of_zero_that_was_sent_is_answered_and_stays():
    command = SMOOTH + 1.0
    position = command.copy()
    command[1000:1100] = 0.0
    assert_array_equal(np.flatnonzero(unanswered_zeros(command, position)), np.arange(1000, 1100))
    single = position.copy()
    single[1000] = 0.0
    assert_array_equal(np.flatnonzero(unanswered_zeros(single, position)), [1000])
    answering = position.copy()
    answering[1000:1100] *= np.exp(-np.arange(100) / 20.0)
    assert not unanswered_zeros(command, answering).any()
    elsewhere = command.copy()
    elsewhere[1100:] -= 0.7  # does not come back to where it was going
    assert not unanswered_zeros(elsewhere, position).any()
