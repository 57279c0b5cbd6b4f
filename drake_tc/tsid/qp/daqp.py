"""DAQP: a dual active-set method (Arnstrom, Bemporad, Axehill, IEEE TAC 2022); `daqp` on PyPI."""

import math
from typing import Any

import numpy as np
from daqp import solve  # type: ignore[import-not-found, import-untyped, unused-ignore]

from drake_tc.tsid.qp.common import is_usable, keeps_rows, solve_scaled, unsolved, usable_start
from drake_tc.tsid.qp.problem import Outcome, QpSolution, QuadraticProgram

_SENSE = np.array([0, 1, 3], dtype=np.int32)
"""DAQP's `sense` of rows that do not push, push from above, and (last, so at -1) from below."""
_INFEASIBLE, _SINGULAR = -1, -5  # of its flags; positive where it has solved the problem
_SIZE = 500.0
"""Norm that H is scaled to: DAQP's tolerances are absolute; its least pivot is then about 1e-13 of the largest."""


class Daqp:
    """`QpSolver` by DAQP. The active set of `start` is the first guess; where that leads nowhere, it starts afresh.

    A Hessian with pivots below 1e-13 of its largest entry counts as singular (`solve_scaled`).
    """

    def __init__(self, tolerance: float = 1e-9) -> None:
        """Keep the tolerance: by how much a row may be missed, over that row's length in the metric of the scaled H."""
        self._options: dict[str, Any] = {"primal_tol": tolerance, "eps_prox": 0.0}

    def solve(self, problem: QuadraticProgram, start: QpSolution | None = None) -> QpSolution:
        """See `QpSolver`."""
        if not is_usable(problem):
            return unsolved(problem, Outcome.FAILED)
        known = usable_start(problem, start)
        solution = self._strict(problem, known)
        return solution if solution.outcome is Outcome.SOLVED else solve_scaled(problem, known, self._strict)

    def _strict(self, problem: QuadraticProgram, start: QpSolution | None) -> QpSolution:
        """From the active set of `start`, and without it where that leads nowhere."""
        hessian = problem.hessian.ravel(order="K")
        size = math.sqrt(hessian.dot(hessian))
        scale = _SIZE / size if size > 0.0 else 1.0
        rows = problem.matrix[problem.bounds :]
        if not (rows.flags.c_contiguous and rows.flags.writeable):
            rows = rows.copy(order="C")
        # DAQP wants all arrays writable and contiguous, and takes others for such
        upper, lower = problem.upper.copy(), problem.lower.copy()
        data = scale * problem.hessian, scale * problem.gradient, rows, upper, lower
        flag, iterations = 0, 0
        for guess in (None,) if start is None else (_active(start.multipliers), None):
            x, _, flag, told = solve(*data, guess, **self._options)
            iterations += told["iterations"]
            if flag > 0 and keeps_rows(problem, x):
                return QpSolution(x, told["lam"] / scale, Outcome.SOLVED, iterations)
            if flag == _SINGULAR:
                break
        return unsolved(problem, Outcome.INFEASIBLE if flag == _INFEASIBLE else Outcome.FAILED, iterations)


def _active(multipliers: Any) -> Any:
    """(m,) DAQP's `sense` of the rows that push."""
    return _SENSE[np.sign(multipliers).astype(np.intp)]
