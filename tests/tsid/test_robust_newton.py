"""Newton's method from starts that are far off, and single steps against a QP solver of Drake's."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import minimize

from drake_tc.tsid.qp import Outcome, QpSolver, QuadraticProgram, solver
from drake_tc.tsid.robust.convex import FREE, ActiveSet, SolverMeans, minimise, plain
from drake_tc.tsid.robust.scaled import Budget, ScaledRows, nothing, null_basis, scaled
from drake_tc.tsid.rows import LeastSquares

from .robust_problems import random_problem

QP = solver()


class Forbidden:
    def solve(self, problem, start=None):
        raise AssertionError("no program was needed")


def means(accuracy: float, qp: QpSolver) -> SolverMeans:
    return SolverMeans(qp, accuracy, Budget().started())


@pytest.mark.parametrize("far", [1.0, 60.0, 1e3, 1e4])
@pytest.mark.parametrize("seed", range(5))
def test_risk_is_minimised_from_far_outside(seed, far):
    """Without limits, sides up to 1e4 sigmas away on the wrong side; scipy finds the same minimum from nearby."""
    _, polytope, error = random_problem(seed, n=6, rows=10, near=4.0)
    problem = scaled(nothing(6), polytope, error)
    rows = problem.erring
    free = ScaledRows(rows.matrix, np.full(rows.lower.size, -np.inf), np.full(rows.lower.size, np.inf))
    objective = plain(nothing(6), free).with_risk(rows, 1.0)
    begin = far * np.random.default_rng(seed).normal(size=6)
    if far >= 60.0:
        assert rows.miss(begin) > 40.0
    found = minimise(objective, begin, FREE, means(1e-9, Forbidden()))
    assert found.converged
    assert found.iterations < 60

    def value(x):
        point = objective.at(x)
        return point.value, point.gradient

    other = minimize(value, found.x + 0.1, jac=True, method="BFGS", options={"gtol": 1e-7})
    assert_allclose(found.risk, other.fun, rtol=1e-6)


@pytest.mark.parametrize("far", [60.0, 1e4])
@pytest.mark.parametrize("seed", range(5))
def test_limits_are_reached_from_far_outside(seed, far):
    cost, polytope, error = random_problem(seed, n=6, rows=10)
    problem = scaled(cost, polytope, error)
    objective = plain(problem.cost, problem.limits).with_risk(problem.erring, 1e-2)
    begin = far * np.random.default_rng(seed).normal(size=6)
    found = minimise(objective, begin, FREE, means(1e-10, QP))
    near = minimise(objective, np.zeros(6), FREE, means(1e-10, QP))
    assert found.outcome is Outcome.SOLVED
    assert found.converged
    assert problem.limits.miss(found.x) < 1e-6
    assert_allclose(found.value, near.value, rtol=1e-7)


def test_no_program_where_the_newton_step_stays_inside():
    _, polytope, error = random_problem(0)
    problem = scaled(nothing(6), polytope, error)
    objective = plain(nothing(6), problem.limits).with_risk(problem.erring, 1.0)
    inside = minimise(objective, np.zeros(6), FREE, means(1e-6, QP)).x
    found = minimise(objective, inside + 0.01, FREE, means(1e-9, Forbidden()))
    assert found.converged
    assert found.programs == 0


@pytest.mark.parametrize("seed", range(10))
def test_step_is_that_of_another_solver(seed):
    """A quadratic objective takes one step."""
    rng = np.random.default_rng(seed)
    n, m = 7, 15
    cost = LeastSquares(rng.normal(size=(n, n)), 3.0 * rng.normal(size=n))
    rows = ScaledRows(rng.normal(size=(m, n)), -rng.uniform(0.0, 1.0, m), rng.uniform(0.0, 1.0, m))
    wrong = ActiveSet(np.array([1, 5]), np.array([1, -1]), np.zeros(2))
    program = plain(cost, rows, damping=0.1)
    hessian, gradient = program.at(np.zeros(n)).hessian, program.at(np.zeros(n)).gradient
    assert_allclose(gradient, -2.0 * cost.matrix.T @ cost.target)
    reference = solver("clarabel").solve(QuadraticProgram(hessian, gradient, rows.matrix, rows.lower, rows.upper))
    for active_set in (FREE, wrong):
        step = minimise(program, np.zeros(n), active_set, SolverMeans(QP, 0.0, Budget(1).started()))
        assert step.outcome is Outcome.SOLVED
        assert step.iterations == 1
        assert_allclose(step.x, reference.x, atol=1e-5)
        force = np.zeros(m)
        force[step.active_set.rows] = step.active_set.multipliers
        balance = hessian @ step.x + gradient + rows.matrix.T @ force
        assert_allclose(balance, 0.0, atol=1e-9 * np.abs(gradient).max())
        assert np.all(step.active_set.multipliers * step.active_set.sides >= 0.0)
        ends = np.where(step.active_set.sides > 0, rows.upper[step.active_set.rows], rows.lower[step.active_set.rows])
        assert_allclose((rows.matrix @ step.x)[step.active_set.rows], ends, atol=1e-8)
        assert rows.miss(step.x) < 2e-8


def test_flat_risk_ends():
    """Rows on one side only: R falls for ever, ever less."""
    rows = ScaledRows(np.eye(3), np.zeros(3), np.full(3, np.inf))
    free = ScaledRows(rows.matrix, np.full(3, -np.inf), np.full(3, np.inf))
    objective = plain(nothing(3), free).with_risk(rows, 1.0)
    found = minimise(objective, -50.0 * np.ones(3), FREE, means(1e-8, QP))
    assert found.converged
    assert 0.0 <= found.risk < 1e-6


def test_null_basis():
    rng = np.random.default_rng(0)
    for rows, n, rank in ((5, 8, 5), (8, 5, 3), (33, 30, 24), (4, 4, 4), (0, 3, 0)):
        matrix = rng.normal(size=(rows, rank)) @ rng.normal(size=(rank, n)) * 10.0 ** rng.uniform(-2, 0, (rows, 1))
        basis = null_basis(matrix)
        assert basis.shape == (n, n - rank)
        assert_allclose(basis.T @ basis, np.eye(n - rank), atol=1e-12)
        assert_allclose(matrix @ basis, 0.0, atol=1e-12 * max(1.0, np.abs(matrix).max(initial=0.0)))


def test_gradient_of_the_objective():
    cost, polytope, error = random_problem(3)
    problem = scaled(cost, polytope, error)
    linear = np.arange(6.0)
    objective = plain(problem.cost, problem.limits, linear=linear).with_risk(problem.erring, 0.7)
    x, h = np.random.default_rng(0).normal(size=6), 1e-6
    by_difference = [(objective.at(x + s).value - objective.at(x - s).value) / (2 * h) for s in h * np.eye(6)]
    assert_allclose(objective.at(x).gradient, by_difference, rtol=1e-6, atol=1e-6)
    assert LeastSquares(problem.cost.matrix, problem.cost.target)(x) <= objective.at(x).value - linear @ x
