"""Newton's method (SQP) for a convex program inside linear limits (`drake_tc.kernels.newton`), within a budget."""

from typing import NamedTuple

import numpy as np

from drake_tc.kernels.lazy import Kernel
from drake_tc.tsid.qp.problem import Outcome, QpSolver, QuadraticProgram
from drake_tc.tsid.robust.active_set import FREE, ActiveSet, step_by_program
from drake_tc.tsid.robust.budget import Budget, Spending
from drake_tc.tsid.robust.convex import ConvexProgram
from drake_tc.types import FloatArray

_MINIMUM = Kernel("searches", "minimum")
_FAILED, _ASKS, _PAUSED = 2, 10, 11
_FRESH, _ANSWERED, _RESUMED = 0, 1, 2
_INSIDE, _STEPS, _DONE, _RISK, _VALUE = 2, 4, 5, 6, 7
_NEW = np.zeros((0, 0)), np.zeros(0), np.zeros(0), np.zeros(0)


class Minimum(NamedTuple):
    """Where the method ended.

    Attributes:
        x: (N,) The best feasible iterate; the last one where none was feasible.
        value: f there.
        risk: R there.
        active_set: Rows that hold it, with their multipliers.
        outcome: SOLVED where x is feasible, converged or not.
        converged: Whether the descent still to be had is below the accuracy.
        iterations: Steps.
        programs: Of them by the QP solver.
    """

    x: FloatArray
    value: float
    risk: float
    active_set: ActiveSet
    outcome: Outcome
    converged: bool
    iterations: int
    programs: int


def minimise(
    program: ConvexProgram,
    qp: QpSolver,
    x: FloatArray,
    *,
    active_set: ActiveSet = FREE,
    accuracy: float = 0.0,
    spending: Spending | None = None,
) -> Minimum:
    """The least f(x), lower <= A x <= upper.

    Args:
        program: In units in which 1 is one sigma.
        qp: For steps whose active set cannot be guessed.
        x: (N,) Start; may be infeasible.
        active_set: First guess of the rows that hold the minimum.
        accuracy: Stop when the conditions of optimality are missed by what promises less descent of f; or by rounding.
        spending: When to stop before; the first step is always taken. None: a whole budget of its own.
    """
    if x.size == 0:
        here = program.at(x)
        return Minimum(x, here.value, here.risk, FREE, Outcome.SOLVED, True, 0, 0)
    spending = Budget().started() if spending is None else spending
    before, how, steps, programs = _NEW, _FRESH, 0, 0
    sides = program.lower, program.upper
    while True:
        arguments = program.arguments(accuracy, spending.most(), how)
        code, x, *held, hessian, gradient, memory = _MINIMUM(*arguments, *sides, x, *active_set, *before)
        active_set, taken = ActiveSet(*held), int(memory[_STEPS])
        steps += taken
        spending.steps(taken)
        outcome, done = Outcome.SOLVED, memory[_DONE] > 0.0
        if code == _PAUSED and not spending.late():
            before, how = (hessian, gradient, _NEW[2], memory), _RESUMED
            continue
        if code == _ASKS:
            programs += 1
            outcome, active_set, step = _asked(program, x, hessian, gradient, active_set, qp)
            if outcome is Outcome.SOLVED:
                before, how = (hessian, gradient, step, memory), _ANSWERED
                continue
            steps, done = steps + 1, False
            outcome = Outcome.SOLVED if memory[_INSIDE] > 0.0 else outcome
        elif code == _FAILED:
            outcome, done = Outcome.FAILED, False
        return Minimum(x, memory[_VALUE], memory[_RISK], active_set, outcome, bool(done), steps, programs)


def _asked(
    program: ConvexProgram,
    x: FloatArray,
    hessian: FloatArray,
    gradient: FloatArray,
    active_set: ActiveSet,
    qp: QpSolver,
) -> tuple[Outcome, ActiveSet, FloatArray]:
    """The QP solver's step from x, its rows, and [d; A d]; the active set as it was where there is none."""
    rows = program.rows()
    value = rows.matrix @ x
    step = QuadraticProgram(hessian, gradient, rows.matrix, rows.lower - value, rows.upper - value, rows.bounds)
    solution, found = step_by_program(step, active_set, qp)
    if solution.outcome is not Outcome.SOLVED:
        return solution.outcome, active_set, np.zeros(0)
    return Outcome.SOLVED, found, np.concatenate((solution.x, rows.matrix @ solution.x))
