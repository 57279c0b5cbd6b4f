"""What all adapters share: problems that no solver can take, and answers that hold nothing."""

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
