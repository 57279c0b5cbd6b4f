"""Sigma and its roots."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.errors import ParamsError
from drake_tc.tsid.robust.scaled import TorqueError, scaled
from drake_tc.tsid.rows import LeastSquares, Polytope

from .robust_problems import random_covariance


@pytest.fixture
def covariance():
    rng = np.random.default_rng(3)
    return random_covariance(rng, 10.0 ** rng.uniform(-2, 2, 7))


def test_root_gives_the_covariance(covariance):
    for error in (TorqueError(covariance), TorqueError(np.diagonal(covariance))):
        assert_allclose(error.root @ error.root.T, error.covariance, rtol=1e-12, atol=1e-12 * covariance.max())


def test_row_sigma_is_that_of_the_rows(covariance):
    rows = np.random.default_rng(0).normal(size=(9, 7))
    for error in (TorqueError(covariance), TorqueError(np.diagonal(covariance))):
        assert_allclose(error.row_sigma(rows), np.sqrt(np.diagonal(rows @ error.covariance @ rows.T)), rtol=1e-12)


def test_axes_follow_order_and_units_of_the_joints(covariance):
    order, unit = np.array([4, 0, 6, 2, 1, 5, 3]), np.array([1.0, 1e3, 1e-2, 1.0, 7.0, 1.0, 0.1])
    root = TorqueError(covariance).root
    assert_allclose(
        TorqueError(covariance[np.ix_(order, order)]).root, root[np.ix_(order, order)], rtol=1e-9, atol=1e-9
    )
    changed = TorqueError(covariance * np.outer(unit, unit)).root
    assert_allclose(changed / unit[:, None], root, rtol=1e-9, atol=1e-9)


def test_singular_covariance():
    common = np.array([1.0, 2.0, 3.0, 0.0])
    error = TorqueError(np.outer(common, common))
    assert error.root.shape == (4, 1)
    assert_allclose(error.root @ error.root.T, np.outer(common, common), atol=1e-12)
    assert np.all(error.scale > 0.0)


def test_rows_that_do_not_err():
    error = TorqueError(np.array([0.25, 0.0, 4.0]))
    matrix = np.vstack([np.eye(3), [1.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    polytope = Polytope(matrix, np.full(5, -1.0), np.full(5, 2.0), bounds=3)
    problem = scaled(LeastSquares(np.zeros((0, 3)), np.zeros(0)), polytope, error)
    assert_allclose(problem.certain, [False, True, False, False, True])
    assert np.all(np.isfinite(problem.limits.matrix))
    assert_allclose(problem.limits.matrix[:3], np.eye(3), rtol=1e-15)
    assert_allclose(np.linalg.norm(problem.noise, axis=1), [1.0, 0.0, 1.0, 1.0, 0.0], rtol=1e-15)


@pytest.mark.parametrize(
    ("covariance", "why"),
    [
        (np.zeros((2, 3)), "shape"),
        (np.zeros(0), "shape"),
        (np.array([1.0, np.nan]), "finite"),
        (np.array([1.0, -1.0]), "variances >= 0"),
        (np.array([[1.0, 0.5], [0.4, 1.0]]), "symmetric"),
        (np.array([[1.0, 2.0], [2.0, 1.0]]), "positive semidefinite"),
    ],
)
def test_refusals(covariance, why):
    with pytest.raises(ParamsError, match=why):
        TorqueError(covariance)
