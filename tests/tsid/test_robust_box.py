"""R_box and R_rect: their functions by differences, the rectangle's program by scipy, both below p."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.integrate import quad
from scipy.optimize import linprog, minimize
from scipy.special import erf, ndtr

from drake_tc.diagrams.papers.delprete2015.probability import probability
from drake_tc.tsid.qp import Outcome, QuadraticProgram, solver
from drake_tc.tsid.robust.convex import rectangle
from drake_tc.tsid.robust.formulation import Formulation
from drake_tc.tsid.robust.measures import p_rect, rectangle_risk
from drake_tc.tsid.robust.scaled import TorqueError, box_risk, box_rows, nothing, p_box, scaled, size_of_risk
from drake_tc.tsid.rows import LeastSquares, Polytope

from .robust_problems import random_covariance, random_polytope, random_problem

QP = solver()


@pytest.mark.parametrize("full", [False, True])
def test_rows_of_box_and_rectangle_are_the_worst_corners(full):
    rng = np.random.default_rng(2)
    polytope, inside, sigma = random_polytope(rng, 4, 3)
    error = TorqueError(random_covariance(rng, sigma) if full else sigma**2)
    problem = scaled(nothing(4), polytope, error)
    x, sides = inside / problem.scale, rng.uniform(0.1, 2.0, 8)
    held = np.zeros(len(polytope.lower))
    held[[1, 5]] = 1.0, -1.0
    program = rectangle(problem, held, 0.01, 1.0)
    corners = np.array(np.meshgrid(*[(-b, a) for a, b in zip(sides[:4], sides[4:], strict=True)])).reshape(4, -1)
    value = problem.limits.matrix @ x
    reached = value[:, None] + problem.noise @ corners
    got = program.rows().matrix @ np.concatenate((x, sides))
    expected = np.concatenate(
        (reached.max(axis=1), -reached.min(axis=1), -sides[:4] - sides[4:], value[[1]], -value[[5]])
    )
    assert_allclose(got, expected, rtol=1e-12, atol=1e-9)
    limits = problem.limits
    ends = (limits.upper, -limits.lower, np.full(4, -0.01), limits.upper[[1]], -limits.lower[[5]])
    assert_allclose(program.rows().upper, np.concatenate(ends), rtol=0)
    reached = value[:, None] + problem.noise @ np.array(np.meshgrid(*[(-1.3, 1.3)] * 4)).reshape(4, -1)
    got_box = box_rows(problem)[0].matrix @ np.append(x, 1.3)
    assert_allclose(got_box[:-1], np.concatenate((reached.max(axis=1), -reached.min(axis=1))), rtol=1e-12, atol=1e-9)


def test_derivatives_of_the_rectangles_objective():
    cost, polytope, error = random_problem(1)
    problem = scaled(cost, polytope, error)
    held = np.zeros(len(polytope.lower))
    program = rectangle(problem, held, 0.01, 0.3)
    rng = np.random.default_rng(0)
    at = np.concatenate((rng.normal(size=6), rng.uniform(0.2, 3.0, 12)))
    point, h = program.at(at), 1e-5
    steps = h * np.eye(18)
    values = [(program.at(at + s).value - program.at(at - s).value) / (2 * h) for s in steps]
    assert_allclose(point.gradient, values, rtol=1e-6, atol=1e-7 * np.abs(values).max())
    slopes = [(program.at(at + s).gradient - program.at(at - s).gradient) / (2 * h) for s in steps]
    assert_allclose(point.hessian, slopes, rtol=1e-5, atol=1e-5 * np.abs(point.hessian).max())


def test_box_risk_and_its_inverse():
    # quad's own error is 1e-15 absolute
    for size, axes in ((0.3, 1), (2.0, 7), (5.9, 30), (6.1, 30), (8.0, 30)):
        inside = quad(lambda z: math.exp(-0.5 * z * z) / math.sqrt(2 * math.pi), size, np.inf)[0] * 2
        assert_allclose(box_risk(size, axes), -axes * math.log1p(-inside), rtol=1e-7)
        assert_allclose(size_of_risk(box_risk(size, axes), axes), size, rtol=1e-9)
    assert box_risk(0.0, 3) == math.inf
    assert box_risk(math.inf, 3) == 0.0


@pytest.mark.parametrize("seed", range(8))
def test_lower_bounds_of_p(seed):
    """p_box <= p_rect <= p, the last within the interval of the quasi-Monte Carlo."""
    rng = np.random.default_rng(seed)
    polytope, inside, sigma = random_polytope(rng, 4, 4, near=6.0)
    for error in (TorqueError(sigma**2), TorqueError(random_covariance(rng, sigma))):
        for torque in (inside, inside + sigma * rng.normal(size=4)):
            p = probability(polytope, torque, error)
            by_rectangle, by_box = p_rect(polytope, torque, error, QP), p_box(polytope, torque, error)
            assert by_box <= by_rectangle + 1e-9
            assert by_rectangle <= p.ci95[1] + 1e-9
    assert p_rect(polytope, inside, error, QP) > 1e-3


@pytest.mark.parametrize("seed", range(4))
def test_box_at_a_torque_by_linear_programming(seed):
    polytope, inside, sigma = random_polytope(np.random.default_rng(seed), 5, 6)
    reach = np.abs(polytope.matrix) @ sigma
    value = polytope.matrix @ inside
    sides = np.concatenate((polytope.upper - value, value - polytope.lower))
    keep = np.isfinite(sides)
    size = linprog([-1.0], np.concatenate((reach, reach))[keep, None], sides[keep]).x[0]
    assert_allclose(p_box(polytope, inside, TorqueError(sigma**2)), erf(size / math.sqrt(2)) ** 5, rtol=1e-9)


def unseen(seed):
    """A problem of six torques, the last of which enters the cost alone, so that its error, if it has one, is free."""
    cost, polytope, error = random_problem(seed, n=5)
    wider = Polytope(np.pad(polytope.matrix, ((0, 0), (0, 1))), polytope.lower, polytope.upper, bounds=5)
    column = np.random.default_rng(seed).normal(size=(5, 1)) * np.abs(cost.matrix).max()
    matrix = np.block([[cost.matrix, column], [np.zeros((1, 5)), np.full((1, 1), column[0, 0])]])
    return LeastSquares(matrix, np.append(cost.target, 1.0)), wider, error.sigma


@pytest.mark.parametrize("use", ["trade_off", "null_space"])
@pytest.mark.parametrize("sigma_of_the_last", [0.0, 1.0])
@pytest.mark.parametrize("seed", range(4))
def test_where_no_limit_errs_a_box_of_any_size_costs_no_more_than_none(use, sigma_of_the_last, seed):
    """Against the solver itself, which knows nothing of boxes."""
    cost, polytope, _ = unseen(seed)
    error = TorqueError(np.append(np.zeros(5), sigma_of_the_last))
    program = QuadraticProgram(
        2.0 * cost.matrix.T @ cost.matrix, -2.0 * cost.matrix.T @ cost.target,
        polytope.matrix, polytope.lower, polytope.upper, polytope.bounds,
    )  # fmt: skip
    least = cost(QP.solve(program).x)
    for weight in (1e-9, 1e-3, 1.0):
        formulation, start = Formulation("box", use, weight=weight), None
        for steps in (5, 2):
            found = formulation.solve(cost, polytope, error, QP, start)
            assert (found.outcome, found.converged) == (Outcome.SOLVED, True)
            assert found.iterations <= steps
            assert (found.robustness, found.p_ind) == (0.0, 1.0)
            assert_allclose(found.cost, least, rtol=1e-5, atol=1e-5 * min(weight, 1.0))
            assert polytope.violation(found.torque) < 1e-6
            start = found.start


@pytest.mark.parametrize("seed", range(3))
def test_rectangle_program_by_scipy(seed):
    cost, polytope, error = random_problem(seed, n=2, rows=3)
    solution = Formulation("rectangle", weight=0.01).solve(cost, polytope, error, QP)
    sigma, matrix = error.sigma, polytope.matrix
    plus, minus = np.maximum(matrix, 0.0) * sigma, np.maximum(-matrix, 0.0) * sigma

    def objective(z):
        a, b = z[2:4], z[4:]
        return cost(z[:2] * sigma) - 0.01 * np.log(np.maximum(ndtr(a) - ndtr(-b), 1e-300)).sum()

    def room(z):
        value = matrix @ (z[:2] * sigma)
        high = polytope.upper - value - plus @ z[2:4] - minus @ z[4:]
        low = value - minus @ z[2:4] - plus @ z[4:] - polytope.lower
        both = np.concatenate((high, low)) / np.tile(np.linalg.norm(matrix * sigma, axis=1), 2)
        return both[np.isfinite(both)]

    sides = solution.start.inner[:4]
    ours = np.concatenate((solution.torque / sigma, sides))
    assert room(ours).min() > -1e-6
    for push in range(3):
        begin = ours + 0.1 * np.random.default_rng(push).normal(size=6)
        other = minimize(objective, begin, method="SLSQP", constraints={"type": "ineq", "fun": room}, tol=1e-14)
        if room(other.x).min() > -1e-9:
            assert objective(ours) <= other.fun + 1e-7
    assert_allclose(solution.robustness, -np.log(ndtr(sides[:2]) - ndtr(-sides[2:])).sum(), rtol=1e-8)


def test_rectangle_fits_where_no_box_around_the_torque_does():
    """A triangle seen from its corner: boxes around the corner are empty, the best one lies beside it."""
    polytope = Polytope(
        np.array([[1.0, 1.0], [-1.0, 1.0], [0.0, 1.0]]), np.array([0.0, 0.0, -np.inf]), np.full(3, np.inf)
    )
    polytope = Polytope(polytope.matrix, polytope.lower, np.array([np.inf, np.inf, 9.0]))
    error = TorqueError(np.ones(2))
    assert p_box(polytope, np.zeros(2), error) == 0.0
    found = p_rect(polytope, np.zeros(2), error, QP)
    size = np.linspace(0.01, 3.0, 3000)
    by_hand = ((2.0 * ndtr(size) - 1.0) * (ndtr(9.0) - ndtr(size))).max()
    assert_allclose(found, by_hand, rtol=1e-5)
    assert rectangle_risk(Polytope(np.eye(2), np.zeros(2), np.zeros(2)), np.zeros(2), error, QP) == math.inf


def test_x_itself_stays_inside_with_the_rectangle():
    """A cost that pulls far outside: eq. 16 alone would let x follow it while its box stays."""
    cost, polytope, error = random_problem(4, off=0.0)
    far = LeastSquares(cost.matrix * 1e3, cost.matrix @ (polytope.upper[:6] * 3.0) * 1e3)
    solution = Formulation("rectangle", weight=1e-6).solve(far, polytope, error, QP)
    assert polytope.violation(solution.torque) < 1e-6 * error.sigma.max()
    assert np.count_nonzero(solution.active) > 0


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), share=st.floats(0.1, 0.9), full=st.booleans())
def test_rectangle_and_box_are_convex_in_the_torque(seed, share, full):
    rng = np.random.default_rng(seed)
    polytope, inside, sigma = random_polytope(rng, 3, 4, near=5.0)
    error = TorqueError(random_covariance(rng, sigma) if full else sigma**2)
    one, other = (inside + 0.5 * sigma * rng.normal(size=3) for _ in range(2))
    between = share * one + (1.0 - share) * other
    low, high, middle = (rectangle_risk(polytope, x, error, QP) for x in (one, other, between))
    assert middle <= share * low + (1.0 - share) * high + 1e-5 * (1.0 + low + high)
    low, high, middle = (box_risk(max(_size(polytope, x, error), 0.0), 3) for x in (one, other, between))
    if np.isfinite(low + high):
        assert middle <= share * low + (1.0 - share) * high + 1e-9 * (1.0 + low + high)


def _size(polytope, torque, error):
    reach = np.abs(polytope.matrix @ error.root).sum(axis=1)
    value = polytope.matrix @ torque
    return (np.minimum(polytope.upper - value, value - polytope.lower) / reach).min()
