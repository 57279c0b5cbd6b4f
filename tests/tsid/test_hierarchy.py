"""Strict priorities against weights that are far apart, and what each level may and may not change."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.tsid.priorities import Priorities, Robustness
from drake_tc.tsid.qp import Outcome, QuadraticProgram, solver
from drake_tc.tsid.robust.scaled import Options, TorqueError, scaled
from drake_tc.tsid.rows import LeastSquares, Polytope

from .individual_risk import individual_risk
from .robust_problems import random_polytope


def solved(levels, polytope, error):
    """The levels, the first with the highest priority."""
    costs = [level for level in levels if isinstance(level, LeastSquares)]
    whole = LeastSquares(*map(np.concatenate, zip(*costs, strict=True)))
    places = {number: isinstance(level, LeastSquares) for number, level in enumerate(levels, 1)}
    tasks = tuple(number for number, is_task in places.items() if is_task)
    robustness = next((number for number, is_task in places.items() if not is_task), None)
    sizes = [cost.target.size for cost in costs]
    return Priorities(tasks, robustness).solve(scaled(whole, polytope, error), sizes, solver(), Options(accuracy=1e-9))


def values(levels, polytope, error):
    """Cost or R_ind of each level at the solution of all."""
    torque = solved(levels, polytope, error).torque
    return [
        level(torque) if isinstance(level, LeastSquares) else individual_risk(polytope, torque, error).value
        for level in levels
    ]


def problem(seed, n=9, sizes=(2, 3, 2), near=6.0):
    rng = np.random.default_rng(seed)
    polytope, inside, sigma = random_polytope(rng, n, 6, near=near)
    levels = []
    for size in sizes:
        matrix = rng.normal(size=(size, n)) / sigma
        levels.append(LeastSquares(matrix, matrix @ (inside + 2.0 * sigma * rng.normal(size=n))))
    return levels, polytope, TorqueError(sigma**2)


def one_after_the_other(levels, polytope, error):
    """By Clarabel: each level with those above as equalities, in units of sigma."""
    sigma, values = error.sigma, []
    rows, lower, upper = polytope.matrix * sigma, polytope.lower, polytope.upper
    length = np.linalg.norm(rows, axis=1)
    rows, lower, upper = rows / length[:, None], lower / length, upper / length
    for level in levels:
        matrix = level.matrix * sigma
        hessian = 2.0 * matrix.T @ matrix + 1e-9 * np.eye(len(sigma))
        program = QuadraticProgram(hessian, -2.0 * matrix.T @ level.target, rows, lower, upper)
        x = solver("clarabel").solve(program).x
        values.append(level(x * sigma))
        rows = np.vstack([rows, matrix])
        lower, upper = (np.append(side, matrix @ x) for side in (lower, upper))
    return values


@pytest.mark.parametrize("seed", range(6))
def test_levels_are_solved_one_after_the_other(seed):
    levels, polytope, error = problem(seed)
    found = solved(levels, polytope, error)
    assert found.outcome is Outcome.SOLVED
    assert_allclose(values(levels, polytope, error), one_after_the_other(levels, polytope, error), rtol=1e-3, atol=1e-4)
    assert polytope.violation(found.torque) < 1e-6 * error.sigma.max()


@pytest.mark.parametrize("seed", range(6))
def test_a_level_changes_nothing_above_it(seed):
    levels, polytope, error = problem(seed, near=2.0)
    levels.insert(2, Robustness())
    for count in range(1, len(levels)):
        fewer, more = (values(levels[:k], polytope, error) for k in (count, count + 1))
        assert_allclose(more[:count], fewer, rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("seed", [0, 1, 2, 5])
def test_robustness_in_the_null_space_of_two_levels(seed):
    """Of seeds whose limits leave it room, so that the risk falls and its slope in the null space vanishes."""
    levels, polytope, error = problem(seed, sizes=(2, 3))
    without = solved(levels, polytope, error)
    robust = solved([*levels, Robustness()], polytope, error)
    for level in levels:
        assert_allclose(level(robust.torque), level(without.torque), rtol=1e-7, atol=1e-9)
    before = individual_risk(polytope, without.torque, error).value
    assert robust.robustness < before - 1.0
    assert_allclose(robust.robustness, individual_risk(polytope, robust.torque, error).value, rtol=1e-9)
    basis = np.linalg.svd(np.vstack([level.matrix * error.sigma for level in levels]))[2][5:].T
    slope = basis.T @ (individual_risk(polytope, robust.torque, error).gradient * error.sigma)
    assert_allclose(slope, 0.0, atol=1e-3)


def test_robustness_first_leaves_only_what_it_does_not_see():
    """Two of four torques have limits in sight; the other two are left to the task."""
    sigma = np.full(4, 0.5)
    polytope = Polytope(np.eye(4), np.array([-1.0, -1.0, -500.0, -500.0]), np.array([1.0, 1.0, 500.0, 500.0]), bounds=4)
    task = LeastSquares(np.eye(4), np.array([0.9, 0.9, 7.0, -3.0]))
    found = solved([Robustness(), task], polytope, TorqueError(sigma**2))
    assert_allclose(found.torque, [0.0, 0.0, 7.0, -3.0], atol=1e-4)
    other = solved([task, Robustness()], polytope, TorqueError(sigma**2))
    assert_allclose(other.torque, [0.9, 0.9, 7.0, -3.0], atol=1e-6)


def test_a_level_that_contradicts_the_one_above():
    polytope = Polytope(np.eye(2), np.full(2, -10.0), np.full(2, 10.0), bounds=2)
    error = TorqueError(np.ones(2))
    one, other = (LeastSquares(np.array([[1.0, 1.0]]), np.array([v])) for v in (4.0, -4.0))
    last = LeastSquares(np.array([[1.0, -1.0]]), np.array([2.0]))
    found = solved([one, other, last], polytope, error)
    assert_allclose(found.torque, [3.0, 1.0], atol=1e-6)
    assert_allclose(values([one, other, last], polytope, error), [0.0, 64.0, 0.0], atol=1e-8)


def test_limits_stand_above_all_levels():
    polytope = Polytope(np.eye(2), np.full(2, -1.0), np.full(2, 1.0), bounds=2)
    one, other = (
        LeastSquares(np.array([[1.0, 0.0]]), np.array([5.0])),
        LeastSquares(np.array([[0.0, 1.0]]), np.zeros(1)),
    )
    found = solved([one, other], polytope, TorqueError(np.ones(2)))
    assert_allclose(found.torque, [1.0, 0.0], atol=1e-8)
    empty = Polytope(np.array([[1.0, 0.0], [1.0, 0.0]]), np.array([-9.0, 1.0]), np.array([0.0, 9.0]))
    assert solved([one, other], empty, TorqueError(np.ones(2))).outcome is Outcome.INFEASIBLE
    bad = LeastSquares(np.array([[np.nan, 0.0]]), np.zeros(1))
    failed = solved([bad, other], polytope, TorqueError(np.ones(2)))
    assert failed.outcome is not Outcome.SOLVED
    assert np.all(np.isfinite(failed.torque))
