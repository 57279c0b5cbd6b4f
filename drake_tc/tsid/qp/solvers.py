"""Solvers of quadratic programs by name; only the default's package comes with drake_tc.

DAQP, a dual active-set method (Arnstrom, Bemporad, Axehill, IEEE TAC 2022); quadprog, the dual method of Goldfarb and
Idnani (Math. Programming 27, 1983); and any solver that Drake has, through a MathematicalProgram of the same matrices.
Packages are called directly: through `qpsolvers` the same solve takes 1.25 to 1.4 times as long, as two-sided rows are
written twice and converted at every tick (`tests/tsid/test_qpsolvers.py` measures it).
"""

import math
from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np
from pydrake.solvers import (
    ClarabelSolver,
    GurobiSolver,
    MathematicalProgram,
    MosekSolver,
    OsqpSolver,
    ScsSolver,
    SolutionResult,
    SolverOptions,
)

from drake_tc.errors import ParamsError
from drake_tc.system_libraries import how_to_install, missing_library
from drake_tc.tsid.qp.problem import (
    Outcome,
    QpSolution,
    QpSolver,
    QuadraticProgram,
    is_usable,
    keeps_rows,
    refused,
    scaled,
    solve_scaled,
    unsolved,
    usable_start,
)

_SENSE = np.array([0, 1, 3], dtype=np.int32)
"""DAQP's `sense` of rows that do not push, push from above, and (last, so at -1) from below."""
_CONFLICT, _SINGULAR = -1, -5  # of its flags; positive where it has solved the problem
_MISSED = 1e-9
"""By how much a row may be missed, over that row's length in the metric of the scaled H."""
_SIZE = 500.0
"""Norm that H is scaled to: DAQP's tolerances are absolute; its least pivot is then about 1e-13 of the largest."""


class Daqp:
    """`QpSolver` by DAQP. The active set of `start` is the first guess; where that leads nowhere, it starts afresh.

    A Hessian with pivots below 1e-13 of its largest entry counts as singular (`solve_scaled`).
    """

    def __init__(self) -> None:
        """Import the package."""
        self._options: dict[str, Any] = {"primal_tol": _MISSED, "eps_prox": 0.0}
        self._daqp = import_module("daqp").solve

    def solve(self, problem: QuadraticProgram, start: QpSolution | None = None) -> QpSolution:
        """See `QpSolver`."""
        if not is_usable(problem):
            return unsolved(problem, Outcome.FAILED)
        known = usable_start(problem, start)
        solution = self._strict(problem, known)
        return solution if solution.outcome is Outcome.SOLVED else solve_scaled(problem, known, self._strict)

    def _strict(self, problem: QuadraticProgram, start: QpSolution | None) -> QpSolution:
        """From the active set of `start`, and without it where that leads nowhere."""
        hessian = problem.hessian.ravel(order="K")
        size = math.sqrt(hessian.dot(hessian))
        scale = _SIZE / size if size > 0.0 else 1.0
        rows = problem.matrix[problem.bounds :]
        if not (rows.flags.c_contiguous and rows.flags.writeable):
            rows = rows.copy(order="C")
        # DAQP wants all arrays writable and contiguous, and takes others for such
        upper, lower = problem.upper.copy(), problem.lower.copy()
        data = scale * problem.hessian, scale * problem.gradient, rows, upper, lower
        flag, iterations = 0, 0
        for guess in (None,) if start is None else (_active(start.multipliers), None):
            x, _, flag, told = self._daqp(*data, guess, **self._options)
            iterations += told["iterations"]
            if flag > 0 and keeps_rows(problem, x):
                return QpSolution(x, told["lam"] / scale, Outcome.SOLVED, iterations)
            if flag == _SINGULAR:
                break
        return unsolved(problem, Outcome.INFEASIBLE if flag == _CONFLICT else Outcome.FAILED, iterations)


def _active(multipliers: Any) -> Any:
    """(m,) DAQP's `sense` of the rows that push."""
    return _SENSE[np.sign(multipliers).astype(np.intp)]


class Quadprog:
    """`QpSolver` by quadprog; no use is made of `start`. See `solve_scaled` for singular Hessians."""

    def __init__(self) -> None:
        """Import the package."""
        self._quadprog = import_module("quadprog").solve_qp

    def solve(self, problem: QuadraticProgram, start: QpSolution | None = None) -> QpSolution:
        """See `QpSolver`."""
        answer = refused(problem)
        if answer is not None:
            return answer
        return solve_scaled(problem, None, self._strict)

    def _strict(self, problem: QuadraticProgram, start: QpSolution | None) -> QpSolution:
        """As quadprog has it: equalities, then rows >= sides."""
        same = problem.lower == problem.upper
        equal = np.flatnonzero(same)
        low = np.flatnonzero(np.isfinite(problem.lower) & ~same)
        high = np.flatnonzero(np.isfinite(problem.upper) & ~same)
        a = problem.matrix
        rows = np.concatenate((a[equal], a[low], -a[high])).T
        sides = np.concatenate((problem.lower[equal], problem.lower[low], -problem.upper[high]))
        if not sides.size:  # it wants a row
            rows, sides = np.zeros((problem.gradient.size, 1)), np.full(1, -1.0)
        try:
            x, _, _, iterations, dual, _ = self._quadprog(problem.hessian, -problem.gradient, rows, sides, equal.size)
        except ValueError as error:  # "constraints are inconsistent" or "matrix G is not positive definite"
            return unsolved(problem, Outcome.INFEASIBLE if "inconsistent" in str(error) else Outcome.FAILED)
        multipliers = np.zeros(problem.lower.size)
        multipliers[equal] = -dual[: equal.size]
        multipliers[low] -= dual[equal.size : equal.size + low.size]
        multipliers[high] += dual[equal.size + low.size :][: high.size]
        return QpSolution(x, multipliers, Outcome.SOLVED, int(iterations[0]))


_TIGHT = 1e-14
_SOLVERS: dict[str, tuple[Any, dict[str, Any]]] = {
    "clarabel": (ClarabelSolver, dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), _TIGHT)),
    "osqp": (OsqpSolver, {"eps_abs": 1e-11, "eps_rel": 1e-11, "max_iter": 100_000, "polishing": 0}),
    "scs": (ScsSolver, {"eps_abs": _TIGHT, "eps_rel": _TIGHT, "max_iters": 200_000}),
    "gurobi": (GurobiSolver, {}),
    "mosek": (MosekSolver, {}),
}
_INFEASIBLE = (SolutionResult.kInfeasibleConstraints, SolutionResult.kInfeasibleOrUnbounded)


class DrakeSolver:
    """`QpSolver` by one of Drake's; `start` gives x to those that take a guess."""

    def __init__(self, name: str = "clarabel") -> None:
        """Find the solver.

        Args:
            name: "clarabel", "osqp", "scs", "gurobi" or "mosek".

        Raises:
            ParamsError: an unknown name, or a solver without a licence here.
        """
        if name not in _SOLVERS:
            raise ParamsError(f"solver of Drake: expected one of {', '.join(_SOLVERS)}, got {name!r}")
        make, options = _SOLVERS[name]
        self._solver = make()
        if not (self._solver.available() and self._solver.enabled()):
            raise ParamsError(
                f"solver {name!r}: not in this Drake, or without a licence; possible: clarabel, osqp, scs"
            )
        self._options = SolverOptions()
        for key, value in options.items():
            self._options.SetOption(self._solver.solver_id(), key, value)

    def solve(self, problem: QuadraticProgram, start: QpSolution | None = None) -> QpSolution:
        """See `QpSolver`."""
        answer = refused(problem)
        if answer is not None:
            return answer
        over = scaled(problem)
        return over.back(self._solve(over.problem, over.there(usable_start(problem, start))))

    def _solve(self, problem: QuadraticProgram, start: QpSolution | None) -> QpSolution:
        """The scaled problem."""
        program: Any = MathematicalProgram()
        x = program.NewContinuousVariables(problem.gradient.size)
        program.AddQuadraticCost(problem.hessian, problem.gradient, x, is_convex=True)
        rows = None
        if problem.lower.size:
            rows = program.AddLinearConstraint(problem.matrix, problem.lower, problem.upper, x)
        guess = start.x if start is not None else None
        result = self._solver.Solve(program, guess, self._options)
        if not result.is_success():
            infeasible = result.get_solution_result() in _INFEASIBLE
            return unsolved(problem, Outcome.INFEASIBLE if infeasible else Outcome.FAILED)
        multipliers = np.zeros(0) if rows is None else -np.asarray(result.GetDualSolution(rows)).ravel()
        return QpSolution(np.asarray(result.GetSolution(x)), multipliers, Outcome.SOLVED, 0)


DEFAULT = "daqp"
SOLVERS: dict[str, Callable[[], QpSolver]] = {"daqp": Daqp, "quadprog": Quadprog}
"""Makes each solver from PyPI, whose package it imports."""
PROGRAM = "program"
"""The whole tick as one MathematicalProgram of Drake (`drake_tc.tsid.program_solver`): slow, and independent."""
OF_DRAKE = ("clarabel", "osqp", "scs", "gurobi", "mosek")


class SolverUnavailableError(ParamsError):
    """A solver whose package, or a shared library that the package loads, is not installed."""


def solver(name: str = DEFAULT) -> QpSolver:
    """A solver.

    Args:
        name: One of SOLVERS or OF_DRAKE, or PROGRAM.

    Raises:
        ParamsError: an unknown name, or a solver of Drake without a licence.
        SolverUnavailableError: its package, or a shared library that the package loads, is not installed.
    """
    if name in OF_DRAKE:
        return DrakeSolver(name)
    if name == PROGRAM:
        made: QpSolver = import_module("drake_tc.tsid.program_solver").ProgramSolver()
        return made
    if name not in SOLVERS:
        raise ParamsError(f"solver: expected one of {', '.join((*SOLVERS, *OF_DRAKE, PROGRAM))}, got {name!r}")
    try:
        return SOLVERS[name]()
    except ImportError as error:
        library = missing_library(error)
        reason = how_to_install(library) if library else f"{error}; pip install 'drake-tc[solvers]'"
        raise SolverUnavailableError(f"solver {name!r} is not available: {reason}; or take {DEFAULT!r}") from None
