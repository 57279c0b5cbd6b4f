"""quadprog: the dual method of Goldfarb and Idnani (Math. Programming 27, 1983); `quadprog` on PyPI."""

import numpy as np
from quadprog import solve_qp  # type: ignore[import-not-found, import-untyped, unused-ignore]

from drake_tc.tsid.qp.common import refused, solve_scaled, unsolved
from drake_tc.tsid.qp.problem import Outcome, QpSolution, QuadraticProgram


class Quadprog:
    """`QpSolver` by quadprog; no use is made of `start`. See `solve_scaled` for singular Hessians."""

    def solve(self, problem: QuadraticProgram, start: QpSolution | None = None) -> QpSolution:
        """See `QpSolver`."""
        answer = refused(problem)
        if answer is not None:
            return answer
        return solve_scaled(problem, None, _strict)


def _strict(problem: QuadraticProgram, start: QpSolution | None) -> QpSolution:
    """As quadprog has it: equalities, then rows >= sides."""
    same = problem.lower == problem.upper
    equal = np.flatnonzero(same)
    low = np.flatnonzero(np.isfinite(problem.lower) & ~same)
    high = np.flatnonzero(np.isfinite(problem.upper) & ~same)
    a = problem.matrix
    rows = np.concatenate((a[equal], a[low], -a[high])).T
    sides = np.concatenate((problem.lower[equal], problem.lower[low], -problem.upper[high]))
    if not sides.size:  # it wants a row
        rows, sides = np.zeros((problem.gradient.size, 1)), np.full(1, -1.0)
    try:
        x, _, _, iterations, dual, _ = solve_qp(problem.hessian, -problem.gradient, rows, sides, equal.size)
    except ValueError as error:  # "constraints are inconsistent, no solution" or "matrix G is not positive definite"
        return unsolved(problem, Outcome.INFEASIBLE if "inconsistent" in str(error) else Outcome.FAILED)
    multipliers = np.zeros(problem.lower.size)
    multipliers[equal] = -dual[: equal.size]
    multipliers[low] -= dual[equal.size : equal.size + low.size]
    multipliers[high] += dual[equal.size + low.size :][: high.size]
    return QpSolution(x, multipliers, Outcome.SOLVED, int(iterations[0]))
