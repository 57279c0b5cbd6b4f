"""What all adapters share: problems that no solver can take, and answers that hold nothing.

Quadratic programs freed from units: a Hessian with a unit diagonal, a gradient and rows of length one.

For solvers that want positive definite Hessians: scaled problems, and proximal steps where one is singular.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.tsid.qp.problem import Outcome, QpSolution, QuadraticProgram
from drake_tc.types import FloatArray

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
