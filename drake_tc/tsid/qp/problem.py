"""A dense quadratic program and its answer."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

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
