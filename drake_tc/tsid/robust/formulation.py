"""Robust TSID: one measure of robustness, one use of it (Del Prete and Mansard, 2015, eq. 4 to 6)."""

import math
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import Kernel
from drake_tc.tsid.qp.problem import Outcome, QpSolver
from drake_tc.tsid.robust import measures
from drake_tc.tsid.robust.active_set import FREE, RobustSolution, Start
from drake_tc.tsid.robust.bound import in_null_space, within_risk
from drake_tc.tsid.robust.measures import Guess, Measure, ProgramResult, SolverMeans
from drake_tc.tsid.robust.options import Options, TorqueError
from drake_tc.tsid.robust.rectangle import rectangle
from drake_tc.tsid.robust.scaled import ScaledProblem, scaled, size_of_risk
from drake_tc.tsid.rows import LeastSquares, Polytope

_EVALUATED = Kernel("tsid.scaling", "evaluated")

MeasureName = Literal["classic", "individual", "rectangle", "box"]
Use = Literal["trade_off", "null_space", "constraint"]
LEAST = 1e-8
"""Of R_min: below, the bound is lost in rounding."""


@dataclass(frozen=True)
class Formulation:
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
    weight: float = 1.0
    minimum: float = 0.05
    options: Options = field(default_factory=Options)

    def __post_init__(self) -> None:
        for name, value, names in (
            ("measure", self.measure, get_args(MeasureName)),
            ("use", self.use, get_args(Use)),
        ):
            if value not in names:
                raise ParamsError(f"{name}: expected one of {sorted(names)}, got {value!r}")
        if not (self.weight > 0.0 and np.isfinite(self.weight)):
            raise ParamsError(f"weight: expected a finite number > 0, got {self.weight}")
        if not (self.minimum >= LEAST and np.isfinite(self.minimum)):
            raise ParamsError(f"minimum: expected a finite number >= {LEAST:g}, got {self.minimum}")

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
            return within_risk(program, problem, self.minimum, weight or self.weight, guess, means)
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
