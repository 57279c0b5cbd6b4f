"""Strict priorities: each level is solved within what the levels above leave free, robustness at any of them.

    level 1: min f_1(tau), lower <= G tau <= upper
    level k: min f_k(tau), the same limits, f_1 .. f_(k-1) at the values that they have reached

f_k is ||D_k tau - d_k||^2 or R_ind. The minimisers of a level share D_k tau, and of R_ind the margins of all sides that
bend it, so level k is a problem over y, tau = tau_(k-1) + T y, T an orthonormal basis of what is left free.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.tsid.polytope import LeastSquares, Polytope
from drake_tc.tsid.qp.problem import Outcome, QpSolver
from drake_tc.tsid.robust.convex import Value, plain
from drake_tc.tsid.robust.measures import Guess, ProgramResult, SolverMeans, individual, least_cost
from drake_tc.tsid.robust.null_space import RANK, null_basis
from drake_tc.tsid.robust.options import Options
from drake_tc.tsid.robust.scaled import ScaledProblem, nothing, scaled
from drake_tc.tsid.robust.torque_error import TorqueError
from drake_tc.types import FloatArray

BENT = 1e-9
"""Curvature of -log Phi below which a side counts as out of sight: levels below robustness may move along it."""

EXACT = Options(accuracy=1e-9)


@dataclass(frozen=True)
class Robustness:
    """R_ind as a level; `hierarchy` is given its torque error."""


Level = LeastSquares | Robustness


@dataclass(frozen=True, eq=False)
class HierarchySolution:
    """A torque, level by level.

    Attributes:
        torque: (n,) [N m].
        values: f_k of each level at the torque: the cost, or R_ind.
        freedom: Directions that were left to each level before it was solved.
        outcome: SOLVED when all levels were; where one was not, the torque is that of the levels above it.
        converged: Whether every level reached its accuracy within the budget.
        iterations: Steps of Newton's method in all.
        programs: Of them by the QP solver.
    """

    torque: FloatArray
    values: tuple[float, ...]
    freedom: tuple[int, ...]
    outcome: Outcome
    converged: bool
    iterations: int
    programs: int


def hierarchy(
    levels: Sequence[Level],
    polytope: Polytope,
    error: TorqueError,
    qp: QpSolver,
    *,
    torque: FloatArray | None = None,
    options: Options = EXACT,
) -> HierarchySolution:
    """Solve the levels, the first with the highest priority.

    Args:
        levels: Of them at most one robustness; the others over the torques [N m].
        polytope: Limits that every level keeps.
        error: Of the torques; its sigmas are also the units of the steps.
        qp: Solver of the steps whose active rows cannot be guessed.
        torque: (n,) Where to begin.
        options: Accuracy and iterations of each level, and the time for all.

    Raises:
        ParamsError: no levels, or more than one robustness.
    """
    if not levels or sum(isinstance(level, Robustness) for level in levels) > 1:
        raise ParamsError(f"levels: expected one or more, robustness at most once, got {len(levels)}")
    n = error.joints
    problem = scaled(nothing(n), polytope, error)
    means = SolverMeans(qp, options.accuracy, options.budget.started())
    x = np.zeros(n) if torque is None else torque / problem.scale
    basis = np.eye(n)
    freedom: list[int] = []
    steps, programs, outcome, converged = 0, 0, Outcome.SOLVED, True
    for level in levels:
        freedom.append(basis.shape[1])
        if not freedom[-1] and steps:
            continue
        found, fixed = _solve(level, problem, x, basis, means)
        steps, programs, converged = steps + found.iterations, programs + found.programs, converged and found.converged
        if found.outcome is not Outcome.SOLVED:
            outcome = found.outcome
            break
        x = x + basis @ found.x
        basis = basis @ null_basis(fixed)
    torque = x * problem.scale
    if not np.isfinite(torque).all():
        torque, outcome = np.zeros(n), Outcome.FAILED
    values = tuple(_value(level, torque, problem) for level in levels)
    return HierarchySolution(torque, values, tuple(freedom), outcome, converged, steps, programs)


def _solve(
    level: Level, problem: ScaledProblem, x: FloatArray, basis: FloatArray, means: SolverMeans
) -> tuple[ProgramResult, FloatArray]:
    """The level's minimum over y, tau / scale = x + T y, and the rows over y that its minimisers share."""
    guess = Guess(np.zeros(basis.shape[1]))
    if isinstance(level, LeastSquares):
        priced = problem._replace(cost=LeastSquares(level.matrix * problem.scale, level.target))
        inside = _free(priced.along(x, basis), priced)
        return least_cost(inside, guess, means), inside.cost.matrix
    inside = problem.along(x, basis)
    found = individual(inside, 1.0, guess, means)
    return found, inside.limits.matrix[_risk_at(inside, found.x).bend > BENT]


def _free(inside: ScaledProblem, whole: ScaledProblem) -> ScaledProblem:
    """Without what rounding leaves of rows that the levels above decide."""
    matrix = inside.cost.matrix
    left, length = (np.einsum("ij,ij->i", rows, rows) for rows in (matrix, whole.cost.matrix))
    decided = left <= RANK * RANK * length
    return inside._replace(cost=LeastSquares(np.where(decided[:, None], 0.0, matrix), inside.cost.target))


def _value(level: Level, torque: FloatArray, problem: ScaledProblem) -> float:
    if isinstance(level, LeastSquares):
        return level(torque)
    return _risk_at(problem, torque / problem.scale).risk


def _risk_at(problem: ScaledProblem, x: FloatArray) -> Value:
    rows = problem.erring
    return plain(nothing(len(x)), rows, risk=rows, weight=1.0).at(x)
