"""Every adapter: closed forms, optimality conditions, edges, and what it says where there is no answer."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from drake_tc.errors import ParamsError
from drake_tc.tsid import qp as choose
from drake_tc.tsid.qp import DEFAULT, OF_DRAKE, Outcome, QuadraticProgram, SolverUnavailableError
from tests.benchmarks.qp_solvers import SOLVERS, solver

from .quadratic import Residuals, cost, crude, has_a_point, random

ALL = (*SOLVERS, "clarabel", "osqp")
INF = np.inf


def small(
    matrix, lower, upper, *, hessian=((1.0, 0.0), (0.0, 2.0)), gradient=(1.0, -2.0), bounds=0
) -> QuadraticProgram:
    rows = np.array(matrix, dtype=float).reshape(-1, 2)
    sides = (np.array(side, dtype=float) for side in (lower, upper))
    return QuadraticProgram(np.array(hessian), np.array(gradient), rows, *sides, bounds)


CLOSED = {  # min 1/2 x0^2 + x1^2 + x0 - 2 x1, free optimum (-1, 1)
    "no rows": (small([], [], []), [-1, 1], []),
    "a row without sides": (small([[1, 1]], [-INF], [INF]), [-1, 1], [0]),
    "bounds": (small(np.eye(2), [-0.5, -INF], [INF, 0.5], bounds=2), [-0.5, 0.5], [-0.5, 1]),
    "equality": (small([[1, 1]], [1], [1]), [-1 / 3, 4 / 3], [-2 / 3]),
    "upper side": (small([[0, 2]], [-3], [1]), [-1, 0.5], [0.5]),
    "lower side": (small([[2, 0]], [-1], [3]), [-0.5, 1], [-0.25]),
    "bounds and rows": (small([[1, 0], [1, 1]], [-0.5, -INF], [INF, 0.25], bounds=1), [-0.5, 0.75], [-1.0, 0.5]),
    "a row of zeros": (small([[0, 0]], [-1], [1]), [-1, 1], [0]),
}


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("case", CLOSED)
def test_closed_forms_and_the_sign_of_multipliers(name, case):
    problem, x, multipliers = CLOSED[case]
    solution = solver(name).solve(problem)
    assert solution.outcome is Outcome.SOLVED
    assert_allclose(solution.x, x, rtol=0, atol=1e-8)
    assert_allclose(solution.multipliers, multipliers, rtol=0, atol=1e-7)


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("copies", [2, 3])
def test_the_same_equality_given_again(name, copies):
    solution = solver(name).solve(small([[1, 1]] * copies, [1] * copies, [1] * copies))
    assert_allclose(solution.x, [-1 / 3, 4 / 3], rtol=0, atol=1e-7)
    assert_allclose(solution.multipliers.sum(), -2 / 3, rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize(
    "problem",
    [
        small([[1, 1]], [1], [0]),
        small([[1, 0], [1, 0]], [1, -INF], [INF, 0.5]),
        small(np.eye(2), [1, -INF], [0, INF], bounds=2),
        small([[1, 1], [1, 0], [0, 1]], [3, -1, -1], [INF, 1, 1]),
        small([[1, 1]], [-INF], [-INF]),
        small([[1, 1]], [INF], [INF]),
    ],
    ids=["crossed sides", "two rows", "crossed bounds", "three rows", "upper -inf", "lower inf"],
)
def test_no_feasible_point_is_told_with_and_without_a_start(name, problem):
    chosen = solver(name)
    free = np.full(problem.lower.size, INF)
    start = chosen.solve(replace(problem, lower=-free, upper=free))
    told = (
        (Outcome.INFEASIBLE, Outcome.FAILED) if name == "proxqp" else (Outcome.INFEASIBLE,)
    )  # it may run out of steps
    for guess in (None, start):
        solution = chosen.solve(problem, guess)
        assert solution.outcome in told
        assert np.isnan(solution.x).all() and np.isnan(solution.multipliers).all()


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("field", ["hessian", "gradient", "matrix", "lower", "upper"])
@pytest.mark.parametrize("value", [np.nan, INF])
def test_numbers_that_are_none_fail_without_an_exception(name, field, value):
    problem = random(0)
    if value == INF and field in ("lower", "upper"):
        return
    spoilt = getattr(problem, field).copy()
    spoilt.flat[spoilt.size // 2] = value
    chosen = solver(name)
    for start in (None, chosen.solve(problem)):
        assert chosen.solve(replace(problem, **{field: spoilt}), start).outcome is Outcome.FAILED


@pytest.mark.parametrize("name", ["daqp", "quadprog", "piqp", "proxqp", "clarabel"])
def test_without_an_optimum(name):
    unbounded = small([[1, 1]], [-1], [1], hessian=((0.0, 0.0), (0.0, 0.0)))
    assert solver(name).solve(unbounded).outcome is not Outcome.SOLVED


@pytest.mark.parametrize("name", ["daqp", "quadprog", "piqp", "proxqp", "clarabel"])
@settings(max_examples=16, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([None, 6]), st.integers(0, 3))
def test_optimality_conditions(name, seed, rank, equalities):
    assume(not (name == "quadprog" and rank))
    problem = random(seed, rank=rank, equalities=equalities)
    solution = solver(name).solve(problem)
    assert solution.outcome is Outcome.SOLVED
    residuals = Residuals.of(problem, solution)
    assert max(residuals.dual, residuals.primal, residuals.complementarity) <= 1e-7


@pytest.mark.parametrize("seed", range(30))
def test_quadprog_misses_the_optimum_of_a_singular_cost_by_little(seed):
    """It inverts the Hessian, here a singular one plus 1e-9 of its diagonal: half of the digits are lost."""
    problem = random(seed, rank=6, equalities=seed % 4)
    one, other = (solver(name).solve(problem) for name in ("quadprog", "daqp"))
    assert cost(problem, one.x) == pytest.approx(cost(problem, other.x), rel=1e-5, abs=1e-5)
    assert Residuals.of(problem, one).primal <= 1e-5


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_default_tells_solvable_from_unsolvable_and_solves_what_is(seed):
    problem = crude(seed)
    solution = solver().solve(problem)
    assert solution.outcome is (Outcome.SOLVED if has_a_point(problem) else Outcome.INFEASIBLE)
    if solution.outcome is Outcome.SOLVED:
        residuals = Residuals.of(problem, solution)
        assert max(residuals.dual, residuals.primal, residuals.complementarity) <= 1e-4
        again = solver().solve(problem, solution)
        assert again.outcome is Outcome.SOLVED


def strided(array) -> np.ndarray:
    """The same numbers, every second one of a larger array."""
    wide = np.full((*array.shape[:-1], 2 * array.shape[-1]), np.nan)
    wide[..., ::2] = array
    return wide[..., ::2]


def read_only(array) -> np.ndarray:
    copy = array.copy()
    copy.setflags(write=False)
    return copy


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("made", [strided, read_only, np.asfortranarray])
def test_how_arrays_lie_in_memory_does_not_matter_and_none_is_changed(name, made):
    problem, fields, chosen = random(3), ("hessian", "gradient", "matrix", "lower", "upper"), solver(name)
    other = replace(problem, **{field: made(getattr(problem, field)) for field in fields})
    before = {field: getattr(problem, field).copy() for field in fields}
    solution = chosen.solve(problem)
    for start in (None, solution):
        assert_allclose(chosen.solve(other, start).x, solution.x, rtol=0, atol=1e-7)
    for field in fields:
        assert_allclose(getattr(problem, field), before[field], rtol=0, atol=0)
        assert_allclose(getattr(other, field), before[field], rtol=0, atol=0)


def test_the_default_is_there_and_others_are_asked_for_by_name(monkeypatch):
    assert DEFAULT in choose.SOLVERS and type(solver()) is type(solver(DEFAULT))
    with pytest.raises(ParamsError, match=r"solver: expected one of daqp, .*clarabel.*, got 'simplex'"):
        solver("simplex")
    monkeypatch.setitem(choose.SOLVERS, "quadprog", lambda: import_module("not_there"))
    with pytest.raises(ParamsError, match=r"solver 'quadprog' is not available: .*not_there.*drake-tc\[solvers\]"):
        solver("quadprog")
    assert set(OF_DRAKE) >= {"clarabel", "osqp"}


def test_a_solver_that_lacks_a_system_library_names_the_package(monkeypatch):
    def without_openmp(module):
        raise ImportError("libgomp.so.1: cannot open shared object file: No such file or directory")

    monkeypatch.setattr(choose, "import_module", without_openmp)
    with pytest.raises(SolverUnavailableError, match=r"is not available: .*libgomp\.so\.1.*install libgomp1"):
        solver("quadprog")


@pytest.mark.parametrize("name", ["gurobi", "mosek"])
def test_a_solver_without_a_licence_is_refused_at_construction(name, monkeypatch):
    for variable in ("MOSEKLM_LICENSE_FILE", "GRB_LICENSE_FILE"):
        monkeypatch.delenv(variable, raising=False)
    with pytest.raises(ParamsError, match="licence"):
        solver(name)


@pytest.mark.parametrize("name", ALL)
def test_rows_without_sides_push_nothing_and_nothing_is_printed_of_them(name, capfd):
    """Some among bounds, rows and equalities, then all; the others' answers are as without them."""
    problem, chosen = random(1, equalities=2), solver(name)
    sided = np.isfinite(problem.lower) | np.isfinite(problem.upper)
    assert 0 < np.count_nonzero(~sided[problem.bounds :]) < sided.size
    rows = problem.matrix[sided], problem.lower[sided], problem.upper[sided]
    fewer = chosen.solve(QuadraticProgram(problem.hessian, problem.gradient, *rows))
    found = chosen.solve(problem)
    assert found.outcome is fewer.outcome is Outcome.SOLVED
    assert_allclose(found.x, fewer.x, rtol=0, atol=1e-6)
    assert_allclose(found.multipliers[sided], fewer.multipliers, rtol=0, atol=1e-5)
    assert not found.multipliers[~sided].any()
    ends = np.full(sided.size, INF)
    free = chosen.solve(replace(problem, lower=-ends, upper=ends))
    assert_allclose(free.x, np.linalg.solve(problem.hessian, -problem.gradient), rtol=0, atol=1e-5)
    assert not free.multipliers.any()
    assert capfd.readouterr() == ("", "")
