"""min J subject to R <= R_min (Del Prete and Mansard, 2015, eq. 5), by the weight at which the trade-off meets it."""

import math

import numpy as np

from drake_tc.tsid.qp.problem import Outcome
from drake_tc.tsid.robust import measures
from drake_tc.tsid.robust.active_set import FREE
from drake_tc.tsid.robust.measures import Guess, Measure, ProgramResult, SolverMeans
from drake_tc.tsid.robust.scaled import ScaledProblem, nothing, null_basis

MET = 1e-6
"""How near to R_min an active constraint is met, of R_min."""

ROUNDS, PATIENCE = 60, 2
"""Programs at most; and after how many without both ends of a bracket it is asked whether there are both."""

STRIDE = 0.7
"""Of log w while one end of the bracket is missing; it doubles each time."""

FIRST_STRIDE = 4.0
"""Of the first |log R - log R_min|, where that is less than `STRIDE`: it reaches the other side where R falls as w^-1/4
or faster."""

FARTHEST = 100.0
"""Of |log w|: beyond, nothing but rounding changes."""

SURE = 1e-3
"""Of R_min: how exactly the least R is known that is held against it."""

NEAR = 0.5
"""|log R - log R_min| from which on programs are solved sharply; farther off, only the side counts. Between two ends
that near, and close to a first point, they are solved sharply at once; elsewhere roughly first."""


def in_null_space(program: Measure, problem: ScaledProblem, guess: Guess, means: SolverMeans) -> ProgramResult:
    """Min R over the minimisers of the cost (eq. 4): x = x* + T y with D T = 0, inside the limits."""
    classic = measures.least_cost(problem, Guess(guess.x, guess.active_set if guess.inner is None else FREE), means)
    if classic.outcome is not Outcome.SOLVED:
        return classic
    basis = null_basis(problem.cost.matrix)
    inside = problem.along(classic.x, basis)
    inside = inside._replace(cost=nothing(basis.shape[1]))
    last = basis.T @ (guess.x - classic.x)
    if inside.limits.miss(last) > 1.0:
        last = np.zeros(basis.shape[1])
    begin = Guess(last, guess.active_set, guess.inner)
    found = program(inside, 1.0, begin, means)
    if found.outcome is not Outcome.SOLVED:
        return classic._replace(risk=found.risk, converged=False)
    return found._replace(
        x=classic.x + basis @ found.x,
        active_set=found.active_set if basis.shape[1] or guess.inner is not None else classic.active_set,
        iterations=classic.iterations + found.iterations,
        programs=classic.programs + found.programs,
    )


def most_robust(program: Measure, problem: ScaledProblem, guess: Guess, means: SolverMeans) -> ProgramResult:
    """Min R inside the limits, whatever it costs."""
    n = len(guess.x)
    return program(problem._replace(cost=nothing(n)), 1.0, guess, means)


def within_risk(
    program: Measure, problem: ScaledProblem, minimum: float, weight: float, guess: Guess, means: SolverMeans
) -> tuple[ProgramResult, float]:
    """The least cost with R <= minimum, and the multiplier w of that constraint (0 where it is not active).

    R(x(w)), x(w) the minimiser of J + w R, falls as w grows; the w with R(x(w)) = R_min is the multiplier of (5).
    False position (Illinois) on log R over log w inside a bracket; every round starts from the last one's minimiser.
    As w -> 0, x(w) goes to the most robust minimiser of J: where that keeps R_min, it is the answer.

    Returns:
        Outcome.RISKY with the most robust torque where R_min cannot be had; where the budget is spent, the best torque
        that keeps R_min, not converged, or else, RISKY, the last one that keeps the limits.
    """
    rough = means._replace(accuracy=min(means.accuracy, 0.1 * minimum))
    sharp = means._replace(accuracy=1e-6 * rough.accuracy)
    exact = means._replace(accuracy=min(means.accuracy, SURE * minimum))
    target, stride = math.log(minimum), math.nan
    here = min(max(math.log(weight), -FARTHEST), FARTHEST)
    low = high = below = above = math.nan
    steps = programs = side = 0
    near = False
    best: tuple[ProgramResult, float] | None = None
    found = program(problem, math.exp(here), guess, rough)
    for turn in range(ROUNDS):
        steps, programs = steps + found.iterations, programs + found.programs
        if found.outcome is not Outcome.SOLVED:
            break
        miss = math.log(max(found.risk, 1e-300)) - target
        if abs(miss) < NEAR and not near:
            found = program(problem, math.exp(here), found.guess, sharp)
            steps, programs = steps + found.iterations, programs + found.programs
            miss = math.log(max(found.risk, 1e-300)) - target
        if miss > MET:
            above = 0.5 * above if side > 0 else above
            low, below, side = here, miss, 1
        else:
            below = 0.5 * below if side < 0 else below
            met = miss >= -MET
            high, above, side, best = here, miss, -1, (found._replace(converged=met), math.exp(here))
            if met:
                break
        if means.spending.late():
            break
        if not (math.isnan(low) or math.isnan(high)):
            near = max(abs(above), abs(below)) < NEAR
            here = (low * above - high * below) / (above - below)
        else:
            if turn == PATIENCE:
                end = _beyond(program, problem, found.guess, exact, unsafe=math.isnan(high))
                if (end.risk > minimum) == math.isnan(high):
                    return _counted(_evaluated(end, minimum), steps, programs), 0.0
            step = min(STRIDE, FIRST_STRIDE * abs(miss)) if math.isnan(stride) else stride
            here, stride = (high - step if math.isnan(low) else low + step), max(STRIDE, 2.0 * step)
            near = step < STRIDE
            if abs(here) > FARTHEST:
                break
        found = program(problem, math.exp(here), found.guess, sharp if near else rough)
    if best is not None:
        return best[0]._replace(iterations=steps, programs=programs), best[1]
    if found.outcome is Outcome.SOLVED and means.spending.late():
        return _evaluated(found, minimum)._replace(converged=False, iterations=steps, programs=programs), 0.0
    safest = _evaluated(most_robust(program, problem, found.guess, exact), minimum)
    return _counted(safest, steps, programs), 0.0


def _beyond(
    program: Measure, problem: ScaledProblem, guess: Guess, means: SolverMeans, *, unsafe: bool
) -> ProgramResult:
    """Where x(w) goes, for w -> infinity where R is too large yet, for w -> 0 where it is smaller than it need be."""
    return (most_robust if unsafe else in_null_space)(program, problem, guess, means)


def _evaluated(found: ProgramResult, minimum: float) -> ProgramResult:
    """RISKY where it keeps the limits, but not R <= minimum."""
    risky = found.outcome is Outcome.SOLVED and not found.risk <= minimum
    return found._replace(outcome=Outcome.RISKY) if risky else found


def _counted(found: ProgramResult, steps: int, programs: int) -> ProgramResult:
    return found._replace(iterations=steps + found.iterations, programs=programs + found.programs)
