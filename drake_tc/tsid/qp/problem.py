"""A dense quadratic program and its answer, and what all adapters of solvers do with both.

Some problems no solver can take, and some answers hold nothing. Solvers that want positive definite Hessians get
programs freed from units (a Hessian with a unit diagonal, a gradient and rows of length one) and proximal steps where
the Hessian is singular.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Protocol

import numpy as np

from drake_tc.types import FloatArray


class Outcome(IntEnum):
    """How a solver ended.

    SOLVED: With an answer.
    INFEASIBLE: No point keeps the limits.
    FAILED: It does not know.
    RISKY: Of robust programs that shall keep R <= R_min: a point that keeps the limits, but not this.
    """

    SOLVED = 0
    INFEASIBLE = 1
    FAILED = 2
    RISKY = 3


@dataclass(frozen=True, eq=False)
class QuadraticProgram:
    """min 1/2 x^T H x + c^T x  subject to  lower <= A x <= upper; equal sides are an equality.

    Attributes:
        hessian: (n, n) H, symmetric, positive semidefinite.
        gradient: (n,) c.
        matrix: (m, n) A; its first `bounds` rows are the identity's first rows.
        lower, upper: (m,), infinite where a side has no limit.
        bounds: How many leading rows are bounds on the variables themselves.
    """

    hessian: FloatArray
    gradient: FloatArray
    matrix: FloatArray
    lower: FloatArray
    upper: FloatArray
    bounds: int = 0


@dataclass(frozen=True, eq=False)
class QpSolution:
    """What a solver found.

    Attributes:
        x: (n,).
        multipliers: (m,) of H x + c + A^T multipliers = 0; positive at the upper side, negative at the lower.
        outcome: See `Outcome`; x is meaningful when SOLVED.
        iterations: Of the solver.
    """

    x: FloatArray
    multipliers: FloatArray
    outcome: Outcome
    iterations: int


class QpSolver(Protocol):
    """Stateless from outside: what it knows of the last problem comes in as `start`."""

    def solve(self, problem: QuadraticProgram, start: QpSolution | None = None) -> QpSolution:
        """Solve, from `start` (the last tick's answer) where there is one; never raises on an infeasible problem."""
        ...


_MISSED = 1e-8


def is_usable(problem: QuadraticProgram) -> bool:
    """Whether H, c and A are finite and no side is NaN; by sums of squares, as that costs least."""
    h, a = problem.hessian.ravel(order="K"), problem.matrix.ravel(order="K")
    numbers = h.dot(h) + problem.gradient.dot(problem.gradient) + a.dot(a)
    sides = problem.lower.dot(problem.lower) + problem.upper.dot(problem.upper)
    return bool(numbers < np.inf and sides == sides)


def is_crossed(problem: QuadraticProgram) -> bool:
    """Whether a row alone rules out every x: lower > upper, or an infinity on the wrong side."""
    low, high = problem.lower, problem.upper
    return bool((low > high).any() or (low == np.inf).any() or (high == -np.inf).any())


def keeps_rows(problem: QuadraticProgram, x: FloatArray) -> bool:
    """Whether no row is missed by 1e-8 of its value: methods of active sets may err where rows depend on others."""
    value = problem.matrix.dot(x)
    if not value.size or np.minimum(value - problem.lower, problem.upper - value).min() >= -_MISSED:
        return True
    slack = _MISSED * (1.0 + np.abs(value))
    return bool(((value - slack <= problem.upper) & (value + slack >= problem.lower)).all())


def unsolved(problem: QuadraticProgram, outcome: Outcome, iterations: int = 0) -> QpSolution:
    """No answer: x and the multipliers are NaN."""
    m, n = problem.matrix.shape
    return QpSolution(np.full(n, np.nan), np.full(m, np.nan), outcome, iterations)


def usable_start(problem: QuadraticProgram, start: QpSolution | None) -> QpSolution | None:
    """`start` where it is an answer to a problem of this size, else None."""
    if start is None or start.outcome != Outcome.SOLVED:
        return None
    fits = start.multipliers.size == problem.lower.size and start.x.size == problem.gradient.size
    return start if fits else None


def refused(problem: QuadraticProgram) -> QpSolution | None:
    """The answer to a problem that no solver needs to see: numbers that are not, or a row without any x."""
    if not is_usable(problem):
        return unsolved(problem, Outcome.FAILED)
    return unsolved(problem, Outcome.INFEASIBLE) if is_crossed(problem) else None


@dataclass(frozen=True, eq=False)
class Scaled:
    """The same problem over z, x = unit z.

    Attributes:
        problem: Over z.
        unit: (n,) of the variables.
        row_unit: (m,) of the rows.
        cost_unit: Of the cost.
    """

    problem: QuadraticProgram
    unit: FloatArray
    row_unit: FloatArray
    cost_unit: float

    def there(self, start: QpSolution | None) -> QpSolution | None:
        """A start, over z; None where its numbers are none there."""
        if start is None:
            return None
        x, multipliers = start.x / self.unit, start.multipliers * (self.row_unit / self.cost_unit)
        if not (np.isfinite(x).all() and np.isfinite(multipliers).all()):
            return None
        return replace(start, x=x, multipliers=multipliers)

    def back(self, found: QpSolution) -> QpSolution:
        """A solution, over x; what a method that iterates leaves as push from a side that is not there is taken off."""
        if found.outcome is not Outcome.SOLVED:
            return found
        multipliers = found.multipliers * (self.cost_unit / self.row_unit)
        over = self.problem
        multipliers[(multipliers > 0.0) & (over.upper == np.inf) | (multipliers < 0.0) & (over.lower == -np.inf)] = 0.0
        return replace(found, x=found.x * self.unit, multipliers=multipliers)


def scaled(problem: QuadraticProgram) -> Scaled:
    """Scale a problem: unit_i = size / sqrt(H_ii), size = max |c_i| / sqrt(H_ii); the cost over size^2."""
    diagonal = problem.hessian.diagonal()
    root = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    size = float(np.abs(problem.gradient * root).max(initial=0.0)) or 1.0
    unit = size * root
    matrix = problem.matrix * unit
    row_unit = np.sqrt(np.einsum("ij,ij->i", matrix, matrix))
    row_unit[row_unit == 0.0] = 1.0
    row_unit[: problem.bounds] = unit[: problem.bounds]
    over = QuadraticProgram(
        problem.hessian * root * root[:, None],
        problem.gradient * (root / size),
        matrix / row_unit[:, None],
        problem.lower / row_unit,
        problem.upper / row_unit,
        problem.bounds,
    )
    return Scaled(over, unit, row_unit, size * size)


_WEAK = (1e-9, 2)
"""eps as a share of the scaled H's diagonal, above rounding but below curvatures that matter, and its steps."""
_STRONGER = ((1e-6, 20), (1e-3, 50))
_REST = 1e-6
"""Share of the gradient by which a last proximal step may miss the optimum's own."""
_STILL = 1e-9
"""Of the scaled variables, between steps."""
_CONFLICT = 1e-8
"""What equalities may miss, over the largest side."""

Solve = Callable[[QuadraticProgram, QpSolution | None], QpSolution]


def solve_scaled(problem: QuadraticProgram, start: QpSolution | None, strict: Solve) -> QpSolution:
    """Solve by a method for positive definite Hessians.

    The problem is scaled. If that does not suffice, proximal steps over the scaled z, z_i = argmin cost + eps/2
    |z - z_(i-1)|^2 from z_0 = 0, go to the optimum with the smallest z; in a direction of curvature lambda a step
    leaves eps / (eps + lambda) of the way. There are two with a weak eps. Where the method still finds nothing although
    it finds a feasible point for the cost |z|^2, which no curvature can spoil, there are more, with stronger ones.
    Steps that do not come to rest have no optimum to go to: FAILED.

    Args:
        problem: Its Hessian is positive semidefinite.
        start: As of `QpSolver`.
        strict: Solves positive definite problems; FAILED where it finds that one is not.
    """
    over = scaled(problem)
    started = over.there(start)
    found = strict(over.problem, started)
    if found.outcome is Outcome.FAILED:
        found = _stepped(over.problem, started, strict, *_WEAK)
    if found.outcome is not Outcome.SOLVED:
        nearest = replace(over.problem, hessian=np.eye(over.unit.size), gradient=np.zeros(over.unit.size))
        feasible = strict(nearest, None)
        if feasible.outcome is not Outcome.SOLVED:
            conflict = feasible.outcome is Outcome.INFEASIBLE or _equalities_conflict(over.problem)
            return unsolved(problem, Outcome.INFEASIBLE if conflict else Outcome.FAILED, found.iterations)
        for eps, steps in _STRONGER:
            found = _stepped(over.problem, None, strict, eps, steps)
            if found.outcome is Outcome.SOLVED:
                break
        else:
            return unsolved(problem, Outcome.FAILED, found.iterations)
    return over.back(found)


def _stepped(problem: QuadraticProgram, start: QpSolution | None, strict: Solve, eps: float, steps: int) -> QpSolution:
    hessian = problem.hessian + eps * np.eye(problem.gradient.size)
    last, iterations, moved = np.zeros(problem.gradient.size), 0, np.inf
    for _ in range(steps):
        start = strict(replace(problem, hessian=hessian, gradient=problem.gradient - eps * last), start)
        iterations += start.iterations
        if start.outcome is not Outcome.SOLVED:
            return unsolved(problem, start.outcome, iterations)
        moved, last = float(np.abs(start.x - last).max(initial=0.0)), start.x
        if moved <= _STILL * (1.0 + float(np.abs(last).max(initial=0.0))):
            break
    if start is None or not eps * moved <= _REST:
        return unsolved(problem, Outcome.FAILED, iterations)
    return replace(start, iterations=iterations)


def _equalities_conflict(problem: QuadraticProgram) -> bool:
    """Whether the rows whose sides are equal rule each other out."""
    same = problem.lower == problem.upper
    rows, sides = problem.matrix[same], problem.lower[same]
    nearest = np.linalg.lstsq(rows, sides, rcond=None)[0]
    return bool(np.abs(rows @ nearest - sides).max(initial=0.0) > _CONFLICT * (1.0 + np.abs(sides).max(initial=0.0)))
