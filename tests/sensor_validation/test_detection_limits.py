"""What cannot be told within 50 ms: a drifting gyro beside feet that turn, and a contact that is lost in silence."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

from drake_tc.errors import ParamsError
from drake_tc.sensor_validation.monitor_spec import (
    bias_deviation,
    bias_resolved_after,
)

SCENARIOS = Path(__file__).resolve().parents[2] / "diagrams" / "coman.scenario.yaml"

H, NOISE = 1e-3, 1.534e-5 / np.sqrt(12.0)
"""Period of the loop [s], and quantisation of the COMAN-like robot's motor encoders [rad]."""
DRIFT = np.deg2rad(1.0)
ASKED = 0.05


def test_beside_feet_that_stand_it_is_the_slope_of_a_straight_line():
    """The textbook's sigma sqrt(12/(N (N^2 - 1)))/h."""
    count = 51
    expected = NOISE * np.sqrt(12.0 / (count * (count**2 - 1.0))) / H
    assert_allclose(bias_deviation(0.05, H, NOISE), expected, rtol=1e-10)


def test_in_a_short_window_a_turn_hides_all_but_the_cubic_part():
    """sin(w t) = w t - (w t)^3/6 + ...: of a slope, {1, cos, sin} leave w^2 t^3/6 less a line, (T/2)^3 2/5 P3."""
    window, frequency, count = 0.05, 1.0, 50_001
    w = 2.0 * np.pi * frequency
    left = w**2 / 6.0 * (0.5 * window) ** 3 * 0.4 * np.sqrt(count / 7.0)
    assert_allclose(bias_deviation(window, window / (count - 1), NOISE, frequency), NOISE / left, rtol=0.01)


def test_least_squares_reaches_the_bound():
    window, frequency, draws = 0.6, 1.0, 4000
    t = np.arange(601) * H
    w = 2.0 * np.pi * frequency
    columns = np.stack([t, np.ones_like(t), np.cos(w * t), np.sin(w * t)], axis=1)
    noise = NOISE * np.random.default_rng(0).standard_normal((t.size, draws))
    angle = columns @ [DRIFT, 0.3, 0.02, -0.05]
    found = np.linalg.lstsq(columns, angle[:, None] + noise, rcond=None)[0][0]
    bound = bias_deviation(window, H, NOISE, frequency)
    assert_allclose(found.mean(), DRIFT, atol=5.0 * bound / np.sqrt(draws))
    assert_allclose(found.std(), bound, rtol=4.0 / np.sqrt(2.0 * draws))


def test_a_drift_of_one_degree_a_second_is_seen_in_50_ms_beside_feet_that_stand_and_not_beside_feet_that_turn():
    """Even with the encoders' quantisation as the only noise and the frequency of the turn known."""
    assert 3.0 * bias_deviation(ASKED, H, NOISE) < 0.05 * DRIFT
    assert bias_deviation(ASKED, H, NOISE, 1.0) > 2.0 * DRIFT
    assert bias_resolved_after(DRIFT, H, NOISE) < 0.01
    assert ASKED < bias_resolved_after(DRIFT, H, NOISE, 1.0) < 0.15


def test_a_bias_that_is_too_small_is_never_resolved():
    assert bias_resolved_after(1e-12, H, NOISE, 1.0, longest=0.1) == float("inf")


@pytest.mark.parametrize("arguments", [(0.0, H, NOISE), (0.05, -H, NOISE), (0.05, H, 0.0), (0.003, H, NOISE, 1.0)])
def test_windows_without_enough_samples_are_refused(arguments):
    with pytest.raises(ParamsError, match="bias_deviation: expected"):
        bias_deviation(*arguments)


def lift():
    """(T,) time, (T,) rise, of the `one_foot` scenario's minimum-jerk motion, and its fields."""
    scenarios = yaml.safe_load(SCENARIOS.read_text(encoding="utf-8"))
    begin, end = scenarios["one_foot"]["motion"]["swing"]["times"]
    height = scenarios["one_foot"]["motion"]["swing"]["offsets"][1][2]
    time = np.linspace(0.0, end - begin, 80_001)
    u = time / (end - begin)
    return time, height * u**3 * (10.0 + u * (6.0 * u - 15.0)), scenarios["stand"]


def recoil(load, stiffness) -> float:
    """How far a sole rises as it gives up a load, F/K [m]."""
    return load / stiffness


def rise_resolved_after(time, rise, load, stiffness, delay=0.0) -> float:
    """From when on the rise of a foot exceeds what a shift of load can cause [s]; infinite where it never does."""
    beyond = np.flatnonzero(rise > recoil(load, stiffness))
    return float(time[beyond[0]]) + delay if beyond.size else float("inf")


def test_a_rise_is_a_loss_of_contact_from_the_root_of_its_polynomial_on():
    time, rise, stand = lift()
    load, stiffness = 8.0, stand["ground"]["sole"]["stiffness"]
    bound = recoil(load, stiffness)
    assert bound == pytest.approx(8.0 / 3e5)
    roots = np.roots([6.0, -15.0, 10.0, 0.0, 0.0, -bound / rise[-1]])
    (first,) = (root.real for root in roots if abs(root.imag) < 1e-9 and 0.0 < root.real < 1.0)
    assert_allclose(rise_resolved_after(time, rise, load, stiffness), first * time[-1], atol=2e-5)
    assert rise_resolved_after(time, rise, 1e9, stiffness) == float("inf")


def test_a_contact_lost_in_silence_leaves_a_check_hardly_any_of_50_ms():
    """An F/T sensor may be off by 8 N before it is flagged (`force_offset`); the drives follow 15 ms late.

    Nine tenths of the 50 ms pass before even a check without any noise could tell the loss from a shift of load. With a
    load that is not known within 15 N, 5 % of what the robot weighs, all of them do.
    """
    time, rise, stand = lift()
    stiffness, delay = stand["ground"]["sole"]["stiffness"], stand["series_elastic"]["delay"]
    assert 0.9 * ASKED < rise_resolved_after(time, rise, 8.0, stiffness, delay) < ASKED
    assert rise_resolved_after(time, rise, 15.0, stiffness, delay) > ASKED
