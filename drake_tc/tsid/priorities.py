"""Tasks on strict levels of priority, robustness on a level of its own: how a law uses `hierarchy`."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.robot import fields
from drake_tc.tsid.assembly import cost_of
from drake_tc.tsid.hierarchy import Level, Robustness, hierarchy
from drake_tc.tsid.qp.problem import Outcome, QpSolver
from drake_tc.tsid.reduction import Reduced
from drake_tc.tsid.robust.active_set import FREE
from drake_tc.tsid.robust.individual import p_ind
from drake_tc.tsid.robust.options import Options
from drake_tc.tsid.robust.solution import RobustSolution, Start
from drake_tc.tsid.robust.torque_error import TorqueError
from drake_tc.tsid.rows import TaskRows

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
