"""min ||D x - d||^2 + w R(x) inside the limits, for each measure R: what every use of robustness repeats.

Source: Del Prete and Mansard, 2015, eq. 11 to 17.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from drake_tc.kernels.calls import Kernel
from drake_tc.tsid.qp.problem import Outcome, QpSolver
from drake_tc.tsid.robust.active_set import FREE, ActiveSet
from drake_tc.tsid.robust.convex import Minimum, minimise, plain
from drake_tc.tsid.robust.options import Spending
from drake_tc.tsid.robust.scaled import ScaledProblem, box_risk, box_rows, box_size, nothing
from drake_tc.types import FloatArray

_SHRUNK = Kernel("tsid.scaling", "shrunk")
EXACT = 1e-14
"""Of ||d||^2: how exactly the cost alone is minimised."""

NEARLY = 1.0 - 1e-5
"""Of the largest box: what is left of it for the cost."""

BOX_DAMPING = 1e-6
"""Of w: each step may take the box a long way, and the damping leaves no trace where the steps end."""


class Guess(NamedTuple):
    """Where to begin: x (n,), the active set of the program, the box as `Start` has it."""

    x: FloatArray
    active_set: ActiveSet = FREE
    inner: FloatArray | None = None


class ProgramResult(NamedTuple):
    """Where a program ended; see `RobustSolution` for what is named alike."""

    x: FloatArray
    risk: float
    active_set: ActiveSet
    outcome: Outcome
    converged: bool
    iterations: int
    programs: int
    inner: FloatArray | None = None

    @property
    def guess(self) -> Guess:
        """To go on from here."""
        return Guess(self.x, self.active_set, self.inner)


class SolverMeans(NamedTuple):
    """With what a program is solved: the QP solver, the accuracy [of R], what is left of the budget."""

    qp: QpSolver
    accuracy: float
    spending: Spending


Measure = Callable[[ScaledProblem, float, Guess, SolverMeans], ProgramResult]


def minimum_of(minimum: Minimum, x: FloatArray, risk: float, inner: FloatArray | None = None) -> ProgramResult:
    """The part of a program's minimum that is torques."""
    m = minimum
    return ProgramResult(x, risk, m.active_set, m.outcome, m.converged, m.iterations, m.programs, inner)


def least_cost(problem: ScaledProblem, guess: Guess, means: SolverMeans) -> ProgramResult:
    """Classic TSID (eq. 11): R counts as 0."""
    target = problem.cost.target
    minimum = minimise(
        plain(problem.cost, problem.limits),
        means.qp,
        guess.x,
        active_set=guess.active_set,
        accuracy=EXACT * float(target.dot(target)),
        spending=means.spending,
    )
    return minimum_of(minimum, minimum.x, 0.0)


def individual(problem: ScaledProblem, weight: float, guess: Guess, means: SolverMeans) -> ProgramResult:
    """R_ind (eq. 13)."""
    minimum = minimise(
        plain(problem.cost, problem.limits, risk=problem.erring, weight=weight),
        means.qp,
        guess.x,
        active_set=guess.active_set,
        accuracy=means.accuracy * weight,
        spending=means.spending,
    )
    return minimum_of(minimum, minimum.x, minimum.risk)


def box(problem: ScaledProblem, weight: float, guess: Guess, means: SolverMeans) -> ProgramResult:
    """R_box: minus the size s of the largest box is what w multiplies (eq. 17); R = -log p_box is reported."""
    n = len(guess.x)
    linear = np.zeros(n + 1)
    linear[n] = -weight
    rows, cost = box_rows(problem)
    minimum = minimise(
        plain(cost, rows, linear=linear, damping=BOX_DAMPING * weight),
        means.qp,
        np.concatenate((guess.x, guess.inner if guess.inner is not None and len(guess.inner) == 1 else np.zeros(1))),
        active_set=guess.active_set,
        accuracy=means.accuracy * weight,
        spending=means.spending,
    )
    x = minimum.x[:n]
    return minimum_of(minimum, x, box_risk(box_size(problem, x), problem.noise.shape[1]), minimum.x[n:])


def shrunk_box(problem: ScaledProblem, size: float, guess: Guess, means: SolverMeans) -> ProgramResult:
    """Least cost with room for a box of `size` sigmas: R_box <= R_min is that; RISKY with the largest there is."""
    found = least_cost(_shrunk(problem, size), Guess(guess.x, guess.active_set), means)
    if found.outcome is Outcome.INFEASIBLE:
        largest = box(problem._replace(cost=nothing(len(guess.x))), 1.0, Guess(guess.x), means)
        found = largest._replace(active_set=FREE, inner=None)
        if largest.inner is not None and largest.outcome is Outcome.SOLVED:
            cheapest = least_cost(_shrunk(problem, NEARLY * float(largest.inner[0])), Guess(largest.x), means)
            found = cheapest if cheapest.outcome is Outcome.SOLVED else found
        if found.outcome is Outcome.SOLVED:
            found = found._replace(outcome=Outcome.RISKY)
    return found._replace(risk=box_risk(box_size(problem, found.x), problem.noise.shape[1]))


def _shrunk(problem: ScaledProblem, size: float) -> ScaledProblem:
    """Every side closer by what a box of this size reaches."""
    limits = problem.limits
    lower, upper = _SHRUNK(problem.noise, limits.lower, limits.upper, float(size))
    return problem._replace(limits=limits._replace(lower=lower, upper=upper))
