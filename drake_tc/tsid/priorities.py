"""Tasks on strict levels of priority, robustness on a level of its own: how a law uses them.

Strict priorities: each level is solved within what the levels above leave free, robustness at any of them.

    level 1: min f_1(tau), lower <= G tau <= upper
    level k: min f_k(tau), the same limits, f_1 .. f_(k-1) at the values that they have reached

f_k is ||D_k tau - d_k||^2 or R_ind. The minimisers of a level share D_k tau, and of R_ind the margins of all sides that
bend it, so level k is a problem over y, tau = tau_(k-1) + T y, T an orthonormal basis of what is left free.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import Kernel
from drake_tc.robot import fields
from drake_tc.tsid.qp import Outcome, QpSolver
from drake_tc.tsid.robust.convex import FREE, RobustSolution, SolverMeans, Start, Value, plain
from drake_tc.tsid.robust.measures import Guess, ProgramResult, individual, least_cost
from drake_tc.tsid.robust.scaled import RANK, Options, ScaledProblem, nothing, null_basis
from drake_tc.tsid.rows import LeastSquares
from drake_tc.types import FloatArray, IntArray

BENT = 1e-9
"""Curvature of -log Phi below which a side counts as out of sight: levels below robustness may move along it."""

_SOLVE_LEVEL = Kernel("tsid.levels", "solve_level")
_EVALUATED = Kernel("tsid.scaling", "evaluated")


@dataclass(frozen=True)
class Robustness:
    """R_ind as a level."""


Level = LeastSquares | Robustness


class _Descent(NamedTuple):
    """Where the levels ended; where one was not solved, the torque (n,) [N m] is that of the levels above it."""

    torque: FloatArray
    outcome: Outcome
    converged: bool
    iterations: int
    programs: int


def _descended(levels: Sequence[Level], problem: ScaledProblem, x: FloatArray | None, means: SolverMeans) -> _Descent:
    """The levels, their costs over x with tau = scale x, from `x` on."""
    n, sides = len(problem.scale), tuple(problem.limits[:3])
    x, basis = np.zeros(n) if x is None else x, np.eye(n)
    steps, programs, outcome, converged = 0, 0, Outcome.SOLVED, True
    for number, level in enumerate(levels):
        last = number == len(levels) - 1
        if steps and not basis.shape[1]:
            continue
        if isinstance(level, LeastSquares):
            inside, there, left = _SOLVE_LEVEL(tuple(level), sides, x, basis)
            if inside and not (last and left.shape[1]):
                x, basis, steps = there, left, steps + 1
                continue
        elif steps and not (_risk_at(problem, x).bend > BENT).any():
            steps += 1  # all sides are out of sight of x, which is inside the limits: nothing is to be gained
            continue
        found, fixed = _solve(level, problem, x, basis, means)
        steps, programs, converged = steps + found.iterations, programs + found.programs, converged and found.converged
        if found.outcome is not Outcome.SOLVED:
            outcome = found.outcome
            break
        x = x + basis @ found.x
        if not last:
            basis = basis @ null_basis(fixed)
    torque = x * problem.scale
    if not np.isfinite(torque).all():
        torque, outcome = np.zeros(n), Outcome.FAILED
    return _Descent(torque, outcome, converged, steps, programs)


def _solve(
    level: Level, problem: ScaledProblem, x: FloatArray, basis: FloatArray, means: SolverMeans
) -> tuple[ProgramResult, FloatArray]:
    """The level's minimum over y, tau / scale = x + T y, and the rows over y that its minimisers share."""
    guess = Guess(np.zeros(basis.shape[1]))
    if isinstance(level, LeastSquares):
        inside = problem._replace(cost=level).along(x, basis)
        left, length = (np.einsum("ij,ij->i", rows, rows) for rows in (inside.cost.matrix, level.matrix))
        decided = left <= RANK * RANK * length  # by the levels above: what is left of such rows is rounding
        matrix = np.where(decided[:, None], 0.0, inside.cost.matrix)
        return least_cost(inside._replace(cost=LeastSquares(matrix, inside.cost.target)), guess, means), matrix
    inside = problem._replace(cost=nothing(len(x))).along(x, basis)
    found = individual(inside, 1.0, guess, means)
    return found, inside.limits.matrix[_risk_at(inside, found.x).bend > BENT]


def _risk_at(problem: ScaledProblem, x: FloatArray) -> Value:
    rows = problem.erring
    return plain(nothing(len(x)), rows).with_risk(rows, 1.0).at(x)


KEY = "priority"
_BY_WEIGHT = ("use", "weight", "minimum")
"""Keys of a formulation that choose how much robustness may cost; a level of its own says that already."""


@lru_cache(maxsize=64)
def _places(
    tasks: tuple[int, ...], robustness: int | None, sizes: tuple[int, ...]
) -> tuple[slice | IntArray | None, ...]:
    """Where the rows of each level stand among those of all tasks, from the highest on; None for robustness."""
    ends = np.cumsum([0, *sizes]).tolist()
    rows = [np.arange(first, end) for first, end in pairwise(ends)]
    found: list[slice | IntArray | None] = []
    for number in sorted({*tasks, *(() if robustness is None else (robustness,))}):
        if number == robustness:
            found.append(None)
            continue
        own = np.concatenate([part for part, of in zip(rows, tasks, strict=True) if of == number])
        together = own.size and own[-1] - own[0] + 1 == own.size
        found.append(slice(int(own[0]), int(own[-1]) + 1) if together else own)
    return tuple(found)


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

    def levels(self, cost: LeastSquares, sizes: Sequence[int]) -> list[Level]:
        """From the highest to the lowest.

        Args:
            cost: Rows of all tasks, one below the other.
            sizes: How many of each task.
        """
        places = _places(self.tasks, self.robustness, tuple(sizes))
        return [Robustness() if own is None else LeastSquares(cost.matrix[own], cost.target[own]) for own in places]

    def solve(
        self,
        problem: ScaledProblem,
        sizes: Sequence[int],
        qp: QpSolver,
        options: Options,
        start: Start | None = None,
    ) -> RobustSolution:
        """The torque; never raises on numbers.

        Args:
            problem: Of all tasks and limits.
            sizes: How many rows each task has.
            qp: Solver of the steps whose active rows cannot be guessed.
            options: Accuracy of each level, budget of all.
            start: Of the last tick's solution.
        """
        n, limits, cost = len(problem.scale), problem.limits, problem.cost
        first = start.torque / problem.scale if start is not None and start.torque.size == n else None
        means = SolverMeans(qp, options.accuracy, options.budget.started())
        levels = self.levels(cost, sizes)
        try:
            found = _descended(levels, problem, first, means)
        except (np.linalg.LinAlgError, ArithmeticError, LookupError, ValueError):
            active = np.zeros(len(limits.lower), dtype=np.int64)
            return RobustSolution(np.zeros(n), math.inf, 0.0, math.inf, active, Outcome.FAILED, False, 0, 0, None)
        at = found.torque / problem.scale
        _, active, chance, price = _EVALUATED(at, problem.scale, problem.rows, tuple(cost))
        risk = 0.0 if self.robustness is None else _risk_at(problem, at).risk
        counts = found.iterations, found.programs
        begin = Start(found.torque, len(active), FREE)
        return RobustSolution(found.torque, risk, chance, price, active, found.outcome, found.converged, *counts, begin)


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
