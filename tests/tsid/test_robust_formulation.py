"""Formulations: conditions of optimality, invariances, the three uses, budgets, bad input."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import minimize, nnls
from scipy.special import log_ndtr, ndtr
from scipy.stats import norm

from drake_tc.errors import ParamsError
from drake_tc.tsid.qp import Outcome, solver
from drake_tc.tsid.robust.formulation import Formulation
from drake_tc.tsid.robust.scaled import Budget, Options, TorqueError, p_ind
from drake_tc.tsid.rows import LeastSquares, Polytope

from . import problems as real
from .individual_risk import individual_risk
from .robust_problems import random_covariance, random_problem

QP = solver()
SHARP = Options(accuracy=1e-12)
MEASURES = ("classic", "individual", "box", "rectangle")


def residual(cost, polytope, error, torque, weight):
    """What of the gradient of J + w R_ind [per sigma] no forces of the active sides balance, over its largest part."""
    sigma = error.scale
    value = polytope.matrix @ torque
    tolerance = 1e-6 * error.row_sigma(polytope.matrix)
    rows = np.concatenate((polytope.matrix, -polytope.matrix))
    active = np.concatenate((value >= polytope.upper - tolerance, value <= polytope.lower + tolerance))
    of_cost = 2.0 * cost.matrix.T @ (cost.matrix @ torque - cost.target) * sigma
    of_risk = weight * individual_risk(polytope, torque, error).gradient * sigma if weight else np.zeros(len(torque))
    normals = (rows[active] * sigma).T
    normals /= np.linalg.norm(normals, axis=0, keepdims=True) if normals.size else 1.0
    gradient = of_cost + of_risk
    left = nnls(normals, -gradient)[1] if normals.size else np.linalg.norm(gradient)
    terms = 2.0 * np.abs(cost.matrix * sigma).T @ np.abs(cost.target)
    return left, terms.max() + np.abs(of_risk).max()


@pytest.fixture(scope="module")
def robot_problems():
    return list(real.problems(3, 7, real.Setup(com_step=0.03)))


@pytest.mark.parametrize("weight", [1e-5, 1e-2, 1.0])
@pytest.mark.parametrize("seed", range(6))
def test_conditions_of_optimality(seed, weight):
    cost, polytope, error = random_problem(seed, n=8, rows=10, off=5.0)
    full = TorqueError(random_covariance(np.random.default_rng(seed), error.sigma))
    for known in (error, full):
        solution = Formulation("individual", weight=weight, options=SHARP).solve(cost, polytope, known, QP)
        assert solution.outcome is Outcome.SOLVED
        assert solution.converged
        left, scale = residual(cost, polytope, known, solution.torque, weight)
        # what is left of the descent is 1e-12 weight, and H >= weight / 2 or so: sqrt(2 H 1e-12 weight) of gradient
        assert left < 3e-6 * scale
        assert polytope.violation(solution.torque) < 1e-6 * known.row_sigma(polytope.matrix).max()
        assert_allclose(solution.p_ind, p_ind(polytope, solution.torque, known), rtol=1e-9)
        assert_allclose(solution.robustness, individual_risk(polytope, solution.torque, known).value, rtol=1e-9)


def test_conditions_of_optimality_on_the_robot(robot_problems):
    for problem in robot_problems:
        error = TorqueError(problem.sigma**2)
        start = None
        for weight in (0.0, 1.0, 1e-2, 1e-5):
            measure = "individual" if weight else "classic"
            formulation = Formulation(measure, weight=weight or 1.0, options=SHARP)
            solution = formulation.solve(problem.cost, problem.polytope, error, QP, start)
            start = solution.start
            assert solution.outcome is Outcome.SOLVED
            left, scale = residual(problem.cost, problem.polytope, error, solution.torque, weight)
            assert left < 1e-6 * scale


def test_more_robust_costs_more_and_the_robust_forms_beat_the_classic(robot_problems):
    for problem in robot_problems:
        error = TorqueError(problem.sigma**2)
        found = {}
        for measure in MEASURES:
            found[measure] = Formulation(measure, weight=1e-2).solve(problem.cost, problem.polytope, error, QP)
            assert found[measure].outcome is Outcome.SOLVED
            assert problem.polytope.violation(found[measure].torque) < 1e-5
        assert all(found["classic"].cost <= found[m].cost * (1 + 1e-9) + 1e-12 for m in MEASURES)
        assert all(found["classic"].p_ind <= found[m].p_ind + 1e-9 for m in MEASURES)
        safest = Formulation("individual", weight=1e6).solve(problem.cost, problem.polytope, error, QP)
        assert all(found[m].p_ind <= safest.p_ind + 1e-5 for m in MEASURES)


@pytest.mark.parametrize("weight", [0.05, 1e-3])
def test_against_scipy(weight):
    """SLSQP on the definition, one row after the other: no limit near, one that holds the torque, and a corner."""
    holding = set()
    for seed in range(5):
        cost, polytope, error = random_problem(seed, n=3, rows=4, off=20.0)
        sigma = error.sigma
        ours = Formulation("individual", weight=weight, options=SHARP).solve(cost, polytope, error, QP)
        assert ours.outcome is Outcome.SOLVED
        length = np.linalg.norm(polytope.matrix * sigma, axis=1)
        rows = np.concatenate((polytope.matrix, -polytope.matrix)) * sigma / np.tile(length, 2)[:, None]
        sides = np.concatenate((polytope.upper, -polytope.lower)) / np.tile(length, 2)
        rows, sides = rows[np.isfinite(sides)], sides[np.isfinite(sides)]

        def objective(x, of=(cost, sigma, rows, sides)):
            (cost, sigma, rows, sides), off = of, of[0].matrix @ (x * of[1]) - of[0].target
            room = sides - rows @ x
            slope = 2.0 * (cost.matrix * sigma).T @ off + weight * rows.T @ (norm.pdf(room) / ndtr(room))
            return off @ off - weight * log_ndtr(room).sum(), slope

        found = ours.torque / sigma
        bounds = {"type": "ineq", "fun": lambda x, a=rows, b=sides: b - a @ x, "jac": lambda x, a=rows: -a}
        other = minimize(objective, found + 0.3, jac=True, method="SLSQP", constraints=bounds, tol=1e-13)
        assert other.success
        assert (sides - rows @ other.x).min() > -1e-9
        assert (sides - rows @ found).min() > -1e-7
        assert_allclose(objective(found)[0], other.fun, rtol=1e-11, atol=1e-11)
        assert_allclose(found, other.x, atol=2e-5)
        holding.add(int(np.count_nonzero(sides - rows @ found < 1e-7)))
        assert np.count_nonzero(ours.active) == np.count_nonzero(sides - rows @ other.x < 1e-7)
    assert 3 in holding
    assert holding & {1, 2}
    assert (0 in holding) == (weight == 0.05)


@pytest.mark.parametrize("measure", MEASURES)
def test_order_and_scale_of_rows_and_units_of_torques_do_not_matter(measure):
    cost, polytope, error = random_problem(11, n=6, rows=9, off=4.0)
    formulation = Formulation(measure, weight=1e-2, options=SHARP)
    reference = formulation.solve(cost, polytope, error, QP)
    rng = np.random.default_rng(0)
    order = rng.permutation(len(polytope.lower))
    mixed = Polytope(polytope.matrix[order], polytope.lower[order], polytope.upper[order])
    length = 10.0 ** rng.uniform(-4, 4, len(order))
    longer = Polytope(polytope.matrix * length[:, None], polytope.lower * length, polytope.upper * length)
    unit = 10.0 ** rng.uniform(-3, 3, 6)
    other_units = replace(polytope, matrix=polytope.matrix / unit, bounds=0)
    in_units = LeastSquares(cost.matrix / unit, cost.target)
    sigma = error.sigma
    for got, scale in (
        (formulation.solve(cost, mixed, error, QP), 1.0),
        (formulation.solve(cost, longer, error, QP), 1.0),
        (formulation.solve(in_units, other_units, TorqueError((sigma * unit) ** 2), QP), unit),
    ):
        assert got.outcome is Outcome.SOLVED
        assert_allclose(got.cost, reference.cost, rtol=1e-5, atol=1e-9)
        assert_allclose(got.robustness, reference.robustness, rtol=1e-4, atol=1e-9)
        assert_allclose(got.torque / scale / sigma, reference.torque / sigma, atol=5e-3)


@pytest.mark.parametrize("measure", MEASURES)
def test_budget_gives_the_best_feasible_so_far(measure):
    for seed in range(4):
        cost, polytope, error = random_problem(seed, n=8, rows=10, off=20.0)
        weight, last = 1e-2, math.inf
        start = Formulation("classic").solve(cost, polytope, error, QP).start
        for iterations in range(1, 12):
            options = Options(accuracy=1e-10, budget=Budget(iterations=iterations))
            solution = Formulation(measure, weight=weight, options=options).solve(cost, polytope, error, QP, start)
            assert solution.outcome is Outcome.SOLVED
            assert polytope.violation(solution.torque) < 1e-6 * error.row_sigma(polytope.matrix).max()
            if measure in ("classic", "individual"):
                value = solution.cost + (weight * solution.robustness if measure == "individual" else 0.0)
                assert value <= last + 1e-9
                last = value


def test_time_is_up():
    """A clock that says a second has gone by at every look: one step, and a torque that keeps the limits."""
    cost, polytope, error = random_problem(2, off=20.0)
    ticks = iter(range(10_000))
    options = Options(budget=Budget(seconds=0.5, clock=lambda: float(next(ticks))))
    solution = Formulation("individual", weight=1.0, options=options).solve(cost, polytope, error, QP)
    assert solution.outcome is Outcome.SOLVED
    assert not solution.converged
    assert polytope.violation(solution.torque) < 1e-6 * error.row_sigma(polytope.matrix).max()
    bound = Formulation("individual", "constraint", minimum=2.0, options=options)
    solution = bound.solve(cost, polytope, error, QP)
    assert not solution.converged
    assert solution.iterations <= 3


@pytest.mark.parametrize("measure", MEASURES)
def test_warm_start_gives_the_same_torque(measure):
    for seed in range(4):
        cost, polytope, error = random_problem(seed, n=8, rows=16, off=5.0)
        formulation = Formulation(measure, weight=1e-2, options=SHARP)
        cold = formulation.solve(cost, polytope, error, QP)
        moved = LeastSquares(cost.matrix, cost.target * 1.001)
        shift = 0.1 * error.row_sigma(polytope.matrix) * np.random.default_rng(seed).uniform(-1.0, 1.0, 26)
        shifted = replace(polytope, lower=polytope.lower + shift, upper=polytope.upper + shift)
        warm = formulation.solve(moved, shifted, error, QP, cold.start)
        fresh = formulation.solve(moved, shifted, error, QP)
        weight = 1e-2 if measure in ("individual", "rectangle") else 0.0
        objective = [s.cost + (weight and weight * s.robustness) for s in (warm, fresh)]
        assert warm.outcome is fresh.outcome is Outcome.SOLVED
        assert_allclose(objective[0], objective[1], rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("measure", MEASURES)
@pytest.mark.parametrize("use", ["trade_off", "null_space", "constraint"])
def test_joints_that_do_not_err(measure, use):
    cost, polytope, error = random_problem(3, n=6, rows=6, rank=4, near=6.0)
    for known in (np.arange(6) == 2, np.arange(6) > 0, np.full(6, True)):
        some = TorqueError(np.where(known, 0.0, error.sigma) ** 2)
        solution = Formulation(measure, use, weight=1e-2, minimum=3.0).solve(cost, polytope, some, QP)
        assert solution.outcome is Outcome.SOLVED
        assert np.all(np.isfinite(solution.torque))
        assert np.isfinite(solution.p_ind)
        assert not math.isnan(solution.robustness)
        miss = np.maximum(
            polytope.lower - polytope.matrix @ solution.torque, polytope.matrix @ solution.torque - polytope.upper
        )
        assert (miss / np.linalg.norm(polytope.matrix * error.sigma, axis=1)).max() < 1e-5


@pytest.mark.parametrize("measure", MEASURES)
@pytest.mark.parametrize("use", ["trade_off", "null_space", "constraint"])
def test_bad_numbers_are_flagged_and_give_no_nan(measure, use):
    cost, polytope, error = random_problem(5)
    formulation = Formulation(measure, use)
    good = formulation.solve(cost, polytope, error, QP).start
    lower = polytope.lower.copy()
    lower[8] = polytope.upper[8] + 1.0
    crossed = replace(polytope, lower=lower)
    conflict = Polytope(
        np.vstack([polytope.matrix, polytope.matrix[7:8], polytope.matrix[7:8]]),
        np.append(polytope.lower, [-np.inf, polytope.upper[7] + 10.0]),
        np.append(polytope.upper, [polytope.upper[7], np.inf]),
    )
    for start in (None, good):
        for problem in (crossed, conflict):
            solution = formulation.solve(cost, problem, error, QP, start)
            assert solution.outcome is Outcome.INFEASIBLE
            assert np.all(np.isfinite(solution.torque))
        bad = np.array(cost.matrix)
        bad[0, 0] = np.nan
        rows = np.array(polytope.matrix)
        rows[9, 2] = np.nan
        for priced, limits in ((LeastSquares(bad, cost.target), polytope), (cost, replace(polytope, matrix=rows))):
            solution = formulation.solve(priced, limits, error, QP, start)
            assert solution.outcome is not Outcome.SOLVED
            assert np.all(np.isfinite(solution.torque))


def test_change_of_contacts_between_ticks():
    cost, polytope, error = random_problem(6, off=5.0)
    fewer = Polytope(polytope.matrix[:9], polytope.lower[:9], polytope.upper[:9], bounds=6)
    for measure in MEASURES:
        formulation = Formulation(measure, weight=1e-2, options=SHARP)
        start = formulation.solve(cost, polytope, error, QP).start
        warm, cold = (formulation.solve(cost, fewer, error, QP, s) for s in (start, None))
        assert warm.outcome is Outcome.SOLVED
        assert_allclose(warm.cost, cold.cost, rtol=1e-5, atol=1e-10)


def test_change_of_formulation_between_ticks():
    cost, polytope, error = random_problem(6, off=5.0)
    made = [Formulation(m, u, weight=1e-2) for m in MEASURES for u in ("trade_off", "null_space", "constraint")]
    starts = [f.solve(cost, polytope, error, QP).start for f in made]
    for formulation in made:
        cold = formulation.solve(cost, polytope, error, QP)
        for start in starts:
            warm = formulation.solve(cost, polytope, error, QP, start)
            assert warm.outcome is cold.outcome
            assert_allclose(warm.cost, cold.cost, rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"measure": "all"}, "measure: expected one of"),
        ({"use": "none"}, "use: expected one of"),
        ({"weight": 0.0}, "weight"),
        ({"weight": math.nan}, "weight"),
        ({"minimum": -1.0}, "minimum"),
    ],
)
def test_refusals(change, why):
    with pytest.raises(ParamsError, match=why):
        Formulation(**change)


def test_refusals_of_options():
    with pytest.raises(ParamsError, match="accuracy"):
        Options(accuracy=0.0)
    with pytest.raises(ParamsError, match="iterations"):
        Budget(iterations=0)
    with pytest.raises(ParamsError, match="clock"):
        Budget(seconds=1.0)
