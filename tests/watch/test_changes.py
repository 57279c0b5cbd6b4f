"""Which parameters changed, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from drake_tc.watch.changes import CHANGE_ODDS, Known, Shift, change_by_heat, session_deviation


def shift(difference, covariance, prior) -> Shift:
    """With nothing known of the differences between sessions, and half of the uncertainty in the stored values."""
    half = np.diag(0.5 * np.diag(covariance))
    return Shift(np.asarray(difference), half, covariance - half, np.zeros(len(difference)), np.asarray(prior))


def test_the_odds_of_one_change_are_those_of_two_gaussians():
    which, odds = shift([3.0], np.array([[1.0]]), [5.0]).best()
    wide = multivariate_normal(cov=26.0).logpdf(3.0) - multivariate_normal(cov=1.0).logpdf(3.0)
    assert which == () and odds[0] == pytest.approx(wide + CHANGE_ODDS, rel=1e-6)
    assert shift([9.0], np.array([[1.0]]), [5.0]).best()[0] == (0,)


def test_a_change_and_the_new_value_are_those_of_scalar_gaussians():
    one = Shift(np.array([9.0]), np.array([[0.4]]), np.array([[0.6]]), np.array([1.0]), np.array([5.0]))
    change, new = one.change(0, (0,)), one.new(0, (0,))
    assert change.value == pytest.approx(9.0 * 25.0 / 27.0) and change.deviation**2 == pytest.approx(25.0 * 2.0 / 27.0)
    assert new.value == pytest.approx(9.0 * 26.4 / 27.0) and new.deviation**2 == pytest.approx(26.4 * 0.6 / 27.0)


def test_of_two_correlated_parameters_only_the_one_that_changed_is_named():
    covariance = np.array([[1.0, 0.45], [0.45, 1.0]])
    assert shift([12.0, 0.0], covariance, [20.0, 20.0]).best()[0] == (0,)
    assert shift([2.0, 1.9], covariance, [20.0, 20.0]).best()[0] == ()


def test_changes_that_explain_the_same_difference_are_alternatives():
    along = np.array([[100.0, -99.99], [-99.99, 100.0]])
    found = Shift(np.array([3.0, 3.0]), 1e-4 * np.eye(2), along, np.zeros(2), np.array([20.0, 20.0]))
    (one,) = found.best()[0]
    assert found.alternatives((one,)) == [(one, 1 - one)]


def test_without_a_change_no_more_than_a_hundredth_of_the_draws_names_one():
    rng = np.random.default_rng(0)
    mixing = rng.standard_normal((6, 6))
    covariance = mixing @ mixing.T + np.eye(6) * 6.0
    draws = rng.multivariate_normal(np.zeros(6), covariance, size=600)
    prior = 10.0 * np.sqrt(np.diag(covariance))
    assert np.mean([bool(shift(d, covariance, prior).best()[0]) for d in draws]) <= 0.01


def test_an_interval_that_ends_at_a_bound_counts_by_its_longer_side():
    assert Known.of(0.1, (0.0, 0.5)).deviation == pytest.approx(0.4 / 1.96)


def test_friction_differs_between_sessions_and_with_the_temperature_and_the_load_does_not():
    assert session_deviation("coulomb", 5.0, 0.1) == pytest.approx(0.5)
    for key, least, most in (("viscous", 0.03, 0.07), ("coulomb", 0.0, 0.04)):  # loss of friction for 1 K, of oil
        mean, deviation = change_by_heat(key, 5.0, 4.0)
        assert mean < 0.0 and all(abs(mean + 20.0 * loss) < 2.0 * deviation for loss in (0.0, least, most))
        assert change_by_heat(key, 5.0, -4.0) == (-mean, deviation)
    assert change_by_heat("payload", 5.0, 10.0) == (0.0, 0.0)


def test_friction_that_grows_as_the_joint_warms_is_a_change_and_less_of_it_is_none():
    """Of 5 N m, 2 K warmer: the mean of what heat does is taken off before a change is looked for."""
    mean, deviation = change_by_heat("viscous", 5.0, 2.0)
    cold = Shift(np.zeros(1), 1e-4 * np.eye(1), 1e-4 * np.eye(1), np.array([deviation**2]), np.array([1.5]))
    less, more = (replace(cold, difference=np.array([d]), expected=np.array([mean])) for d in (-1.0, 1.0))
    assert less.best()[0] == () and more.best()[0] == (0,)
    # the joint's own change beside heat: s^2/(s^2 + S) (d - h)
    share = 1.5**2 / (1.5**2 + 2e-4 + deviation**2)
    assert more.change(0, (0,)).value == pytest.approx(share * (1.0 - mean))


def found_beside(gain: float, effect: float, correlation: float) -> Shift:
    """A drive gain that differs by `gain`, and an effect of two sizes that the new logs have, in deviations."""
    covariance = np.array([[1.0, correlation, 0.0], [correlation, 1.0, 0.0], [0.0, 0.0, 1.0]])
    prior = np.array([20.0, 20.0, 20.0])
    return Shift(
        np.array([gain, effect, effect]), np.diag([1e-4, 0.0, 0.0]), covariance, np.zeros(3), prior, together=((1, 2),)
    )


def test_the_sizes_of_an_effect_change_together_with_the_odds_of_one_change():
    one = found_beside(0.0, 9.0, 0.0)
    which, odds = one.best()
    spread = np.diag([401.0, 401.0])
    gain = multivariate_normal(cov=spread).logpdf([9.0, 9.0]) - multivariate_normal(cov=np.eye(2)).logpdf([9.0, 9.0])
    assert which == (1, 2) and odds[1:] == pytest.approx([gain + CHANGE_ODDS] * 2, rel=1e-6)


def test_an_effect_that_is_there_only_if_the_stored_gain_is_wrong_too_is_not_there():
    """New logs that tell the sum of both alone: that both are off by six deviations contradicts the stored gain."""
    along = np.array([[1.0, -0.9999], [-0.9999, 1.0]])
    difference, nothing = np.array([6.0, -6.0]), np.zeros(2)
    alone = Shift(difference, 1e-4 * np.eye(2), along, np.array([1e4, 0.0]), np.array([20.0, 20.0]), together=((1,),))
    assert alone.best()[0] == (1,)  # a gain that may be anything contradicts nothing
    stored = replace(alone, between=nothing, difference=np.array([3.0, -3.0]))
    assert stored.best()[0] == () and stored.best()[1][1] < 0.0


def test_what_an_effect_leaves_open_of_other_parameters_is_no_change_of_them():
    """A gain that is larger by 8 deviations beside a payload whose inertia would do that, and one whose would not."""
    free = found_beside(8.0, 9.0, 0.0)
    assert free.best()[0] == (0, 1, 2)
    assert replace(free, opened={1: np.array([8.0, 0.0, 0.0])}).best()[0] == (1, 2)
    assert replace(free, opened={1: np.array([0.1, 0.0, 0.0])}).best()[0] == (0, 1, 2)
