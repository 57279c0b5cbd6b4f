"""Our adapters against a detour through `qpsolvers`, which calls the same solvers: same answers, and its cost."""

import time

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.qp import Outcome, QpSolution, refused, scaled, solve_scaled, unsolved
from tests.benchmarks.qp import MOTIONS, humanoid_controller, record
from tests.benchmarks.qp_solvers import solver, unavailable

qpsolvers = pytest.importorskip("qpsolvers")
TIGHT = {
    "quadprog": {},
    "piqp": dict.fromkeys(("eps_abs", "eps_rel", "eps_duality_gap_abs", "eps_duality_gap_rel"), 1e-12),
    "proxqp": {"eps_abs": 1e-12, "eps_rel": 0.0, "max_iter": 1500},
}
"""The tolerances of our adapters, as qpsolvers passes them on."""


class Detour:
    """`QpSolver` through qpsolvers: min 1/2 x'Px + q'x, Gx <= h, Ax = b, lb <= x <= ub."""

    def __init__(self, name):
        self._name = name

    def solve(self, problem, start=None):
        answer = refused(problem)
        if answer is not None:
            return answer
        if self._name == "quadprog":
            return solve_scaled(problem, None, self._solve)
        over = scaled(problem)
        return over.back(self._solve(over.problem, None))

    def _solve(self, problem, start):
        k, box = problem.bounds, np.full((2, problem.gradient.size), [[-np.inf], [np.inf]])
        box[:, :k] = problem.lower[:k], problem.upper[:k]
        lower, upper, rows = problem.lower[k:], problem.upper[k:], problem.matrix[k:]
        same = lower == upper
        equal, low, high = (np.flatnonzero(a) for a in (same, np.isfinite(lower) & ~same, np.isfinite(upper) & ~same))
        matrix, side = np.concatenate((rows[high], -rows[low])), np.concatenate((upper[high], -lower[low]))
        equalities = (rows[equal], lower[equal]) if equal.size else (None, None)
        posed = qpsolvers.Problem(problem.hessian, problem.gradient, matrix, side, *equalities, *box)
        found = qpsolvers.solve_problem(posed, solver=self._name, **TIGHT[self._name])
        if not found.found:
            return unsolved(problem, Outcome.FAILED)
        multipliers = np.zeros(problem.lower.size)
        multipliers[:k] = found.z_box[:k]
        if equal.size:
            multipliers[k + equal] = found.y
        multipliers[k + high] += found.z[: high.size]
        multipliers[k + low] -= found.z[high.size :]
        return QpSolution(found.x, multipliers, Outcome.SOLVED, 0)


@pytest.fixture(scope="module")
def problems():
    """Those of the 30-joint robot while its centre of mass sways; each has one optimum."""
    return record(load_law(humanoid_controller()), MOTIONS[0], 150)


@pytest.fixture(params=TIGHT)
def name(request):
    if (why := unavailable(request.param)) is not None:
        pytest.skip(why)
    return request.param


def test_the_answers_are_the_same(name, problems):
    """Torques of up to 100 N m, multipliers in their units; both stop at 1e-12 of the scaled problem."""
    for problem in problems[::15]:
        ours, other = solver(name).solve(problem), Detour(name).solve(problem)
        assert_allclose(ours.x, other.x, rtol=0, atol=1e-6)
        assert_allclose(ours.multipliers, other.multipliers, rtol=0, atol=1e-6)


@pytest.mark.benchmark
def test_the_detour_costs_the_tick(name, problems):
    """The median of the ratios of neighbouring solves, in turn ours first and the other first, on one thread."""
    ratios, both = [], (solver(name), Detour(name))
    for number, problem in enumerate(problems):
        seconds = [0.0, 0.0]
        for which in (0, 1) if number % 2 else (1, 0):
            begin = time.thread_time()
            both[which].solve(problem)
            seconds[which] = time.thread_time() - begin
        ratios.append(seconds[1] / seconds[0])
    print(f"{name}: {np.median(ratios):.2f} times as long through qpsolvers")
    assert np.median(ratios) > 1.05
