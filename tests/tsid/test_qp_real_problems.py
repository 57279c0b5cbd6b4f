"""The adapters on problems of the 30-joint robot: optimality, agreement, warm starts, units."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.tsid.assembly import reduce
from drake_tc.tsid.limits import TorqueLimit, WrenchCones
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.qp import Outcome, QuadraticProgram
from drake_tc.tsid.tasks import ComTask, ForceTask, PostureTask
from tests.benchmarks.qp_solvers import solver

from .problems import SOLES, Setup, problem_at, robot, state
from .program_matrices import reduced_qp
from .quadratic import FAMILIES, Residuals, cost, real

STRICT = ("standing", "saturated")


@pytest.mark.parametrize("name", ["daqp", "quadprog"])
@pytest.mark.parametrize("family", FAMILIES)
def test_optimality_conditions(name, family):
    for problem in real(family, 25):
        solution = solver(name).solve(problem)
        assert solution.outcome is Outcome.SOLVED
        residuals = Residuals.of(problem, solution)
        # torques of up to 300 N m, gradients and curvatures of up to 1e3; quadprog inverts a Hessian of condition 1e9
        loose = 1e-8 if name == "quadprog" else 1e-9
        assert residuals.dual <= loose
        assert residuals.primal <= loose
        assert residuals.complementarity <= loose


@pytest.mark.parametrize("family", STRICT)
def test_two_active_set_methods_find_the_same_torques_and_multipliers(family):
    for problem in real(family, 25):
        one, other = (solver(name).solve(problem) for name in ("daqp", "quadprog"))
        assert_allclose(one.x, other.x, rtol=0, atol=1e-6)
        assert_allclose(one.multipliers, other.multipliers, rtol=0, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("family", STRICT)
def test_the_same_answer_on_thousands_of_states(family):
    for problem in real(family, 2000, seed=10):
        one, other = (solver(name).solve(problem) for name in ("daqp", "quadprog"))
        assert_allclose(one.x, other.x, rtol=0, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("family", STRICT)
def test_the_reference_finds_the_same_cost_on_hundreds_of_states(family):
    """Clarabel, by Drake. Its torques stray along the internal forces: by more than 1e-6 in 5 % of the states at most,
    by 1e-5 at 99 %, by 6e-3 at worst (measured: 4 %, 4 to 5e-6 and 5.03e-3: the states follow from a motion, which
    rounding changes). There quadprog sides with DAQP, to 1e-6."""
    apart = []
    for problem in real(family, 400, seed=77):
        one, other = (solver(name).solve(problem) for name in ("daqp", "clarabel"))
        assert_allclose(cost(problem, one.x), cost(problem, other.x), rtol=0, atol=1e-10)
        apart.append(np.abs(one.x - other.x).max())
        if apart[-1] > 1e-6:
            assert_allclose(solver("quadprog").solve(problem).x, one.x, rtol=0, atol=1e-6)
    assert np.percentile(apart, 95) <= 1e-6
    assert np.percentile(apart, 99) <= 1e-5
    assert max(apart) <= 6e-3


@pytest.mark.parametrize("family", STRICT)
def test_the_reference_agrees(family):
    """Clarabel, by Drake. Internal forces have 1e-8 of the tasks' curvature, so torques are less sharp than cost."""
    for problem in real(family, 25)[:10]:
        one, other = (solver(name).solve(problem) for name in ("daqp", "clarabel"))
        assert_allclose(one.x, other.x, rtol=0, atol=1e-5)
        assert_allclose(cost(problem, one.x), cost(problem, other.x), rtol=0, atol=1e-9)


def motion(setup: Setup, ticks: int) -> list[QuadraticProgram]:
    """Along a line between two states, the reference of the centre of mass swinging."""
    rng = np.random.default_rng(5)
    (q, v), (q_end, _) = state(rng, setup), state(rng, setup)
    out = []
    for share in np.linspace(0, 1, ticks):
        between = (1 - share) * q + share * q_end
        between[:4] /= np.linalg.norm(between[:4])
        error = 0.2 * np.array([np.sin(9 * share), np.cos(7 * share), 0.3 * np.sin(5 * share)])
        reduced = problem_at(between, v, error, setup).reduced
        matrix, target, polytope = reduced.cost.matrix, reduced.cost.target, reduced.polytope
        hessian, gradient = 2 * matrix.T @ matrix, -2 * matrix.T @ target
        rows = polytope.matrix, polytope.lower, polytope.upper, polytope.bounds
        out.append(QuadraticProgram(hessian, gradient, *rows))
    return out


@pytest.mark.parametrize("force_weight", [1e-4, 0.0])
def test_a_warm_start_saves_iterations_and_changes_nothing(force_weight):
    chosen, last = solver("daqp"), None
    cold_steps, warm_steps = [], []
    for problem in motion(Setup(force_weight=force_weight, velocity=1.0, speed=0.2), 50):
        cold, warm = chosen.solve(problem), chosen.solve(problem, last)
        assert cold.outcome is warm.outcome is Outcome.SOLVED
        assert_allclose(cost(problem, warm.x), cost(problem, cold.x), rtol=0, atol=1e-9)
        if force_weight:
            assert_allclose(warm.x, cold.x, rtol=0, atol=1e-6)
        cold_steps.append(cold.iterations)
        warm_steps.append(warm.iterations)
        last = warm
    assert np.median(cold_steps) >= 20  # many rows are active
    assert np.median(warm_steps) <= 0.2 * np.median(cold_steps)


@pytest.mark.parametrize("name", ["daqp", "proxqp", "clarabel"])
def test_a_start_of_another_size_or_without_an_answer_is_no_harm(name):
    chosen = solver(name)
    problem = real("standing", 25)[0]
    fewer = replace(problem, matrix=problem.matrix[:-5], lower=problem.lower[:-5], upper=problem.upper[:-5])
    failed = chosen.solve(replace(problem, gradient=problem.gradient * np.nan))
    for start in (chosen.solve(fewer), failed):
        assert_allclose(chosen.solve(problem, start).x, chosen.solve(problem).x, rtol=0, atol=1e-5)


def scalings(rng: np.random.Generator, problem: QuadraticProgram, what: str) -> tuple[QuadraticProgram, np.ndarray]:
    """The same problem in other units, and the unit of x."""
    one, k = np.ones(problem.gradient.size), problem.bounds
    if what.startswith("cost"):
        factor = float(what.split()[1])
        return replace(problem, hessian=factor * problem.hessian, gradient=factor * problem.gradient), one
    if what == "rows":
        rows = 10 ** rng.uniform(-4, 4, problem.lower.size)
        rows[:k] = 1.0
        sides = problem.lower * rows, problem.upper * rows
        return replace(problem, matrix=problem.matrix * rows[:, None], lower=sides[0], upper=sides[1]), one
    unit = 10 ** rng.uniform(-2, 2, one.size)
    rows = np.ones(problem.lower.size)
    rows[:k] = 1 / unit[:k]
    return (
        QuadraticProgram(
            problem.hessian * unit * unit[:, None],
            problem.gradient * unit,
            problem.matrix * unit * rows[:, None],
            problem.lower * rows,
            problem.upper * rows,
            k,
        ),
        unit,
    )


@pytest.mark.parametrize("name", ["daqp", "quadprog"])
@pytest.mark.parametrize("what", ["cost 1e-9", "cost 1e9", "rows", "units of torque"])
@pytest.mark.parametrize("family", STRICT)
def test_units_do_not_matter(name, what, family):
    rng, chosen = np.random.default_rng(0), solver(name)
    for problem in real(family, 25)[:8]:
        other, unit = scalings(rng, problem, what)
        solution = chosen.solve(other)
        assert solution.outcome is Outcome.SOLVED
        assert_allclose(unit * solution.x, chosen.solve(problem).x, rtol=0, atol=1e-6)


@pytest.mark.parametrize("family", STRICT)
def test_neither_does_the_order_of_rows(family):
    chosen = solver()
    for seed, problem in enumerate(real(family, 25)[:10]):
        k, m = problem.bounds, problem.lower.size
        order = np.concatenate((np.arange(k), k + np.random.default_rng(seed).permutation(m - k)))
        mixed = replace(problem, matrix=problem.matrix[order], lower=problem.lower[order], upper=problem.upper[order])
        one, other = chosen.solve(problem), chosen.solve(mixed)
        assert_allclose(one.x, other.x, rtol=0, atol=1e-6)
        assert_allclose(one.multipliers[order], other.multipliers, rtol=0, atol=1e-6)


def test_rows_that_are_doubled_and_touch_are_no_trouble():
    chosen = solver()
    for problem in real("saturated", 25):
        twice = replace(
            problem,
            matrix=np.concatenate((problem.matrix, problem.matrix)),
            lower=np.concatenate((problem.lower, problem.lower)),
            upper=np.concatenate((problem.upper, problem.upper)),
        )
        one, other = chosen.solve(problem), chosen.solve(twice)
        assert other.outcome is Outcome.SOLVED
        assert_allclose(one.x, other.x, rtol=0, atol=1e-6)
        assert chosen.solve(twice, other).outcome is Outcome.SOLVED


TOUCHING = {
    "a contact given twice": (*SOLES, replace(SOLES[0], name="again", frame=replace(SOLES[0].frame, name="again"))),
    "ice": tuple(replace(sole, friction=0.0) for sole in SOLES),
    "ice, and soles that may lift": tuple(
        replace(sole, friction=0.0, moment_friction=0.0, minimum_force=0.0) for sole in SOLES
    ),
}
"""Sides of different rows that meet leave no room between them, though there is a feasible point."""


@pytest.mark.parametrize("case", TOUCHING)
@pytest.mark.parametrize("force_weight", [1e-4, 0.0])
def test_rows_without_room_between_them_are_not_taken_for_a_conflict(case, force_weight):
    it, rng = TsidModel(robot(), TOUCHING[case]), np.random.default_rng(1)
    com, posture = ComTask(100.0, 20.0), PostureTask(it, 1.0, 1.0, weight=1e-3)
    cones, torque = WrenchCones(it.contacts), TorqueLimit.of(robot())
    for _ in range(10):
        terms = it.terms(it.create_scratch(), *state(rng, Setup()))
        tasks = [
            com.rows(terms, np.concatenate([terms.com + rng.uniform(-0.1, 0.1, 3), np.zeros(6)])),
            posture.rows(terms, np.concatenate([robot().posture, np.zeros(2 * it.n)])),
        ]
        if force_weight:
            tasks.append(ForceTask(it, weight=force_weight).rows(terms, np.zeros(it.force_size)))
        problem = reduced_qp(reduce(terms, tasks, [torque.rows(terms), cones.rows(terms)]))
        cold = solver().solve(problem)
        warm = solver().solve(problem, cold)
        for solution in (cold, warm):
            assert solution.outcome is Outcome.SOLVED
            residuals = Residuals.of(problem, solution)
            assert max(residuals.dual, residuals.primal, residuals.complementarity) <= 1e-7
