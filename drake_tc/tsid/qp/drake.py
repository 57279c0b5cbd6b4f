"""Any solver that Drake has, through a MathematicalProgram of the same matrices: the reference."""

from typing import Any

import numpy as np
from pydrake.solvers import (
    ClarabelSolver,
    GurobiSolver,
    MathematicalProgram,
    MosekSolver,
    OsqpSolver,
    ScsSolver,
    SolutionResult,
    SolverOptions,
)

from drake_tc.errors import ParamsError
from drake_tc.tsid.qp.common import refused, scaled, unsolved, usable_start
from drake_tc.tsid.qp.problem import Outcome, QpSolution, QuadraticProgram

_TIGHT = 1e-14
_SOLVERS: dict[str, tuple[Any, dict[str, Any]]] = {
    "clarabel": (ClarabelSolver, dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), _TIGHT)),
    "osqp": (OsqpSolver, {"eps_abs": 1e-11, "eps_rel": 1e-11, "max_iter": 100_000, "polishing": 0}),
    "scs": (ScsSolver, {"eps_abs": _TIGHT, "eps_rel": _TIGHT, "max_iters": 200_000}),
    "gurobi": (GurobiSolver, {}),
    "mosek": (MosekSolver, {}),
}
_INFEASIBLE = (SolutionResult.kInfeasibleConstraints, SolutionResult.kInfeasibleOrUnbounded)


class DrakeSolver:
    """`QpSolver` by one of Drake's; `start` gives x to those that take a guess."""

    def __init__(self, name: str = "clarabel") -> None:
        """Find the solver.

        Args:
            name: "clarabel", "osqp", "scs", "gurobi" or "mosek".

        Raises:
            ParamsError: an unknown name, or a solver without a licence here.
        """
        if name not in _SOLVERS:
            raise ParamsError(f"solver of Drake: expected one of {', '.join(_SOLVERS)}, got {name!r}")
        make, options = _SOLVERS[name]
        self._solver = make()
        if not (self._solver.available() and self._solver.enabled()):
            raise ParamsError(
                f"solver {name!r}: not in this Drake, or without a licence; possible: clarabel, osqp, scs"
            )
        self._options = SolverOptions()
        for key, value in options.items():
            self._options.SetOption(self._solver.solver_id(), key, value)

    def solve(self, problem: QuadraticProgram, start: QpSolution | None = None) -> QpSolution:
        """See `QpSolver`."""
        answer = refused(problem)
        if answer is not None:
            return answer
        over = scaled(problem)
        return over.back(self._solve(over.problem, over.there(usable_start(problem, start))))

    def _solve(self, problem: QuadraticProgram, start: QpSolution | None) -> QpSolution:
        """The scaled problem."""
        program: Any = MathematicalProgram()
        x = program.NewContinuousVariables(problem.gradient.size)
        program.AddQuadraticCost(problem.hessian, problem.gradient, x, is_convex=True)
        rows = None
        if problem.lower.size:
            rows = program.AddLinearConstraint(problem.matrix, problem.lower, problem.upper, x)
        guess = start.x if start is not None else None
        result = self._solver.Solve(program, guess, self._options)
        if not result.is_success():
            infeasible = result.get_solution_result() in _INFEASIBLE
            return unsolved(problem, Outcome.INFEASIBLE if infeasible else Outcome.FAILED)
        multipliers = np.zeros(0) if rows is None else -np.asarray(result.GetDualSolution(rows)).ravel()
        return QpSolution(np.asarray(result.GetSolution(x)), multipliers, Outcome.SOLVED, 0)
