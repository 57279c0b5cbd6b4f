"""Criteria of a robot's motion: slopes against differences, units, and what they weigh."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.experiments.design.robot_goal import a_optimality, d_optimality, e_optimality, standard_errors

GROUPS = (np.arange(3), np.arange(3, 5))


def information(seed=0, size=5):
    z = np.random.default_rng(seed).normal(size=(40, size)) * np.arange(1.0, size + 1.0)
    return z.T @ z


def criteria():
    return [d_optimality, e_optimality, a_optimality(standard_errors(information(1)), GROUPS)]


@pytest.mark.parametrize("number", range(3))
def test_the_slope_by_the_information_is_that_of_differences(number):
    criterion, at = criteria()[number], information()
    _, slope = criterion(at)
    change = np.random.default_rng(2).normal(size=at.shape)
    change = 1e-5 * (change + change.T)
    expected = 0.5 * (criterion(at + change)[0] - criterion(at - change)[0])
    assert_allclose(np.sum(slope * change), expected, rtol=1e-6)  # of a central difference, error of order 1e-10


def test_intervals_are_counted_in_units_of_the_default():
    at = information()
    criterion = a_optimality(standard_errors(at), GROUPS)
    assert_allclose(criterion(at)[0], 0.0, atol=1e-10)
    assert_allclose(criterion(4.0 * at)[0], 10.0 * np.log(2.0), rtol=1e-10)  # 2 P log 2, all half as wide
    turned = np.diag([1.0, 10.0, 0.1, 3.0, 7.0])
    changed = a_optimality(standard_errors(turned @ at @ turned), GROUPS)
    assert_allclose(changed(2.0 * turned @ at @ turned)[0], criterion(2.0 * at)[0], rtol=1e-9)


def test_a_group_of_few_parameters_weighs_as_much_as_one_of_many():
    """The determinant prefers narrower intervals of the three to those of the two; the mean of groups does not."""
    many, few = np.diag([4.0, 4.0, 4.0, 0.25, 0.25]), np.diag([0.25, 0.25, 0.25, 4.0, 4.0])
    criterion = a_optimality(np.ones(5), GROUPS)
    assert d_optimality(many)[0] > d_optimality(few)[0] + 1.0
    assert_allclose(criterion(many)[0], criterion(few)[0], rtol=1e-12)
    assert criterion(np.eye(5))[0] > criterion(many)[0]
