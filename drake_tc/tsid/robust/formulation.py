"""Robust TSID: one measure of robustness, one use of it (Del Prete and Mansard, 2015, eq. 4 to 6).

min J subject to R <= R_min (eq. 5) is solved by the weight at which the trade-off meets it.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np

from drake_tc.config.records import Checked, Positive, Range
from drake_tc.kernels.calls import Kernel
from drake_tc.tsid.qp import Outcome, QpSolver
from drake_tc.tsid.robust import measures
from drake_tc.tsid.robust.convex import FREE, RobustSolution, SolverMeans, Start
from drake_tc.tsid.robust.measures import Guess, Measure, ProgramResult, rectangle
from drake_tc.tsid.robust.scaled import Options, ScaledProblem, TorqueError, nothing, null_basis, scaled, size_of_risk
from drake_tc.tsid.rows import LeastSquares, Polytope

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
    program: Measure, problem: ScaledProblem, formulation: "Formulation", guess: Guess, means: SolverMeans
) -> tuple[ProgramResult, float]:
    """The least cost with R <= minimum, and the multiplier w of that constraint (0 where it is not active).

    R(x(w)), x(w) the minimiser of J + w R, falls as w grows; the w with R(x(w)) = R_min is the multiplier of (5).
    False position (Illinois) on log R over log w inside a bracket, from the formulation's weight on; every round starts
    from the last one's minimiser. As w -> 0, x(w) goes to the most robust minimiser of J: where that keeps R_min, it is
    the answer.

    Returns:
        Outcome.RISKY with the most robust torque where R_min cannot be had; where the budget is spent, the best torque
        that keeps R_min, not converged, or else, RISKY, the last one that keeps the limits.
    """
    minimum = formulation.minimum
    rough = means._replace(accuracy=min(means.accuracy, 0.1 * minimum))
    sharp = means._replace(accuracy=1e-6 * rough.accuracy)
    exact = means._replace(accuracy=min(means.accuracy, SURE * minimum))
    target, stride = math.log(minimum), math.nan
    here = min(max(math.log(formulation.weight), -FARTHEST), FARTHEST)
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


_EVALUATED = Kernel("tsid.scaling", "evaluated")

MeasureName = Literal["classic", "individual", "rectangle", "box"]
Use = Literal["trade_off", "null_space", "constraint"]
LEAST = 1e-8
"""Of R_min: below, the bound is lost in rounding."""


@dataclass(frozen=True)
class Formulation(Checked):
    """One way to choose torques tau on lower <= G tau <= upper, with J = ||D tau - d||^2 and R = -log p.

    Uses:
        trade_off: min J + weight R (eq. 6; for "box" min J - weight s, s its half width in sigmas, eq. 17).
        null_space: min R over the minimisers of J (eq. 4).
        constraint: min J subject to R <= minimum (eq. 5).
    Measures: "classic" has no R; "individual", "rectangle" and "box" approximate p as the modules of these names say.
    Equation 16 of the paper halves J for the rectangle alone; here weight means the same for all.

    Attributes:
        measure: Which R.
        use: What for.
        weight: w of the trade-off; a first guess of the multiplier for "constraint".
        minimum: R_min of the constraint, 1e-8 or more; p >= exp(-R_min) by the measure's approximation.
        options: Accuracy and budget.

    Raises:
        ParamsError: an unknown measure or use, or a weight or minimum that is too small.
    """

    measure: MeasureName = "individual"
    use: Use = "trade_off"
    weight: Positive = 1.0
    minimum: Annotated[float, Range(f"a finite number >= {LEAST:g}", LEAST)] = 0.05
    options: Options = field(default_factory=Options)

    def solve(
        self,
        cost: LeastSquares,
        polytope: Polytope,
        error: TorqueError,
        qp: QpSolver,
        start: Start | None = None,
    ) -> RobustSolution:
        """The torque; never raises on numbers (NaN gives Outcome.FAILED, contradictory limits INFEASIBLE, an R_min
        that cannot be had RISKY).

        Args:
            cost: D, d over the torques [N m].
            polytope: Limits over the torques.
            error: Of the torques.
            qp: Solver of the steps whose active rows cannot be guessed.
            start: Of the last tick's solution.
        """
        return self.solve_scaled(scaled(cost, polytope, error), qp, start)

    def solve_scaled(self, problem: ScaledProblem, qp: QpSolver, start: Start | None = None) -> RobustSolution:
        """The same for a problem that is scaled already."""
        means = SolverMeans(qp, self.options.accuracy, self.options.budget.started())
        m, n = len(problem.limits.lower), len(problem.scale)
        known = start is not None and len(start.torque) == n
        if start is not None and known:
            same = start.rows == m
            guess = Guess(
                start.torque / problem.scale, start.active_set if same else FREE, start.inner if same else None
            )
            weight = start.weight
        else:
            guess, weight = Guess(np.zeros(n)), 0.0
        try:
            found, weight = self._found(problem, guess, weight, means, known)
        except (np.linalg.LinAlgError, ArithmeticError, LookupError, ValueError):
            found = ProgramResult(np.full(n, np.nan), np.nan, FREE, Outcome.FAILED, False, 0, 0)
        return _packed(found, weight, problem)

    def _found(
        self, problem: ScaledProblem, guess: Guess, weight: float, means: SolverMeans, known: bool
    ) -> tuple[ProgramResult, float]:
        if self.measure == "classic":
            return measures.least_cost(problem, guess, means), 0.0
        program = _MEASURES[self.measure]
        if self.use == "null_space":
            return in_null_space(program, problem, guess, means), 0.0
        if self.use == "constraint":
            if self.measure == "box":
                size = size_of_risk(self.minimum, problem.noise.shape[1])
                return measures.shrunk_box(problem, size, guess, means), 0.0
            if known and not weight:  # the last tick's bound was not active
                cheapest = in_null_space(program, problem, guess, means)
                if cheapest.outcome is Outcome.SOLVED and cheapest.risk <= self.minimum:
                    return cheapest, 0.0
            begin = replace(self, weight=weight) if weight else self
            return within_risk(program, problem, begin, guess, means)
        if not known:
            classic = measures.least_cost(problem, guess, means)
            if classic.outcome is not Outcome.SOLVED:
                return classic, 0.0
            guess = Guess(classic.x)
        return program(problem, self.weight, guess, means), 0.0


_MEASURES: dict[str, Measure] = {"individual": measures.individual, "box": measures.box, "rectangle": rectangle}


def _packed(found: ProgramResult, weight: float, problem: ScaledProblem) -> RobustSolution:
    counts, limits = (found.iterations, found.programs), problem.limits
    if not math.isfinite(float(found.x.sum())):
        zero, active = np.zeros(len(problem.scale)), np.zeros(len(limits.lower), dtype=np.int64)
        return RobustSolution(zero, math.inf, 0.0, math.inf, active, Outcome.FAILED, False, *counts, None)
    torque, active, chance, price = _EVALUATED(found.x, problem.scale, problem.rows, tuple(problem.cost))
    start = Start(torque, len(active), found.active_set, weight, found.inner)
    return RobustSolution(torque, found.risk, chance, price, active, found.outcome, found.converged, *counts, start)
