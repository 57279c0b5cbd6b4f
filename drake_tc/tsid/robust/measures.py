"""min ||D x - d||^2 + w R(x) inside the limits, for each measure R: what every use of robustness repeats.

Source: Del Prete and Mansard, 2015, eq. 11 to 17.

p_rect: the most probable axis-aligned box inside the polytope (eq. 14 to 16). The box is -b_j <= zeta_j <= a_j in the
axes of e = L zeta (see `TorqueError`), so that its probability is a product for a full Sigma too. With a diagonal Sigma
these are the joints: s_j = a_j sigma_j, s_(j+n) = -b_j sigma_j.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from drake_tc.kernels.calls import Kernel
from drake_tc.tsid.qp import Outcome, QpSolver
from drake_tc.tsid.robust import convex
from drake_tc.tsid.robust.convex import FREE, ActiveSet, Minimum, SolverMeans, minimise, plain
from drake_tc.tsid.robust.scaled import (
    FEASIBLE,
    Budget,
    ScaledProblem,
    ScaledRows,
    TorqueError,
    box_risk,
    box_rows,
    box_size,
    certain_miss,
    nothing,
    scaled,
)
from drake_tc.tsid.rows import Polytope
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


Measure = Callable[[ScaledProblem, float, Guess, SolverMeans], ProgramResult]


def minimum_of(minimum: Minimum, x: FloatArray, risk: float, inner: FloatArray | None = None) -> ProgramResult:
    """The part of a program's minimum that is torques."""
    m = minimum
    return ProgramResult(x, risk, m.active_set, m.outcome, m.converged, m.iterations, m.programs, inner)


def _of_objective(means: SolverMeans, weight: float) -> SolverMeans:
    """The accuracy of R as one of the objective J + w R."""
    return means._replace(accuracy=means.accuracy * weight)


def least_cost(problem: ScaledProblem, guess: Guess, means: SolverMeans) -> ProgramResult:
    """Classic TSID (eq. 11): R counts as 0."""
    target = problem.cost.target
    exact = means._replace(accuracy=EXACT * float(target.dot(target)))
    minimum = minimise(plain(problem.cost, problem.limits), guess.x, guess.active_set, exact)
    return minimum_of(minimum, minimum.x, 0.0)


def individual(problem: ScaledProblem, weight: float, guess: Guess, means: SolverMeans) -> ProgramResult:
    """R_ind (eq. 13)."""
    program = plain(problem.cost, problem.limits).with_risk(problem.erring, weight)
    minimum = minimise(program, guess.x, guess.active_set, _of_objective(means, weight))
    return minimum_of(minimum, minimum.x, minimum.risk)


def box(problem: ScaledProblem, weight: float, guess: Guess, means: SolverMeans) -> ProgramResult:
    """R_box: minus the size s of the largest box is what w multiplies (eq. 17); R = -log p_box is reported."""
    n = len(guess.x)
    linear = np.zeros(n + 1)
    linear[n] = -weight
    rows, cost = box_rows(problem)
    program = plain(cost, rows, linear=linear, damping=BOX_DAMPING * weight)
    size = guess.inner if guess.inner is not None and len(guess.inner) == 1 else np.zeros(1)
    start = np.concatenate((guess.x, size))
    minimum = minimise(program, start, guess.active_set, _of_objective(means, weight))
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


SMALL = 1e-9
"""Half width [sigma] below which a box counts as none."""

WIDTH = 1e-2
"""Least width of a box along each axis, in sigmas or, where it begins narrower than one, of its first width."""

SHARES = (1.0, 0.7, 0.4, 0.2, 0.1, 0.05, 0.02, 0.01, 1e-3, 1e-4, 1e-6)
"""Of the way from the torque without a box to the largest box, at which a cold start looks."""

ROUNDS = 5
"""Programs at most, each with the sides that x missed in the one before."""


def rectangle(problem: ScaledProblem, weight: float, guess: Guess, means: SolverMeans) -> ProgramResult:
    """R_rect with the cost not halved as in eq. 16: from the box of the last solution, else from the largest of all.

    The most probable box need not be around x, so x itself is held inside the limits too, by the sides it would miss.
    """
    sides = 2 * problem.noise.shape[1]
    if guess.inner is not None and len(guess.inner) == sides + len(problem.limits.lower):
        start = np.concatenate((guess.x, guess.inner[:sides]))
        found = _from(Guess(start, guess.active_set, guess.inner[sides:]), problem, weight, means)
        if found.outcome is Outcome.SOLVED:
            return found
    begin = _largest(problem, guess.x, means)
    if begin is None:
        outcome = Outcome.SOLVED if problem.limits.miss(guess.x) <= FEASIBLE else Outcome.INFEASIBLE
        return ProgramResult(guess.x, math.inf, FREE, outcome, False, 1, 1)
    begin = _towards(guess.x, begin, problem, weight)
    return _from(Guess(begin), problem, weight, means)


def _towards(x: FloatArray, begin: FloatArray, problem: ScaledProblem, weight: float) -> FloatArray:
    """The best of a few points between (x, no box) and the largest box; limits are convex, so all are inside."""
    objective = convex.rectangle(problem, np.zeros(len(problem.limits.lower)), 0.0, weight)
    end = np.concatenate((x, np.zeros(len(begin) - len(x))))
    if len(x) == 0 or problem.limits.miss(x) > FEASIBLE:
        return begin
    points = [end + share * (begin - end) for share in SHARES]
    return min(points, key=lambda point: objective.at(point).value)


def _from(guess: Guess, problem: ScaledProblem, weight: float, means: SolverMeans) -> ProgramResult:
    """From (x, a, b); `inner` (m,) are the sides that x itself is to keep, none where it is None."""
    start, active_set, held = guess.x, guess.active_set, guess.inner
    held = np.zeros(len(problem.limits.lower)) if held is None else held
    axes, limits = problem.noise.shape[1], problem.limits
    n = len(start) - 2 * axes
    sharp = _of_objective(means, weight)
    begin, width = start, min(WIDTH, WIDTH * float((start[n : n + axes] + start[n + axes :]).min(initial=1.0)))
    steps = programs = 0
    for _ in range(ROUNDS):
        program = convex.rectangle(problem, held, width, weight)
        minimum = minimise(program, start, active_set, sharp)
        start, active_set = minimum.x, minimum.active_set
        steps, programs = steps + minimum.iterations, programs + minimum.programs
        value = limits.matrix @ start[:n]
        missed = (value > limits.upper + FEASIBLE) * 1.0 - (value < limits.lower - FEASIBLE)
        if minimum.outcome is not Outcome.SOLVED or n == 0 or not missed.any():
            break
        start, active_set = begin, _without(active_set, 2 * len(limits.lower) + axes)
        held = np.where(held == 0.0, missed, held)
    else:
        inside = Outcome.SOLVED if limits.miss(begin[:n]) <= FEASIBLE else Outcome.FAILED
        here = program.at(begin)
        minimum = Minimum(begin, here.value, here.risk, FREE, inside, False, steps, programs)
    found = minimum_of(minimum, start[:n], minimum.risk)
    return found._replace(
        active_set=active_set, iterations=steps, programs=programs, inner=np.concatenate((start[n:], held))
    )


def _without(active_set: ActiveSet, first: int) -> ActiveSet:
    """The active set without rows from `first` on."""
    keep = active_set.rows < first
    return ActiveSet(active_set.rows[keep], active_set.sides[keep], active_set.multipliers[keep])


def _largest(problem: ScaledProblem, x: FloatArray, means: SolverMeans) -> FloatArray | None:
    """(x, a, b) of the largest box with equal sides: around the x where it is largest of all, or else beside x."""
    n, axes = len(x), problem.noise.shape[1]
    if n:
        around = box(problem._replace(cost=nothing(n)), 1.0, Guess(x), means)
        if around.outcome is Outcome.SOLVED and around.inner is not None and around.inner[0] > SMALL:
            return np.concatenate((around.x, np.full(2 * axes, around.inner[0])))
    value = problem.limits.matrix @ x
    rows = ScaledRows(problem.noise, problem.limits.lower - value, problem.limits.upper - value)
    beside = box(problem._replace(cost=nothing(axes), limits=rows), 1.0, Guess(np.zeros(axes)), means)
    if beside.outcome is not Outcome.SOLVED or beside.inner is None or not beside.inner[0] > SMALL:
        return None
    return np.concatenate((x, beside.inner[0] + beside.x, beside.inner[0] - beside.x))


RECTANGLE_ACCURACY = 1e-6
"""Of R_rect at a given torque."""


def rectangle_risk(polytope: Polytope, torque: FloatArray, error: TorqueError, qp: QpSolver) -> float:
    """R_rect(tau) = -log p_rect (eq. 15); inf where no box fits."""
    n = error.joints
    problem = scaled(nothing(n), polytope, error)
    x = torque / problem.scale
    if certain_miss(problem.limits, problem.certain, x):
        return math.inf
    fixed = problem.along(x, np.zeros((n, 0)))
    if problem.sure:
        erring = problem.erring.along(x, np.zeros((n, 0)))
        fixed = fixed._replace(limits=erring, certain=np.zeros_like(problem.certain), sure=0)
    found = rectangle(fixed, 1.0, Guess(np.zeros(0)), SolverMeans(qp, RECTANGLE_ACCURACY, Budget().started()))
    return found.risk if found.outcome is Outcome.SOLVED else math.inf


def p_rect(polytope: Polytope, torque: FloatArray, error: TorqueError, qp: QpSolver) -> float:
    """Probability of the most probable axis-aligned box (eq. 14): a lower bound of p; 0 where none fits."""
    return math.exp(-rectangle_risk(polytope, torque, error, qp))
