"""Quadratic programs from matrices, and the solvers that take them by name.

Some problems no solver can take, and some answers hold nothing. Solvers that want positive definite Hessians get
programs freed from units (a Hessian with a unit diagonal, a gradient and rows of length one) and proximal steps where
the Hessian is singular.

Solvers: DAQP, a dual active-set method (Arnstrom, Bemporad, Axehill, IEEE TAC 2022), whose package comes with drake_tc;
quadprog, the dual method of Goldfarb and Idnani (Math. Programming 27, 1983); and any solver that Drake has, through a
MathematicalProgram of the same matrices. Packages are called directly: through `qpsolvers` the same solve takes longer,
as two-sided rows are written twice and converted at every tick.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntEnum
from importlib import import_module
from typing import Any, Protocol

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
from drake_tc.types import FloatArray


class Outcome(IntEnum):
    """How a solver ended.

    SOLVED: With an answer.
    INFEASIBLE: No point keeps the limits.
    FAILED: It does not know.
    RISKY: Of robust programs that shall keep R <= R_min: a point that keeps the limits, but not this.
    """

    SOLVED = 0
    INFEASIBLE = 1
    FAILED = 2
    RISKY = 3


@dataclass(frozen=True, eq=False)
class QuadraticProgram:
    """min 1/2 x^T H x + c^T x  subject to  lower <= A x <= upper; equal sides are an equality.

    Attributes:
        hessian: (n, n) H, symmetric, positive semidefinite.
        gradient: (n,) c.
        matrix: (m, n) A; its first `bounds` rows are the identity's first rows.
        lower, upper: (m,), infinite where a side has no limit.
        bounds: How many leading rows are bounds on the variables themselves.
    """

    hessian: FloatArray
    gradient: FloatArray
    matrix: FloatArray
    lower: FloatArray
    upper: FloatArray
    bounds: int = 0


@dataclass(frozen=True, eq=False)
class QpSolution:
    """What a solver found.

    Attributes:
        x: (n,).
        multipliers: (m,) of H x + c + A^T multipliers = 0; positive at the upper side, negative at the lower.
        outcome: See `Outcome`; x is meaningful when SOLVED.
        iterations: Of the solver.
    """

    x: FloatArray
    multipliers: FloatArray
    outcome: Outcome
    iterations: int


class QpSolver(Protocol):
    """Stateless from outside: what it knows of the last problem comes in as `start`."""

    def solve(self, problem: QuadraticProgram, start: QpSolution | None = None) -> QpSolution:
        """Solve, from `start` (the last tick's answer) where there is one; never raises on an infeasible problem."""
        ...


_MISSED = 1e-8


def is_usable(problem: QuadraticProgram) -> bool:
    """Whether H, c and A are finite and no side is NaN; by sums of squares, as that costs least."""
    h, a = problem.hessian.ravel(order="K"), problem.matrix.ravel(order="K")
    numbers = h.dot(h) + problem.gradient.dot(problem.gradient) + a.dot(a)
    sides = problem.lower.dot(problem.lower) + problem.upper.dot(problem.upper)
    return bool(numbers < np.inf and sides == sides)


def is_crossed(problem: QuadraticProgram) -> bool:
    """Whether a row alone rules out every x: lower > upper, or an infinity on the wrong side."""
    low, high = problem.lower, problem.upper
    return bool((low > high).any() or (low == np.inf).any() or (high == -np.inf).any())


def keeps_rows(problem: QuadraticProgram, x: FloatArray) -> bool:
    """Whether no row is missed by 1e-8 of its value: methods of active sets may err where rows depend on others."""
    value = problem.matrix.dot(x)
    if not value.size or np.minimum(value - problem.lower, problem.upper - value).min() >= -_MISSED:
        return True
    slack = _MISSED * (1.0 + np.abs(value))
    return bool(((value - slack <= problem.upper) & (value + slack >= problem.lower)).all())


def unsolved(problem: QuadraticProgram, outcome: Outcome, iterations: int = 0) -> QpSolution:
    """No answer: x and the multipliers are NaN."""
    m, n = problem.matrix.shape
    return QpSolution(np.full(n, np.nan), np.full(m, np.nan), outcome, iterations)


def usable_start(problem: QuadraticProgram, start: QpSolution | None) -> QpSolution | None:
    """`start` where it is an answer to a problem of this size, else None."""
    if start is None or start.outcome != Outcome.SOLVED:
        return None
    fits = start.multipliers.size == problem.lower.size and start.x.size == problem.gradient.size
    return start if fits else None


def refused(problem: QuadraticProgram) -> QpSolution | None:
    """The answer to a problem that no solver needs to see: numbers that are not, or a row without any x."""
    if not is_usable(problem):
        return unsolved(problem, Outcome.FAILED)
    return unsolved(problem, Outcome.INFEASIBLE) if is_crossed(problem) else None


@dataclass(frozen=True, eq=False)
class Scaled:
    """The same problem over z, x = unit z.

    Attributes:
        problem: Over z.
        unit: (n,) of the variables.
        row_unit: (m,) of the rows.
        cost_unit: Of the cost.
    """

    problem: QuadraticProgram
    unit: FloatArray
    row_unit: FloatArray
    cost_unit: float

    def there(self, start: QpSolution | None) -> QpSolution | None:
        """A start, over z; None where its numbers are none there."""
        if start is None:
            return None
        x, multipliers = start.x / self.unit, start.multipliers * (self.row_unit / self.cost_unit)
        if not (np.isfinite(x).all() and np.isfinite(multipliers).all()):
            return None
        return replace(start, x=x, multipliers=multipliers)

    def back(self, found: QpSolution) -> QpSolution:
        """A solution, over x; what a method that iterates leaves as push from a side that is not there is taken off."""
        if found.outcome is not Outcome.SOLVED:
            return found
        multipliers = found.multipliers * (self.cost_unit / self.row_unit)
        over = self.problem
        multipliers[(multipliers > 0.0) & (over.upper == np.inf) | (multipliers < 0.0) & (over.lower == -np.inf)] = 0.0
        return replace(found, x=found.x * self.unit, multipliers=multipliers)


def scaled(problem: QuadraticProgram) -> Scaled:
    """Scale a problem: unit_i = size / sqrt(H_ii), size = max |c_i| / sqrt(H_ii); the cost over size^2."""
    diagonal = problem.hessian.diagonal()
    root = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    size = float(np.abs(problem.gradient * root).max(initial=0.0)) or 1.0
    unit = size * root
    matrix = problem.matrix * unit
    row_unit = np.sqrt(np.einsum("ij,ij->i", matrix, matrix))
    row_unit[row_unit == 0.0] = 1.0
    row_unit[: problem.bounds] = unit[: problem.bounds]
    over = QuadraticProgram(
        problem.hessian * root * root[:, None],
        problem.gradient * (root / size),
        matrix / row_unit[:, None],
        problem.lower / row_unit,
        problem.upper / row_unit,
        problem.bounds,
    )
    return Scaled(over, unit, row_unit, size * size)


_WEAK = (1e-9, 2)
"""eps as a share of the scaled H's diagonal, above rounding but below curvatures that matter, and its steps."""
_STRONGER = ((1e-6, 20), (1e-3, 50))
_REST = 1e-6
"""Share of the gradient by which a last proximal step may miss the optimum's own."""
_STILL = 1e-9
"""Of the scaled variables, between steps."""
_CONFLICT = 1e-8
"""What equalities may miss, over the largest side."""

Solve = Callable[[QuadraticProgram, QpSolution | None], QpSolution]


def solve_scaled(problem: QuadraticProgram, start: QpSolution | None, strict: Solve) -> QpSolution:
    """Solve by a method for positive definite Hessians.

    The problem is scaled. If that does not suffice, proximal steps over the scaled z, z_i = argmin cost + eps/2
    |z - z_(i-1)|^2 from z_0 = 0, go to the optimum with the smallest z; in a direction of curvature lambda a step
    leaves eps / (eps + lambda) of the way. There are two with a weak eps. Where the method still finds nothing although
    it finds a feasible point for the cost |z|^2, which no curvature can spoil, there are more, with stronger ones.
    Steps that do not come to rest have no optimum to go to: FAILED.

    Args:
        problem: Its Hessian is positive semidefinite.
        start: As of `QpSolver`.
        strict: Solves positive definite problems; FAILED where it finds that one is not.
    """
    over = scaled(problem)
    started = over.there(start)
    found = strict(over.problem, started)
    if found.outcome is Outcome.FAILED:
        found = _stepped(over.problem, started, strict, *_WEAK)
    if found.outcome is not Outcome.SOLVED:
        nearest = replace(over.problem, hessian=np.eye(over.unit.size), gradient=np.zeros(over.unit.size))
        feasible = strict(nearest, None)
        if feasible.outcome is not Outcome.SOLVED:
            conflict = feasible.outcome is Outcome.INFEASIBLE or _equalities_conflict(over.problem)
            return unsolved(problem, Outcome.INFEASIBLE if conflict else Outcome.FAILED, found.iterations)
        for eps, steps in _STRONGER:
            found = _stepped(over.problem, None, strict, eps, steps)
            if found.outcome is Outcome.SOLVED:
                break
        else:
            return unsolved(problem, Outcome.FAILED, found.iterations)
    return over.back(found)


def _stepped(problem: QuadraticProgram, start: QpSolution | None, strict: Solve, eps: float, steps: int) -> QpSolution:
    hessian = problem.hessian + eps * np.eye(problem.gradient.size)
    last, iterations, moved = np.zeros(problem.gradient.size), 0, np.inf
    for _ in range(steps):
        start = strict(replace(problem, hessian=hessian, gradient=problem.gradient - eps * last), start)
        iterations += start.iterations
        if start.outcome is not Outcome.SOLVED:
            return unsolved(problem, start.outcome, iterations)
        moved, last = float(np.abs(start.x - last).max(initial=0.0)), start.x
        if moved <= _STILL * (1.0 + float(np.abs(last).max(initial=0.0))):
            break
    if start is None or not eps * moved <= _REST:
        return unsolved(problem, Outcome.FAILED, iterations)
    return replace(start, iterations=iterations)


def _equalities_conflict(problem: QuadraticProgram) -> bool:
    """Whether the rows whose sides are equal rule each other out."""
    same = problem.lower == problem.upper
    rows, sides = problem.matrix[same], problem.lower[same]
    nearest = np.linalg.lstsq(rows, sides, rcond=None)[0]
    return bool(np.abs(rows @ nearest - sides).max(initial=0.0) > _CONFLICT * (1.0 + np.abs(sides).max(initial=0.0)))


_SENSE = np.array([0, 1, 3], dtype=np.int32)
"""DAQP's `sense` of rows that do not push, push from above, and (last, so at -1) from below."""
_CONFLICT_FLAG, _SINGULAR_FLAG = -1, -5  # of its flags; positive where it has solved the problem
_ROW_MISSED = 1e-9
"""By how much a row may be missed, over that row's length in the metric of the scaled H."""
_SIZE = 500.0
"""Norm that H is scaled to: DAQP's tolerances are absolute; its least pivot is then about 1e-13 of the largest."""


class Daqp:
    """`QpSolver` by DAQP. The active set of `start` is the first guess; where that leads nowhere, it starts afresh.

    A Hessian with pivots below 1e-13 of its largest entry counts as singular (`solve_scaled`).
    """

    def __init__(self) -> None:
        """Import the package."""
        self._options: dict[str, Any] = {"primal_tol": _ROW_MISSED, "eps_prox": 0.0}
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
            if flag == _SINGULAR_FLAG:
                break
        return unsolved(problem, Outcome.INFEASIBLE if flag == _CONFLICT_FLAG else Outcome.FAILED, iterations)


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
