"""Solvers that `bench qp` compares with those of the library: PIQP and ProxQP.

PIQP is a proximal interior-point method (Schwan et al., CDC 2023), ProxQP a primal-dual augmented Lagrangian method
(Bambade et al., RSS 2022); `piqp` and `proxsuite` on PyPI.
"""

import numpy as np

from drake_tc.tsid import qp as choose
from drake_tc.tsid.qp import (
    Outcome,
    QpSolution,
    QpSolver,
    QuadraticProgram,
    refused,
    scaled,
    unsolved,
    usable_start,
)

try:
    import piqp
except ImportError:
    piqp = None
try:
    from proxsuite import proxqp
except ImportError:
    proxqp = None

COMPARED = ("piqp", "proxqp")
SOLVERS = (*choose.SOLVERS, *COMPARED)


def solver(name: str = choose.DEFAULT) -> QpSolver:
    """A solver of the library or of this file.

    Raises:
        ParamsError: an unknown name, or a package that is not installed.
    """
    if name not in COMPARED:
        return choose.solver(name)
    if (why := unavailable(name)) is not None:
        raise choose.SolverUnavailableError(why)
    return Piqp() if name == "piqp" else ProxQp()


def unavailable(name: str) -> str | None:
    """Why a solver cannot be used here; None if it can."""
    if name not in COMPARED:
        try:
            choose.solver(name)
        except choose.SolverUnavailableError as error:
            return str(error)
        return None
    lacking = piqp is None if name == "piqp" else proxqp is None
    return f"solver {name!r} is not available: pip install 'drake-tc[test]'" if lacking else None


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
            infeasible = (
                proxqp.QPSolverOutput.PROXQP_PRIMAL_INFEASIBLE,
                proxqp.QPSolverOutput.PROXQP_SOLVED_CLOSEST_PRIMAL_FEASIBLE,
            )
            outcome = Outcome.INFEASIBLE if found.info.status in infeasible else Outcome.FAILED
            return unsolved(problem, outcome, iterations)
        multipliers = np.empty(problem.lower.size)
        multipliers[equal], multipliers[rest] = found.y, found.z
        return QpSolution(np.array(found.x), multipliers, Outcome.SOLVED, iterations)
