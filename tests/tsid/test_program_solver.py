"""`solver: program`: the tick as a MathematicalProgram, and the fast path held against it."""

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from sweeps import slow_but

import drake_tc.models
from drake_tc.errors import ParamsError
from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.law import PreviousTick, Status
from drake_tc.tsid.program_solver import FullProblem, ProgramSolver
from drake_tc.tsid.qp import Outcome, solver
from drake_tc.tsid.robust.measures import rectangle_risk
from drake_tc.tsid.robust.scaled import TorqueError, p_ind, size_of_risk
from drake_tc.tsid.tick import TickInput, problem_at, solve_tick

FILE = Path(drake_tc.models.__file__).parent / "hrp2_like" / "hrp2_like_tsid.yaml"
BOTH = (True, True)
MEASURES = ("classic", "individual", "box", "rectangle")
CLASSIC = {"measure": "classic", "use": None, "weight": None}


@pytest.fixture(scope="module")
def law():
    return load_law(FILE)


def of(law, measure, weight=1e-3):
    return replace(law, formulation=replace(law.formulation, measure=measure, weight=weight))


def problem_of(law, seed, active=BOTH):
    """Near the start and moving, the centre of mass asked to go somewhere near."""
    rng = np.random.default_rng(seed)
    state = np.concatenate((law.model.start, np.zeros(law.model.nv)))
    state[7:37] += 0.01 * rng.normal(size=30)
    state[43:] += 0.02 * rng.normal(size=30)
    references = [task.rest(law.starting_terms()) for task in law.tasks]
    references[0][:3] += 0.02 * rng.normal(size=3)
    return problem_at(law, law.model.create_scratch(), TickInput(state, references, active)), state, references


def by_program(law, problem):
    given = FullProblem(problem.terms, problem.tasks, problem.limits)
    return ProgramSolver().solution(given, law.formulation, law.error)


def by_kernels(law, problem):
    return law.formulation.solve(problem.reduced.cost, problem.reduced.polytope, law.error, law.solver)


@pytest.mark.parametrize(
    ("measure", "seed"), slow_but(product(MEASURES, range(3)), *((measure, 0) for measure in MEASURES))
)
def test_the_fast_path_is_as_good_as_drakes_solvers(law, measure, seed):
    """Both minimise J + w R (of the box: J - w s); neither value may be larger than the other's accuracy."""
    this = of(law, measure, 1.0 if measure == "box" else 1e-3)
    problem, _, _ = problem_of(this, seed)
    fast, slow = by_kernels(this, problem), by_program(this, problem)
    assert fast.outcome is slow.outcome is Outcome.SOLVED
    weight = 0.0 if measure == "classic" else this.formulation.weight
    polytope = problem.reduced.polytope
    if measure == "box":
        sizes = [size_of_risk(one.robustness, 30) for one in (fast, slow)]
        values = [one.cost - weight * size for one, size in zip((fast, slow), sizes, strict=True)]
        assert min(sizes) > 0.1
        assert_allclose(*values, rtol=1e-5, atol=1e-4 * weight)
    else:
        values = [one.cost + weight * one.robustness for one in (fast, slow)]
        assert_allclose(*values, rtol=1e-5, atol=1e-4 * weight)
    assert_allclose(slow.cost, problem.reduced.cost(slow.torque), rtol=1e-6)
    assert_allclose(slow.p_ind, p_ind(polytope, slow.torque, this.error), rtol=1e-6)
    if measure == "rectangle":
        best = rectangle_risk(polytope, slow.torque, this.error, this.solver)
        assert_allclose(slow.robustness, best, rtol=1e-3, atol=1e-4)  # w times this is lost in J


@pytest.mark.parametrize("share", [0.01, 0.001])
def test_so_it_is_where_limits_are_nearer_than_the_errors_reach(share):
    """Torque limits of a few sigmas, and of a third of one: R is large, and its tails count."""
    near = {"limits": {"torque": {"share": share}}}
    fast, slow = (load_law(FILE, {**near, **more}) for more in ({}, {"solver": "program"}))
    problem, _, _ = problem_of(fast, 0)
    one, other = by_kernels(fast, problem), by_program(slow, problem)
    assert one.outcome is other.outcome is Outcome.SOLVED
    weight = fast.formulation.weight
    assert_allclose(one.cost + weight * one.robustness, other.cost + weight * other.robustness, rtol=1e-7)


def test_a_full_covariance_is_the_same_problem(law):
    rng = np.random.default_rng(0)
    sigma = law.error.sigma
    factor = rng.normal(size=(30, 40))
    covariance = factor @ factor.T
    scale = sigma / np.sqrt(np.diagonal(covariance))
    this = replace(of(law, "individual"), error=TorqueError(covariance * np.outer(scale, scale)))
    problem, _, _ = problem_of(this, 1)
    fast, slow = by_kernels(this, problem), by_program(this, problem)
    weight = this.formulation.weight
    assert_allclose(fast.cost + weight * fast.robustness, slow.cost + weight * slow.robustness, rtol=1e-5)


def test_a_controller_file_may_name_it_and_the_tick_is_the_same(law):
    changed = load_law(FILE, {"solver": "program", "formulation": {"measure": "box", "weight": 1.0}})
    assert isinstance(changed.solver, ProgramSolver)
    _, state, references = problem_of(law, 2)
    before = PreviousTick(np.zeros(30), None)
    ticks = [
        solve_tick(each, each.model.create_scratch(), TickInput(state, references, BOTH), before)
        for each in (changed, of(law, "box", 1.0))
    ]
    assert [tick.status[Status.FALLBACK] for tick in ticks] == [0.0, 0.0]
    assert_allclose(ticks[0].torque, ticks[1].torque, atol=0.05)
    assert_allclose(ticks[0].status[Status.P_IND], ticks[1].status[Status.P_IND], atol=1e-3)


def test_limits_that_conflict_are_diagnosed(law):
    """The torques hold the robot up no longer, and the joints must not give way either."""
    limits = {"torque": {"share": 0.01}, "acceleration": {"acceleration": 0.1}}
    weak = load_law(FILE, {"solver": "program", "limits": limits})
    _, state, references = problem_of(law, 0)
    tick = solve_tick(
        weak, weak.model.create_scratch(), TickInput(state, references, BOTH), PreviousTick(np.zeros(30), None)
    )
    assert tick.error is None
    assert (tick.status[Status.OUTCOME], tick.status[Status.FALLBACK]) == (Outcome.INFEASIBLE, 1.0)
    assert tick.status[Status.LIMIT] >= 0.0


def test_what_the_program_does_not_know_is_refused():
    with pytest.raises(ParamsError, match="solver: program knows use: trade_off alone, got constraint"):
        load_law(FILE, {"solver": "program", "formulation": {"use": "constraint", "weight": None}})
    levels = {"com": {"priority": 1}, "posture": {"priority": 2}, "force": {"priority": 2}}
    with pytest.raises(ParamsError, match="program weighs tasks and knows no strict priorities"):
        load_law(FILE, {"solver": "program", "tasks": levels, "formulation": CLASSIC})
    assert isinstance(solver("program"), ProgramSolver)
