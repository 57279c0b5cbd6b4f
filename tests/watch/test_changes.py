"""Which parameters changed, against closed forms."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from drake_tc.watch.changes import CHANGE_ODDS, Known, Shift, heat_deviation, session_deviation


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
    assert heat_deviation("coulomb", 5.0, -4.0) == pytest.approx(1.0)
    assert heat_deviation("payload", 5.0, 10.0) == 0.0
