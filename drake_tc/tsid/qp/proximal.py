"""For solvers that want positive definite Hessians: scaled problems, and proximal steps where one is singular."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from drake_tc.tsid.qp.common import unsolved
from drake_tc.tsid.qp.problem import Outcome, QpSolution, QuadraticProgram
from drake_tc.tsid.qp.scaling import scaled

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
