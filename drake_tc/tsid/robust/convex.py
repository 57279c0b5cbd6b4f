"""Convex programs inside linear limits, and Newton's method (SQP) for them within a budget.

Both are compiled (`drake_tc.kernels.tsid.programs` and `.newton`); where the rows that hold a step cannot be guessed, a
QP solver is asked.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from drake_tc.kernels.calls import Kernel
from drake_tc.tsid.qp import Outcome, QpSolution, QpSolver, QuadraticProgram
from drake_tc.tsid.robust.scaled import ScaledProblem, ScaledRows, Spending
from drake_tc.tsid.rows import LeastSquares
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

    def with_risk(self, rows: ScaledRows, weight: float) -> "ConvexProgram":
        """The objective and w R_ind(x) of the limits with sides that may be farther off."""
        return self._replace(risk_lower=rows.lower, risk_upper=rows.upper, weight=weight)

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
    cost: LeastSquares, limits: ScaledRows, *, linear: FloatArray | None = None, damping: float = 0.0
) -> ConvexProgram:
    """||D x - d||^2 + c^T x inside limits; `ConvexProgram.with_risk` adds w R_ind(x).

    Args:
        cost: D, d.
        limits: lower <= A x <= upper.
        linear: (n,) c; None for 0.
        damping: Added to the Hessian's diagonal.
    """
    return ConvexProgram(
        PLAIN,
        limits.matrix,
        _NONE,
        _NOTHING,
        cost,
        _NOTHING if linear is None else linear,
        _NOTHING,
        _NOTHING,
        0.0,
        damping,
        0.0,
        limits.lower,
        limits.upper,
        limits.bounds,
    )


def rectangle(problem: ScaledProblem, held: FloatArray, width: float, weight: float) -> ConvexProgram:
    """||D x - d||^2 + w R_rect over (x, a, b), its box inside limits (Del Prete and Mansard, 2015, eq. 15 and 16).

    Args:
        problem: D, d, the limits and (m, r) K.
        held: (m,) sides that x itself is to keep.
        width: Least width of the box along each axis [sigma].
        weight: w.
    """
    limits = problem.limits
    numbers = weight, 0.0, width
    rows = limits.matrix, problem.noise, held
    none = _NOTHING, _NOTHING, _NOTHING
    return ConvexProgram(RECTANGLE, *rows, problem.cost, *none, *numbers, limits.lower, limits.upper)


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


class SolverMeans(NamedTuple):
    """With what a program is solved.

    Attributes:
        qp: For steps whose active set cannot be guessed.
        accuracy: Stop when the conditions of optimality are missed by what promises less descent of the objective; or
            by rounding. Of the programs of `measures`: [of R].
        spending: When to stop before; the first step is always taken.
    """

    qp: QpSolver
    accuracy: float
    spending: Spending


def minimise(program: ConvexProgram, x: FloatArray, active_set: ActiveSet, means: SolverMeans) -> Minimum:
    """The least f(x), lower <= A x <= upper.

    Args:
        program: In units in which 1 is one sigma.
        x: (N,) Start; may be infeasible.
        active_set: First guess of the rows that hold the minimum.
        means: With what it is solved.
    """
    if x.size == 0:
        here = program.at(x)
        return Minimum(x, here.value, here.risk, FREE, Outcome.SOLVED, True, 0, 0)
    spending = means.spending
    before, how, steps, programs = _NEW, _FRESH, 0, 0
    sides = program.lower, program.upper
    while True:
        arguments = program.arguments(means.accuracy, spending.most(), how)
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
            outcome, active_set, step = _asked(program, x, (hessian, gradient), active_set, means.qp)
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
    bend: tuple[FloatArray, FloatArray],
    active_set: ActiveSet,
    qp: QpSolver,
) -> tuple[Outcome, ActiveSet, FloatArray]:
    """The QP solver's step from x by Hessian and gradient, its rows, and [d; A d].

    The active set stays as it was where there is none.
    """
    rows = program.rows()
    value = rows.matrix @ x
    step = QuadraticProgram(*bend, rows.matrix, rows.lower - value, rows.upper - value, rows.bounds)
    solution, found = step_by_program(step, active_set, qp)
    if solution.outcome is not Outcome.SOLVED:
        return solution.outcome, active_set, np.zeros(0)
    return Outcome.SOLVED, found, np.concatenate((solution.x, rows.matrix @ solution.x))
