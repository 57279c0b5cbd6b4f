"""Rows that hold a solution, and the QP solver's answer where they cannot be guessed."""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from drake_tc.tsid.qp.problem import Outcome, QpSolution, QpSolver, QuadraticProgram
from drake_tc.types import FloatArray, IntArray

ANSWERED = 1e-5
"""What an answer of the QP solver may miss; some answer contradictory limits with anything."""

EMPTY: IntArray = np.zeros(0, dtype=np.int64)


class ActiveSet(NamedTuple):
    """Rows held at one of their sides.

    Attributes:
        rows: (a,) indices.
        sides: (a,) 1 at the upper, -1 at the lower side.
        multipliers: (a,) >= 0 at the upper, <= 0 at the lower side.
    """

    rows: IntArray
    sides: IntArray
    multipliers: FloatArray


FREE = ActiveSet(EMPTY, EMPTY, np.zeros(0))


def step_by_program(program: QuadraticProgram, active_set: ActiveSet, qp: QpSolver) -> tuple[QpSolution, ActiveSet]:
    """The step d of a quadratic program, and the rows that hold it.

    Where the solver's answer misses a limit, or is that there is none, the shortest step which keeps the limits counts:
    only where even that misses them they are contradictory.

    Args:
        program: Over d.
        active_set: A first guess.
        qp: The solver.
    """
    start: QpSolution | None = None
    if len(active_set.rows):
        force = np.zeros(len(program.upper))
        force[active_set.rows] = active_set.sides
        start = QpSolution(np.zeros_like(program.gradient), force, Outcome.SOLVED, 0)
    solution = _answer(program, start, qp)
    if solution.outcome is not Outcome.SOLVED:
        return solution, FREE
    force = solution.multipliers
    held = np.flatnonzero(np.abs(force) > 1e-9 * np.abs(force).max(initial=0.0))
    return solution, ActiveSet(held, np.where(force[held] > 0.0, 1, -1), force[held])


def _answer(program: QuadraticProgram, start: QpSolution | None, qp: QpSolver) -> QpSolution:
    solution = qp.solve(program, start)
    if _keeps(program, solution):
        return solution
    if not math.isfinite(float(program.gradient.sum() + program.hessian.sum() + program.matrix.sum())):
        return replace(solution, outcome=Outcome.FAILED)
    shortest = replace(program, hessian=np.eye(len(program.gradient)), gradient=np.zeros_like(program.gradient))
    solution = qp.solve(shortest)
    return solution if _keeps(program, solution) else replace(solution, outcome=Outcome.INFEASIBLE)


def _keeps(program: QuadraticProgram, solution: QpSolution) -> bool:
    if solution.outcome is not Outcome.SOLVED:
        return False
    along = program.matrix @ solution.x
    return bool((np.maximum(program.lower - along, along - program.upper) <= ANSWERED).all())
