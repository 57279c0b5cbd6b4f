"""Tasks on strict levels of priority, robustness on a level of its own: how a law uses `hierarchy`.

Strict priorities: each level is solved within what the levels above leave free, robustness at any of them.

    level 1: min f_1(tau), lower <= G tau <= upper
    level k: min f_k(tau), the same limits, f_1 .. f_(k-1) at the values that they have reached

f_k is ||D_k tau - d_k||^2 or R_ind. The minimisers of a level share D_k tau, and of R_ind the margins of all sides that
bend it, so level k is a problem over y, tau = tau_(k-1) + T y, T an orthonormal basis of what is left free.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.robot import fields
from drake_tc.tsid.assembly import Reduced, cost_of
from drake_tc.tsid.qp.problem import Outcome, QpSolver
from drake_tc.tsid.robust.active_set import FREE, RobustSolution, Start
from drake_tc.tsid.robust.convex import Value, plain
from drake_tc.tsid.robust.measures import Guess, ProgramResult, SolverMeans, individual, least_cost
from drake_tc.tsid.robust.options import Options, TorqueError
from drake_tc.tsid.robust.scaled import RANK, ScaledProblem, nothing, null_basis, p_ind, scaled
from drake_tc.tsid.rows import LeastSquares, Polytope, TaskRows
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


KEY = "priority"
_BY_WEIGHT = ("use", "weight", "minimum")
"""Keys of a formulation that choose how much robustness may cost; a level of its own says that already."""


@dataclass(frozen=True)
class Priorities:
    """Which level each task is on: 1 is the highest, and a lower one moves only what the higher ones leave free.

    Attributes:
        tasks: Of each task of the law; tasks on one level share it by their weights.
        robustness: The level on which R_ind is minimised; None for nowhere.

    Raises:
        ParamsError: a level below 1, or robustness on a level of tasks.
    """

    tasks: tuple[int, ...]
    robustness: int | None = None

    def __post_init__(self) -> None:
        for level in (*self.tasks, *(() if self.robustness is None else (self.robustness,))):
            if level < 1:
                raise ParamsError(f"priority: expected 1, 2, ..., got {level}")
        if self.robustness in self.tasks:
            raise ParamsError(
                f"priority: expected a level of its own for robustness, unlike those of tasks, got {self.robustness}"
            )

    def levels(self, tasks: Sequence[TaskRows], reduced: Reduced) -> list[Level]:
        """From the highest to the lowest.

        Args:
            tasks: One for each of `tasks`.
            reduced: Of the same state.
        """
        numbers = {*self.tasks, *(() if self.robustness is None else (self.robustness,))}
        return [
            Robustness()
            if number == self.robustness
            else cost_of([rows for rows, of in zip(tasks, self.tasks, strict=True) if of == number], reduced.causes)
            for number in sorted(numbers)
        ]

    def solve(
        self,
        tasks: Sequence[TaskRows],
        reduced: Reduced,
        error: TorqueError,
        qp: QpSolver,
        options: Options,
        start: Start | None = None,
    ) -> RobustSolution:
        """The torque; never raises on numbers.

        Args:
            tasks: Rows of each task.
            reduced: Of the same state.
            error: Of the torques.
            qp: Solver of the steps whose active rows cannot be guessed.
            options: Accuracy of each level, budget of all.
            start: Of the last tick's solution.
        """
        polytope, n = reduced.polytope, error.joints
        torque = start.torque if start is not None and start.torque.size == n else None
        levels = self.levels(tasks, reduced)
        try:
            found = hierarchy(levels, polytope, error, qp, torque=torque, options=options)
        except (np.linalg.LinAlgError, ArithmeticError, LookupError, ValueError):
            nothing = np.zeros(len(polytope.lower), dtype=np.int64)
            return RobustSolution(np.zeros(n), math.inf, 0.0, math.inf, nothing, Outcome.FAILED, False, 0, 0, None)
        value = polytope.matrix @ found.torque
        active = (value >= polytope.upper).astype(np.int64) - (value <= polytope.lower)
        risk = next((v for level, v in zip(levels, found.values, strict=True) if isinstance(level, Robustness)), 0.0)
        return RobustSolution(
            found.torque,
            risk,
            p_ind(polytope, found.torque, error),
            reduced.cost(found.torque),
            active,
            found.outcome,
            found.converged,
            found.iterations,
            found.programs,
            Start(found.torque, len(polytope.lower), FREE),
        )


def read_priorities(
    tasks: Sequence[tuple[str, Any]], formulation: Mapping[str, Any], measure: str
) -> Priorities | None:
    """None where no `priority` is given anywhere; else tasks without one are on level 1.

    Args:
        tasks: Name and entry of each.
        formulation: Entry.
        measure: Of the formulation: "individual" has a level of its own, by default below all tasks.

    Raises:
        ParamsError: a level that is no whole number from 1 on, robustness on a level of tasks, or keys of the
            formulation that do not go with levels.
    """
    given = {name: entry[KEY] for name, entry in tasks if isinstance(entry, dict) and KEY in entry}
    if not given and formulation.get(KEY) is None:
        return None
    idle = [key for key in _BY_WEIGHT if formulation.get(key) is not None]
    if idle:
        raise ParamsError(
            f"formulation.{idle[0]}: expected none (null) beside strict priorities, got {formulation[idle[0]]!r}"
        )
    levels = tuple(_level(f"tasks.{name}.{KEY}", given.get(name, 1)) for name, _ in tasks)
    robustness = _level(f"formulation.{KEY}", formulation[KEY]) if formulation.get(KEY) is not None else None
    if measure == "individual" and robustness is None:
        robustness = max(levels) + 1
    return Priorities(levels, robustness)


def without_priorities(tasks: Sequence[tuple[str, Any]]) -> list[tuple[str, Any]]:
    """The entries as the tasks themselves know them."""
    return [
        (name, {key: value for key, value in entry.items() if key != KEY} if isinstance(entry, dict) else entry)
        for name, entry in tasks
    ]


def _level(where: str, value: object) -> int:
    number = fields.number(where, value)
    if number != round(number) or number < 1:
        raise ParamsError(f"{where}: expected 1, 2, ..., got {value!r}")
    return round(number)
