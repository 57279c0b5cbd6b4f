"""The three uses of robustness: in the null space of the cost, as a constraint, and traded off against it."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import erfinv

from drake_tc.diagrams.papers.delprete2015.probability import probability
from drake_tc.tsid.qp import Outcome, QuadraticProgram, solver
from drake_tc.tsid.robust.formulation import Formulation
from drake_tc.tsid.robust.measures import rectangle_risk
from drake_tc.tsid.robust.scaled import Options, TorqueError, p_box

from .robust_problems import random_covariance, random_problem

QP = solver()
SHARP = Options(accuracy=1e-12)


@pytest.mark.parametrize("measure", ["individual", "box", "rectangle"])
@pytest.mark.parametrize("seed", range(4))
def test_null_space_leaves_the_cost_as_it_is(seed, measure):
    cost, polytope, error = random_problem(seed, n=8, rows=8, rank=5, light=1.0)
    classic = Formulation("classic").solve(cost, polytope, error, QP)
    robust = Formulation(measure, "null_space").solve(cost, polytope, error, QP)
    assert robust.outcome is Outcome.SOLVED
    assert abs(robust.cost - classic.cost) <= 1e-9 * (1.0 + classic.cost)
    assert polytope.violation(robust.torque) < 1e-6 * error.row_sigma(polytope.matrix).max()
    assert robust.converged
    if measure == "individual":
        assert robust.p_ind >= classic.p_ind - 1e-9
        traded = Formulation("individual", weight=1e-7, options=SHARP).solve(cost, polytope, error, QP)
        assert_allclose(robust.robustness, traded.robustness, rtol=1e-2)


@pytest.mark.parametrize("seed", range(4))
def test_without_freedom_the_null_space_is_the_classic_torque(seed):
    cost, polytope, error = random_problem(seed)
    classic = Formulation("classic").solve(cost, polytope, error, QP)
    for measure in ("individual", "box", "rectangle"):
        robust = Formulation(measure, "null_space").solve(cost, polytope, error, QP)
        assert_allclose(robust.torque / error.sigma, classic.torque / error.sigma, atol=1e-6)


@pytest.mark.parametrize("measure", ["individual", "rectangle", "box"])
@pytest.mark.parametrize("seed", range(3))
def test_constraint_is_met_with_equality_where_it_is_active(seed, measure):
    cost, polytope, error = random_problem(seed, n=6, rows=5, off=6.0, near=9.0)
    least = Formulation(measure, weight=1e8).solve(cost, polytope, error, QP).robustness
    wanted = 2.0 * least + 0.05
    formulation = Formulation(measure, "constraint", minimum=wanted, weight=1e-2)
    solution = formulation.solve(cost, polytope, error, QP)
    assert solution.outcome is Outcome.SOLVED
    assert_allclose(solution.robustness, wanted, rtol=2e-6)
    again = formulation.solve(cost, polytope, error, QP, solution.start)
    assert_allclose(again.cost, solution.cost, rtol=1e-5)
    assert again.iterations <= solution.iterations
    assert Formulation("classic").solve(cost, polytope, error, QP).cost <= solution.cost
    if measure != "box":
        trade = Formulation(measure, weight=solution.start.weight, options=SHARP).solve(cost, polytope, error, QP)
        assert_allclose(trade.cost, solution.cost, rtol=1e-3)
    refused = replace(formulation, minimum=0.5 * least).solve(cost, polytope, error, QP)
    assert refused.outcome is Outcome.RISKY
    assert polytope.violation(refused.torque) < 1e-6 * error.row_sigma(polytope.matrix).max()
    assert_allclose(refused.robustness, least, rtol=2e-3)


def test_a_constraint_that_stays_active_is_met_anew_in_few_steps():
    """Of a problem a little beside the last one, as it is in the next tick, R_min is met from the last weight."""
    steps = []
    for seed in range(6):
        cost, polytope, error = random_problem(seed, n=6, rows=5, off=6.0, near=9.0)
        least = Formulation("individual", weight=1e8).solve(cost, polytope, error, QP).robustness
        bound = 2.0 * least + 0.05
        formulation = Formulation("individual", "constraint", minimum=bound, weight=1e-2)
        before = formulation.solve(cost, polytope, error, QP)
        beside = cost._replace(target=1.001 * cost.target)
        after = formulation.solve(beside, polytope, error, QP, before.start)
        cold = formulation.solve(beside, polytope, error, QP)
        assert after.start.weight > 0.0
        assert_allclose(after.robustness, bound, rtol=2e-6)
        assert_allclose(after.cost, cold.cost, rtol=1e-4)
        steps.append(after.iterations)
    assert np.median(steps) <= 9


@pytest.mark.parametrize("measure", ["individual", "rectangle", "box"])
def test_a_risk_of_one_in_a_million_is_kept_where_it_can_be_had(measure):
    refused = 0
    for seed in range(3):
        cost, polytope, error = random_problem(seed, n=6, rows=5, off=40.0, near=80.0)
        least = Formulation(measure, weight=1e12, options=SHARP).solve(cost, polytope, error, QP).robustness
        costs = [Formulation("classic").solve(cost, polytope, error, QP).cost]
        for minimum in (1e-2, 1e-4, 1e-6):
            solution = Formulation(measure, "constraint", minimum=minimum).solve(cost, polytope, error, QP)
            possible = least < minimum
            assert solution.outcome is (Outcome.SOLVED if possible else Outcome.RISKY)
            assert_allclose(solution.robustness, minimum if possible else least, rtol=2e-4 if possible else 1e-2)
            refused += not possible
            costs.append(solution.cost)
        assert costs == sorted(costs)
    assert refused == (0 if measure == "individual" else 1)


def test_constraint_that_is_not_active_costs_nothing():
    cost, polytope, error = random_problem(1, n=8, rows=6, rank=4, near=12.0, off=0.5)
    classic = Formulation("classic").solve(cost, polytope, error, QP)
    solution = Formulation("individual", "constraint", minimum=5.0).solve(cost, polytope, error, QP)
    assert solution.robustness <= 5.0
    assert abs(solution.cost - classic.cost) <= 1e-9 * (1.0 + classic.cost)


@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_program_and_measure_agree_on_the_robustness(seed, full):
    """The box that the program carries along is the best one for its torque, and less probable than the polytope."""
    cost, polytope, error = random_problem(seed, n=5, rows=6, near=6.0)
    if full:
        error = TorqueError(random_covariance(np.random.default_rng(seed), error.sigma))
    for measure in ("box", "rectangle"):
        solution = Formulation(measure, weight=0.1, options=SHARP).solve(cost, polytope, error, QP)
        assert solution.outcome is Outcome.SOLVED
        if measure == "box":
            assert_allclose(np.exp(-solution.robustness), p_box(polytope, solution.torque, error), rtol=1e-9)
        else:
            assert_allclose(solution.robustness, rectangle_risk(polytope, solution.torque, error, QP), rtol=1e-5)
        assert np.exp(-solution.robustness) <= probability(polytope, solution.torque, error).ci95[1]


@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_box_program_by_another_solver(seed, full):
    """Equation 17 written out in tau / sigma and s, for Clarabel."""
    cost, polytope, error = random_problem(seed, n=6, rows=8, near=5.0)
    if full:
        error = TorqueError(random_covariance(np.random.default_rng(seed), error.sigma))
    weight = 0.05
    ours = Formulation("box", weight=weight, options=SHARP).solve(cost, polytope, error, QP)
    deviation = error.row_sigma(polytope.matrix)[:, None]
    rows = polytope.matrix * error.sigma / deviation
    reach = np.abs(polytope.matrix @ error.root).sum(axis=1, keepdims=True) / deviation
    matrix = np.vstack([np.hstack([rows, reach]), np.hstack([-rows, reach]), np.eye(7)[6:] * -1.0])
    upper = np.concatenate((polytope.upper / deviation[:, 0], -polytope.lower / deviation[:, 0], [0.0]))
    priced = np.hstack([cost.matrix * error.sigma, np.zeros((len(cost.target), 1))])
    gradient = -2.0 * priced.T @ cost.target
    gradient[6] = -weight
    program = QuadraticProgram(2.0 * priced.T @ priced, gradient, matrix, np.full(len(upper), -np.inf), upper)
    x = solver("clarabel").solve(program).x
    best = np.sum((priced @ x - cost.target) ** 2) - weight * x[6]
    size = np.sqrt(2.0) * erfinv(np.exp(-ours.robustness / 6.0)) if np.isfinite(ours.robustness) else 0.0
    assert_allclose(ours.cost - weight * size, best, rtol=1e-5, atol=1e-6)


def test_more_weight_is_more_robust_and_costs_more():
    cost, polytope, error = random_problem(2, n=6, rows=8, off=6.0)
    for measure in ("individual", "rectangle"):
        found = [Formulation(measure, weight=w).solve(cost, polytope, error, QP) for w in (1e-4, 1e-2, 1.0, 100.0)]
        assert np.all(np.diff([f.cost for f in found]) >= -1e-7)
        assert np.all(np.diff([f.robustness for f in found]) <= 1e-5)
