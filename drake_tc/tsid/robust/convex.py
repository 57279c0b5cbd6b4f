"""Convex programs inside linear limits as data: what `newton.minimise` solves (`drake_tc.kernels.tsid.programs`).

Newton's method (SQP) for a convex program inside linear limits (`drake_tc.kernels.tsid.newton`), within a budget.
"""

from typing import NamedTuple

import numpy as np

from drake_tc.kernels.calls import Kernel
from drake_tc.tsid.qp.problem import Outcome, QpSolver, QuadraticProgram
from drake_tc.tsid.robust.active_set import FREE, ActiveSet, step_by_program
from drake_tc.tsid.robust.options import Budget, Spending
from drake_tc.tsid.robust.scaled import ScaledRows
from drake_tc.tsid.rows import LeastSquares
from drake_tc.types import FloatArray

PLAIN, RECTANGLE = 0, 1
_DESCRIBED, _WRITTEN_OUT = Kernel("tsid.newton", "described"), Kernel("tsid.newton", "written_out")
_NONE: FloatArray = np.zeros((0, 0))
_NOTHING: FloatArray = np.zeros(0)


class Value(NamedTuple):
    """The objective at one x (N,).

    Attributes:
        value: f.
        risk: R.
        gradient: (N,).
        hessian: (N, N), with the damping that makes it positive definite.
        slope, bend: (m,) derivatives of R_ind by each row's own A_i x.
    """

    value: float
    risk: float
    gradient: FloatArray
    hessian: FloatArray
    slope: FloatArray
    bend: FloatArray


class ConvexProgram(NamedTuple):
    """An objective and its limits, over x (N,); use `plain` or `rectangle` to make one.

    Attributes:
        kind: PLAIN or RECTANGLE.
        matrix: (m, n) A of the limits.
        noise: (m, r) K of a rectangle.
        held: (m,) sides that a rectangle's x itself keeps: 1 the upper, -1 the lower, 0 none.
        cost: D, d.
        linear: (N,) c.
        risk: Rows of R_ind.
        weight: w.
        damping: Added to the Hessian's diagonal.
        width: Least width of a rectangle along each axis [sigma].
        lower, upper: (m,) of the limits.
        bounds: How many leading limits are bounds on x itself.
    """

    kind: int
    matrix: FloatArray
    noise: FloatArray
    held: FloatArray
    cost: LeastSquares
    linear: FloatArray
    risk_lower: FloatArray
    risk_upper: FloatArray
    weight: float
    damping: float
    width: float
    lower: FloatArray
    upper: FloatArray
    bounds: int = 0

    @property
    def bends(self) -> bool:
        """Whether the Hessian changes with x."""
        return self.weight > 0.0

    def arguments(self, *search: float) -> tuple[object, ...]:
        """`drake_tc.kernels.tsid.newton.Data`; search: accuracy, steps until it pauses, how it begins."""
        numbers = np.array((self.weight, self.damping, self.width, *search))
        sides = self.risk_lower, self.risk_upper
        cost = self.cost
        return self.kind, self.matrix, self.noise, self.held, cost.matrix, cost.target, self.linear, *sides, numbers

    def at(self, x: FloatArray) -> Value:
        """The objective at x (N,)."""
        return Value(*_DESCRIBED(self.arguments(), x))

    def rows(self) -> ScaledRows:
        """The limits over all N variables, written out."""
        if self.kind == PLAIN:
            return ScaledRows(self.matrix, self.lower, self.upper, self.bounds)
        return ScaledRows(*_WRITTEN_OUT(self.arguments(), (self.lower, self.upper)))


def plain(
    cost: LeastSquares,
    limits: ScaledRows,
    *,
    linear: FloatArray | None = None,
    risk: ScaledRows | None = None,
    weight: float = 0.0,
    damping: float = 0.0,
) -> ConvexProgram:
    """||D x - d||^2 + c^T x + w R_ind(x) inside limits.

    Args:
        cost: D, d.
        limits: lower <= A x <= upper.
        linear: (n,) c; None for 0.
        risk: Rows of R_ind: the limits with sides that may be farther off; None for w = 0.
        weight: w.
        damping: Added to the Hessian's diagonal.
    """
    sides = (_NOTHING, _NOTHING) if risk is None else (risk.lower, risk.upper)
    return ConvexProgram(
        PLAIN,
        limits.matrix,
        _NONE,
        _NOTHING,
        cost,
        _NOTHING if linear is None else linear,
        *sides,
        0.0 if risk is None else weight,
        damping,
        0.0,
        limits.lower,
        limits.upper,
        limits.bounds,
    )


def rectangle(
    cost: LeastSquares, limits: ScaledRows, noise: FloatArray, held: FloatArray, width: float, weight: float
) -> ConvexProgram:
    """||D x - d||^2 + w R_rect over (x, a, b), its box inside limits (Del Prete and Mansard, 2015, eq. 15 and 16).

    Args:
        cost: D, d.
        limits: lower <= A x <= upper.
        noise: (m, r) K.
        held: (m,) sides that x itself is to keep.
        width: Least width of the box along each axis [sigma].
        weight: w.
    """
    sides = limits.lower, limits.upper
    return ConvexProgram(
        RECTANGLE, limits.matrix, noise, held, cost, _NOTHING, _NOTHING, _NOTHING, weight, 0.0, width, *sides
    )


_MINIMUM = Kernel("tsid.newton", "minimum")
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
        code, x, held, hessian, gradient, memory = _MINIMUM(arguments, sides, x, tuple(active_set), before)
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
