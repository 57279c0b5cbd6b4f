"""Rows that hold a solution, and the QP solver's answer where they cannot be guessed.

What a formulation of robust TSID hands back.
"""

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


class Start(NamedTuple):
    """What the next tick's solve may know of this one; a change of the contacts makes only a part of it useless.

    Attributes:
        torque: (n,) [N m].
        rows: How many rows the problem had, for which `active_set` is meant.
        active_set: Rows that held the solution.
        weight: Of the robustness where a constraint R <= R_min chose it; 0 elsewhere.
        inner: The box: half width (1,) of "box", sides (2 r,) [sigma] of "rectangle" and the rows (m,) at which x
            itself is held; None elsewhere.
    """

    torque: FloatArray
    rows: int
    active_set: ActiveSet
    weight: float = 0.0
    inner: FloatArray | None = None


class RobustSolution(NamedTuple):
    """A torque and how safe it is.

    Attributes:
        torque: (n,) [N m]; finite whatever the outcome.
        robustness: R = -log p of the formulation's own approximation of p (R_ind, R_rect, R_box); 0 for "classic".
        p_ind: Product of the probabilities of all sides (Del Prete and Mansard, 2015, eq. 7) at the torque,
            whatever the formulation's measure.
        cost: ||D tau - d||^2.
        active: (m,) 1 at the upper side, -1 at the lower side, 0 elsewhere.
        outcome: SOLVED where the torque keeps every limit, and R <= R_min where that was asked for; RISKY where it
            keeps the limits alone.
        converged: Whether the accuracy was reached within the budget.
        iterations: Steps of Newton's method.
        programs: Steps that needed the QP solver.
        start: For the next tick.
    """

    torque: FloatArray
    robustness: float
    p_ind: float
    cost: float
    active: IntArray
    outcome: Outcome
    converged: bool
    iterations: int
    programs: int
    start: Start | None
