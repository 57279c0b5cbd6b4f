"""ProxQP: a primal-dual augmented Lagrangian method (Bambade et al., RSS 2022); `proxsuite` on PyPI."""

import numpy as np
from proxsuite import proxqp  # type: ignore[import-not-found, import-untyped, unused-ignore]

from drake_tc.tsid.qp.common import refused, unsolved, usable_start
from drake_tc.tsid.qp.problem import Outcome, QpSolution, QuadraticProgram
from drake_tc.tsid.qp.scaling import scaled

_INFEASIBLE = (
    proxqp.QPSolverOutput.PROXQP_PRIMAL_INFEASIBLE,
    proxqp.QPSolverOutput.PROXQP_SOLVED_CLOSEST_PRIMAL_FEASIBLE,
)


PROOF = 1e-8
"""What a proof of contradictory rows may lack, relative to its size. ProxQP's own 1e-4 takes steps on the way to the
solution of saturated problems for such proofs."""

ITERATIONS = 1500
"""Feasible problems of the 30-joint robot take 70 as a rule, and 1213 at worst where the cost is singular."""


class ProxQp:
    """`QpSolver` by ProxQP, from x and the multipliers of `start`.

    Contradictory rows may be told as FAILED: the iterations may be up before there is a proof.
    """

    def __init__(self, tolerance: float = 1e-12) -> None:
        """Keep the tolerance, of the residuals of the scaled problem."""
        self._tolerance = tolerance

    def solve(self, problem: QuadraticProgram, start: QpSolution | None = None) -> QpSolution:
        """See `QpSolver`."""
        answer = refused(problem)
        if answer is not None:
            return answer
        over = scaled(problem)
        return over.back(self._solve(over.problem, over.there(usable_start(problem, start))))

    def _solve(self, problem: QuadraticProgram, start: QpSolution | None) -> QpSolution:
        """The scaled problem."""
        same = problem.lower == problem.upper
        equal, rest = np.flatnonzero(same), np.flatnonzero(~same)
        solver = proxqp.dense.QP(problem.gradient.size, equal.size, rest.size)
        settings = solver.settings
        settings.eps_abs, settings.eps_rel, settings.max_iter = self._tolerance, 0.0, ITERATIONS
        settings.eps_primal_inf = settings.eps_dual_inf = PROOF
        solver.init(
            problem.hessian,
            problem.gradient,
            problem.matrix[equal],
            problem.lower[equal],
            problem.matrix[rest],
            problem.lower[rest],
            problem.upper[rest],
        )
        if start is None:
            solver.solve()
        else:
            settings.initial_guess = proxqp.InitialGuess.WARM_START
            solver.solve(start.x, start.multipliers[equal], start.multipliers[rest])
        found = solver.results
        iterations = int(found.info.iter)
        if found.info.status != proxqp.QPSolverOutput.PROXQP_SOLVED:
            outcome = Outcome.INFEASIBLE if found.info.status in _INFEASIBLE else Outcome.FAILED
            return unsolved(problem, outcome, iterations)
        multipliers = np.empty(problem.lower.size)
        multipliers[equal], multipliers[rest] = found.y, found.z
        return QpSolution(np.array(found.x), multipliers, Outcome.SOLVED, iterations)
