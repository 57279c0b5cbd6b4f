"""Factors and inverses of small matrices against their defining equations, and what they say of matrices without."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from drake_tc.kernels.linear_algebra import factor_into, inverse_factor

SIZES = [1, 2, 3, 4, 5, 8, 9, 30, 36]
ROUNDING = 1e-12
"""Of matrices whose condition number is below 1e3."""


def positive(n, seed=0):
    rows = np.random.default_rng(seed).normal(size=(2 * n, n))
    return rows.T @ rows + np.eye(n)


def tree_matrix(parents, seed=0):
    """A matrix like that of a tree's inertia: an entry where one joint carries the other, else exactly 0."""
    rng, n = np.random.default_rng(seed), len(parents)
    factor = np.zeros((n, n))
    for joint in range(n):
        factor[joint, joint] = rng.uniform(1.0, 2.0)
        other = parents[joint]
        while other >= 0:
            factor[joint, other] = rng.normal()
            other = parents[other]
    return factor.T @ factor, factor


@pytest.mark.parametrize("n", SIZES)
def test_the_upper_factor_gives_the_matrix_back(n):
    matrix, factor = positive(n), np.full((n, n), np.nan)
    assert factor_into(factor, matrix)
    upper = np.triu(factor)
    assert_allclose(upper.T @ upper, matrix, rtol=0, atol=ROUNDING * n)
    assert np.all(upper.diagonal() > 0.0)


@pytest.mark.parametrize("n", SIZES)
def test_the_inverse_factor_whitens_the_matrix(n):
    matrix = positive(n)
    inverse = inverse_factor(matrix)
    assert_array_equal(inverse, np.triu(inverse))
    assert_allclose(inverse @ matrix @ inverse.T, np.eye(n), rtol=0, atol=ROUNDING)
    assert_allclose(inverse.T @ inverse, np.linalg.inv(matrix), rtol=0, atol=ROUNDING)


def test_branches_that_share_no_joint_stay_apart():
    """Elimination from the leaves fills nothing in: the inverse has entries where one joint carries the other alone."""
    matrix, factor = tree_matrix((-1, 0, 1, 0, 3, 3, 5, 0, 7, 8, 8))
    inverse = inverse_factor(matrix)
    assert_allclose(inverse, np.linalg.inv(factor).T, rtol=0, atol=ROUNDING * np.abs(inverse).max())
    assert_array_equal(inverse != 0.0, factor.T != 0.0)


@pytest.mark.parametrize("wrong", [np.diag([1.0, -1.0, 1.0]), np.ones((3, 3)), np.full((3, 3), np.nan)])
def test_a_matrix_without_a_factor_is_told(wrong):
    assert not factor_into(np.empty((3, 3)), wrong)
    assert np.isnan(inverse_factor(wrong)).all()
