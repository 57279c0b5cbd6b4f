"""ProxQP: a primal-dual augmented Lagrangian method (Bambade et al., RSS 2022); `proxsuite` on PyPI."""

from typing import Any

import numpy as np
from proxsuite import proxqp  # type: ignore[import-not-found, import-untyped, unused-ignore]

from drake_tc.tsid.qp.common import refused, unsolved, usable_start
from drake_tc.tsid.qp.problem import Outcome, QpSolution, QuadraticProgram
from drake_tc.tsid.qp.scaling import scaled

_INFEASIBLE = (
    proxqp.QPSolverOutput.PROXQP_PRIMAL_INFEASIBLE,
    proxqp.QPSolverOutput.PROXQP_SOLVED_CLOSEST_PRIMAL_FEASIBLE,
)


class ProxQp:
    """`QpSolver` by ProxQP, from x and the multipliers of `start`."""

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
        equal = same.nonzero()[0] if same.any() else None
        rest = slice(None) if equal is None else np.flatnonzero(~same)
        guess: dict[str, Any] = {}
        if start is not None:
            guess = {"x": start.x, "z": start.multipliers[rest], "initial_guess": proxqp.InitialGuess.WARM_START}
            guess["y"] = np.zeros(0) if equal is None else start.multipliers[equal]
        found = proxqp.dense.solve(
            problem.hessian,
            problem.gradient,
            None if equal is None else problem.matrix[equal],
            None if equal is None else problem.lower[equal],
            problem.matrix[rest],
            problem.lower[rest],
            problem.upper[rest],
            eps_abs=self._tolerance,
            eps_rel=0.0,
            **guess,
        )
        iterations = int(found.info.iter)
        if found.info.status != proxqp.QPSolverOutput.PROXQP_SOLVED:
            outcome = Outcome.INFEASIBLE if found.info.status in _INFEASIBLE else Outcome.FAILED
            return unsolved(problem, outcome, iterations)
        multipliers = np.zeros(problem.lower.size)
        multipliers[rest] = found.z
        if equal is not None:
            multipliers[equal] = found.y
        return QpSolution(np.array(found.x), multipliers, Outcome.SOLVED, iterations)
