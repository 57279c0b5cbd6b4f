"""Newton's method (SQP) for a convex objective inside linear limits, with what is left of a budget."""

import math
from typing import NamedTuple, Protocol

import numpy as np

from drake_tc.tsid.qp.problem import Outcome, QpSolver
from drake_tc.tsid.robust.budget import Budget, Spending
from drake_tc.tsid.robust.factor import Factor
from drake_tc.tsid.robust.scaled import FEASIBLE, RowProduct
from drake_tc.tsid.robust.step import FREE, Stepper, Working
from drake_tc.types import FloatArray

SUFFICIENT = 1e-4
SHRINK = (0.1, 0.5)
"""Armijo's share of the predicted descent, and by how much one backtracking shortens the step."""

KEEP_HESSIAN, KEEP_WHILE = 0.25, 0.1
"""A step along which no row moves by more sigmas keeps its Hessian for the next one, as long as the descent that is
still promised falls by this factor or more each time."""


class Point(Protocol):
    """A convex function at one x (n,): f, R where it has one, and its derivatives when asked for."""

    x: FloatArray
    value: float

    @property
    def risk(self) -> float:
        """R."""
        ...

    def gradient(self) -> FloatArray:
        """(n,)."""
        ...

    def factor(self) -> Factor:
        """Of the Hessian, made positive definite."""
        ...


class Objective(Protocol):
    """A convex function.

    Attributes:
        rounding: About the error of f by rounding.
        bends: Whether the Hessian changes with x.
    """

    rounding: float
    bends: bool

    def at(self, x: FloatArray) -> Point:
        """The function at x."""
        ...


class Minimum(NamedTuple):
    """Where the method ended.

    Attributes:
        point: The best feasible iterate; the last one where none was feasible.
        working: Rows that hold it, with their multipliers.
        outcome: SOLVED where the point is feasible, converged or not.
        converged: Whether the descent still to be had is below the accuracy.
        iterations: Steps.
        programs: Of them by the QP solver.
    """

    point: Point
    working: Working
    outcome: Outcome
    converged: bool
    iterations: int
    programs: int


def minimise(
    objective: Objective,
    rows: RowProduct,
    qp: QpSolver,
    x: FloatArray,
    *,
    working: Working = FREE,
    accuracy: float = 0.0,
    spending: Spending | None = None,
) -> Minimum:
    """Min f(x), lower <= A x <= upper.

    Each step solves f's quadratic model within the rows, so from the first full step on every iterate is feasible; the
    objective falls from there on by Armijo's rule with backtracking. The rule on the slope that strong Wolfe adds
    protects quasi-Newton updates from steps that are too short; with the exact Hessian of a convex function the full
    step is tried first and nothing needs that protection.

    Args:
        objective: f.
        rows: In units in which 1 is one sigma.
        qp: For steps whose working set cannot be guessed.
        x: (n,) Start; may be infeasible.
        working: First guess of the rows that hold the minimum.
        accuracy: Stop when the conditions of optimality are missed by what promises less descent of f; or by rounding.
        spending: When to stop before; the first step is always taken. None: a whole budget of its own.
    """
    spending = Budget().started() if spending is None else spending
    point = objective.at(x)
    if len(x) == 0:
        return Minimum(point, FREE, Outcome.SOLVED, True, 0, 0)
    value = rows.times(x)
    lower, upper = None if rows.lower is None else rows.lower - value, rows.upper - value
    feasible = _miss(lower, upper) <= FEASIBLE
    if len(working.rows) and int(working.rows.max()) >= len(upper):
        working = FREE
    stepper = Stepper(point.factor(), rows, qp)
    gradient, programs, before, last = point.gradient(), 0, math.inf, math.inf
    iteration = 0
    while True:
        iteration += 1
        spending.step()
        if stepper.failed or not math.isfinite(point.value):
            return Minimum(point, working, Outcome.FAILED, False, iteration, programs)
        step = stepper.step(gradient, lower, upper, working)
        programs += step.qp
        if step.outcome is not Outcome.SOLVED:
            outcome = Outcome.SOLVED if feasible else step.outcome
            return Minimum(point, working, outcome, False, iteration, programs)
        working = step.working
        new, length, slope = objective.at(point.x + step.d), 1.0, -math.inf
        noise = objective.rounding + 1e-15 * abs(point.value)
        if feasible:
            slope = float(gradient.dot(step.d))
            if -slope > noise:
                new, length = _backtrack(objective, point, new, step.d, slope, noise)
            elif new.value > point.value + noise:
                length = 0.0
            if length == 0.0:
                return Minimum(point, working, Outcome.SOLVED, -slope <= 10.0 * noise, iteration, programs)
        elif not math.isfinite(new.value):
            return Minimum(point, working, Outcome.FAILED, False, iteration, programs)
        point, feasible, gradient = new, True, new.gradient()
        rest = stepper.promise(gradient, working) if length == 1.0 else math.inf
        done = rest <= accuracy or (-slope <= noise and rest >= KEEP_WHILE * last)
        if done or spending.late():
            return Minimum(point, working, Outcome.SOLVED, done, iteration, programs)
        moved = length * step.along
        upper = upper - moved
        lower = None if lower is None else lower - moved
        if objective.bends and (np.abs(moved).max(initial=0.0) > KEEP_HESSIAN or rest > KEEP_WHILE * before):
            stepper, before = Stepper(point.factor(), rows, qp), math.inf
        else:
            before = rest
        last = rest


def _miss(lower: FloatArray | None, upper: FloatArray) -> float:
    miss = -float(upper.min(initial=np.inf))
    return miss if lower is None else max(miss, float(lower.max(initial=-np.inf)))


def _backtrack(
    objective: Objective, point: Point, new: Point, d: FloatArray, slope: float, noise: float
) -> tuple[Point, float]:
    """The longest of 1, t1, t1 t2, ... that gives enough descent, each the minimiser of a parabola kept in `SHRINK`."""
    length = 1.0
    while new.value - point.value > SUFFICIENT * length * slope:
        if -slope * length <= noise:
            return point, 0.0
        best = -0.5 * slope * length / (new.value - point.value - slope * length)
        length *= min(max(best, SHRINK[0]), SHRINK[1])
        new = objective.at(point.x + length * d)
    return new, length
