"""PIQP: a proximal interior-point method (Schwan et al., CDC 2023); `piqp` on PyPI."""

import numpy as np
import piqp  # type: ignore[import-not-found, import-untyped, unused-ignore]

from drake_tc.tsid.qp.common import refused, unsolved
from drake_tc.tsid.qp.problem import Outcome, QpSolution, QuadraticProgram
from drake_tc.tsid.qp.scaling import scaled

INFINITE = 1e30
"""What PIQP takes for no side."""


class Piqp:
    """`QpSolver` by PIQP; no use is made of `start`, as interior-point methods gain nothing from it.

    It never sees rows without sides, of which it would warn on the standard output; their multipliers are 0.
    """

    def __init__(self, tolerance: float = 1e-12) -> None:
        """Keep the tolerance, of the residuals of the scaled problem, absolute and relative."""
        self._tolerance = tolerance

    def solve(self, problem: QuadraticProgram, start: QpSolution | None = None) -> QpSolution:
        """See `QpSolver`."""
        answer = refused(problem)
        if answer is not None:
            return answer
        over = scaled(problem)
        return over.back(self._solve(over.problem))

    def _solve(self, problem: QuadraticProgram) -> QpSolution:
        """The scaled problem."""
        k, n = problem.bounds, problem.gradient.size
        lower, upper = problem.lower[k:], problem.upper[k:]
        same = lower == upper
        sided = (lower > -INFINITE) | (upper < INFINITE)
        equal, rest = np.flatnonzero(same) + k, np.flatnonzero(~same & sided) + k
        low, high = np.full(n, -np.inf), np.full(n, np.inf)
        low[:k], high[:k] = problem.lower[:k], problem.upper[:k]
        solver = piqp.DenseSolver()
        solver.settings.eps_abs = solver.settings.eps_rel = self._tolerance
        solver.settings.eps_duality_gap_abs = solver.settings.eps_duality_gap_rel = self._tolerance
        solver.setup(
            np.asfortranarray(problem.hessian),
            problem.gradient,
            np.asfortranarray(problem.matrix[equal]),
            problem.lower[equal],
            np.asfortranarray(problem.matrix[rest]),
            problem.lower[rest],
            problem.upper[rest],
            low,
            high,
        )
        status, found = solver.solve(), solver.result
        iterations = int(found.info.iter)
        if status != piqp.PIQP_SOLVED:
            infeasible = status == piqp.PIQP_PRIMAL_INFEASIBLE
            return unsolved(problem, Outcome.INFEASIBLE if infeasible else Outcome.FAILED, iterations)
        multipliers = np.zeros(problem.lower.size)
        multipliers[:k] = (found.z_bu - found.z_bl)[:k]
        multipliers[equal] = found.y
        multipliers[rest] = found.z_u - found.z_l
        return QpSolution(np.array(found.x), multipliers, Outcome.SOLVED, iterations)
