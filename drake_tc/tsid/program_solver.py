"""The problem as a Drake MathematicalProgram over y = (vdot, f, tau), every binding named.

It is `solver: program` of a controller file, and the oracle of the fast path, which has the same problem reduced to the
torques (`reduction`).

Every tick builds the whole program over y = (vdot, f, tau) with named bindings (`build_full`), adds the robustness and
hands it to Clarabel (`classic`, `box`) or SNOPT. Nothing of the reduction to torques, of the Newton method or of the
row scaling of `robust` takes part; a tick costs tens of milliseconds rather than one.

With N = [B_v V + B_f F + B_tau] L the noise of a limit's rows, e = L zeta the torque error, V and F what a torque
changes of vdot and f by the program's own equalities, and sigma_i = |N_i|:

    individual  min J + w R,  R = -sum log Phi((upper - B y)/sigma) - sum log Phi((B y - lower)/sigma)
    box         min J - w s   with  lower + s |N| 1 <= B y <= upper - s |N| 1,  s >= 0
    rectangle   min J + w R,  R = -sum log(Phi(a) - Phi(-b))  with  B y + N+ a + N- b <= upper,
                              B y - N- a - N+ b >= lower,  a + b >= `WIDTH`

Source: Del Prete and Mansard (2015), eq. 4 to 17.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue
from pydrake.solvers import ClarabelSolver, MathematicalProgram, SnoptSolver, SolutionResult, SolverOptions
from scipy.special import log_ndtr

from drake_tc.errors import ParamsError
from drake_tc.tsid.assembly import check_names, is_bounds, ordered
from drake_tc.tsid.qp import DrakeSolver, Outcome, QpSolution, QuadraticProgram
from drake_tc.tsid.robust.convex import RobustSolution
from drake_tc.tsid.robust.formulation import Formulation
from drake_tc.tsid.robust.scaled import CERTAIN, TorqueError, box_risk
from drake_tc.tsid.rows import LeastSquares, LimitRows, Parts, TaskRows, Terms
from drake_tc.types import FloatArray

DYNAMICS, CONTACTS = "dynamics", "contacts"
"""Names of the program's equalities."""


class FullProblem(NamedTuple):
    """Rows over y at one state.

    Attributes:
        terms: At that state.
        tasks, limits: Rows over y.
        contact_acceleration: (k,) of the contacts, zero where None.
    """

    terms: Terms
    tasks: Sequence[TaskRows]
    limits: Sequence[LimitRows]
    contact_acceleration: FloatArray | None = None


def build_full(
    terms: Terms,
    tasks: Sequence[TaskRows],
    limits: Sequence[LimitRows],
    contact_acceleration: FloatArray | None = None,
) -> MathematicalProgram:
    """Over y: variables `vdot` (nv), `f` (k), `tau` (n); equalities DYNAMICS and CONTACTS, then tasks and limits.

    Args:
        terms: At the state of all rows.
        tasks: Rows over y.
        limits: Rows over y.
        contact_acceleration: (k,) of the contacts, zero where None.

    Raises:
        ParamsError: two of the names are equal.
    """
    check_names([DYNAMICS, CONTACTS, *(rows.name for rows in tasks), *(rows.name for rows in limits)])
    built = MathematicalProgram()
    program: Any = built
    sizes = sizes_of(terms)
    parts = [program.NewContinuousVariables(size, name) for size, name in zip(sizes, ("vdot", "f", "tau"), strict=True)]
    y = np.concatenate(parts)
    dynamics, contacts, right, drift = equalities(terms, contact_acceleration)
    name_binding(program.AddLinearEqualityConstraint(dynamics, right, y), DYNAMICS)
    if drift.size:
        name_binding(program.AddLinearEqualityConstraint(contacts, drift, y), CONTACTS)
    for task in tasks:
        if task.target.size:
            _add_cost(program, task.name, weighted(task, sizes), y)
    for limit in ordered(limits):
        if not limit.lower.size:
            continue
        if is_bounds(limit):
            name_binding(program.AddBoundingBoxConstraint(limit.lower, limit.upper, parts[2]), limit.name)
        else:
            rows = over_y(limit.matrix, sizes)
            name_binding(program.AddLinearConstraint(rows, limit.lower, limit.upper, y), limit.name)
    return built


def name_binding(binding: Any, name: str) -> None:
    """Give a cost or constraint its name."""
    binding.evaluator().set_description(name)


def _add_cost(program: Any, name: str, cost: LeastSquares, variables: Any) -> None:
    name_binding(program.Add2NormSquaredCost(cost.matrix, cost.target, variables), name)


def sizes_of(terms: Terms) -> tuple[int, int, int]:
    """(nv, k, n): of the parts of y."""
    return terms.bias.size, terms.contact_bias.size, terms.actuated.size


def over_y(parts: Parts, sizes: tuple[int, int, int]) -> FloatArray:
    """(r, nv + k + n) rows written out over y."""
    pieces = (parts.vdot, parts.force, parts.torque)
    rows = next(piece.shape[0] for piece in pieces if piece is not None)
    return np.concatenate(
        [np.zeros((rows, size)) if piece is None else piece for piece, size in zip(pieces, sizes, strict=True)], axis=1
    )


def weighted(task: TaskRows, sizes: tuple[int, int, int]) -> LeastSquares:
    """A task's rows over y, times their weights."""
    return LeastSquares(task.weight[:, None] * over_y(task.matrix, sizes), task.weight * task.target)


def equalities(
    terms: Terms, contact_acceleration: FloatArray | None
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Rows over y of the dynamics (nv) and of the contacts (k), and their right sides."""
    nv, k, n = sizes_of(terms)
    dynamics = np.zeros((nv, nv + k + n))
    dynamics[:, :nv] = terms.mass_matrix
    dynamics[:, nv : nv + k] = -terms.contact_jacobian.T
    dynamics[terms.actuated, nv + k + np.arange(n)] = -1.0
    contacts = np.zeros((k, nv + k + n))
    contacts[:, :nv] = terms.contact_jacobian
    drift = -terms.contact_bias if contact_acceleration is None else contact_acceleration - terms.contact_bias
    return dynamics, contacts, -terms.bias, drift


WIDTH = 1e-2
"""Least width of the rectangle along each axis [sigma]; the paper's epsilon."""
ROBUSTNESS = "robustness"
"""Name of the added cost and constraints."""
ON_BORDER = 1e-6
"""In sigmas of a row: nearer counts as active."""
_HALF_LOG_TWO_PI = 0.5 * float(np.log(2.0 * np.pi))
ACCURACIES = (1e-12, 1e-10, 1e-8, 1e-6)
"""Tolerances of the interior-point method, the next where one cannot be reached."""
ACCELERATION, FORCE = 10.0, 100.0
"""Units of vdot and f for SNOPT [rad/s^2 or m/s^2, N or N m]; those of tau are ten sigmas."""
AT_ITS_END = 41
"""SNOPT's code for a point that it cannot improve, while its own test of optimality is not met."""
_INFEASIBLE = (SolutionResult.kInfeasibleConstraints, SolutionResult.kInfeasibleOrUnbounded)
_TIGHT = ("tol_gap_abs", "tol_gap_rel", "tol_feas")


class _Limits(NamedTuple):
    """All limits over y, in the polytope's order: matrix (m, ny), sides (m,), noise (m, r), sigma (m,)."""

    matrix: FloatArray
    lower: FloatArray
    upper: FloatArray
    noise: FloatArray
    sigma: FloatArray


class ProgramSolver:
    """Solves a tick as one MathematicalProgram; quadratic programs beside it go to Clarabel."""

    def __init__(self) -> None:
        self._qp = DrakeSolver("clarabel")
        self._clarabel, self._snopt = ClarabelSolver(), SnoptSolver()
        self._options = SolverOptions()
        for key in ("Major optimality tolerance", "Major feasibility tolerance", "Minor feasibility tolerance"):
            self._options.SetOption(self._snopt.id(), key, 1e-9)
        self._options.SetOption(self._snopt.id(), "Major iterations limit", 3000)

    def solve(self, problem: QuadraticProgram, start: QpSolution | None = None) -> QpSolution:
        """See `QpSolver`: for what is solved beside the program, such as which limits conflict."""
        return self._qp.solve(problem, start)

    def check(self, formulation: Formulation) -> None:
        """Refuse what the program does not know.

        Raises:
            ParamsError: a use other than `trade_off`.
        """
        if formulation.use != "trade_off":
            raise ParamsError(f"solver: program knows use: trade_off alone, got {formulation.use}")

    def solution(self, problem: FullProblem, formulation: Formulation, error: TorqueError) -> RobustSolution:
        """The torque of one tick.

        Args:
            problem: At one state.
            formulation: Measure and weight; `use` is `trade_off`.
            error: Of the torques.
        """
        terms, tasks, limits, _ = problem
        program: Any = build_full(*problem)
        y = program.decision_variables()
        rows = _limits(terms, limits, error)
        result = self._convex(program)
        if not result.is_success():
            return _unsolved(error, rows, result)
        added, done = np.zeros(0), True
        if formulation.measure != "classic" and rows.noise.size:
            start = result.GetSolution(y)
            more, guess = _ADD[formulation.measure](program, y, rows, formulation.weight)
            if formulation.measure == "box":
                result = self._convex(program)
            else:
                _scale(program, y, terms, error)
                first: Any = np.concatenate((start, guess))
                result = self._snopt.Solve(program, first, self._options)
            done = result.is_success()
            if not done and not (formulation.measure != "box" and result.get_solver_details().info == AT_ITS_END):
                return _unsolved(error, rows, result)
            added = result.GetSolution(more) if len(more) else added
        found = np.asarray(result.GetSolution(y))
        risk = _risk(formulation.measure, rows, found, added)
        return _packed(terms, tasks, rows, found, error)._replace(robustness=risk, converged=done)

    def _convex(self, program: Any) -> Any:
        """A program of quadratic costs by Clarabel, as exactly as it can."""
        for accuracy in ACCURACIES:
            options = SolverOptions()
            for key in _TIGHT:
                options.SetOption(self._clarabel.id(), key, accuracy)
            result: Any = self._clarabel.Solve(program, None, options)
            if result.is_success() or result.get_solution_result() in _INFEASIBLE:
                break
        return result


def _scale(program: Any, y: Any, terms: Terms, error: TorqueError) -> None:
    """Units in which the variables are of size 1 to 10."""
    nv, k, _ = sizes_of(terms)
    units = np.concatenate((np.full(nv, ACCELERATION), np.full(k, FORCE), 10.0 * error.scale))
    for variable, unit in zip(y, units.tolist(), strict=True):
        program.SetVariableScaling(variable, unit)


def _limits(terms: Terms, limits: Sequence[LimitRows], error: TorqueError) -> _Limits:
    sizes = sizes_of(terms)
    pieces = [rows for rows in ordered(limits) if rows.lower.size]
    matrix = np.concatenate([np.zeros((0, sum(sizes))), *(over_y(rows.matrix, sizes) for rows in pieces)])
    lower, upper = (np.concatenate([np.zeros(0), *(getattr(p, side) for p in pieces)]) for side in ("lower", "upper"))
    dynamics, contacts, *_ = equalities(terms, None)
    fixed = np.concatenate((dynamics, contacts))
    n = sizes[2]
    change = np.eye(sum(sizes), n, -(sizes[0] + sizes[1]))  # of y with tau: the equalities stay as they are
    change[:-n] = -np.linalg.lstsq(fixed[:, :-n], fixed[:, -n:], rcond=1e-12)[0]
    noise = matrix @ change @ error.root
    sigma = np.sqrt(np.sum(noise**2, axis=1))
    length = np.sqrt(np.sum((matrix @ change * error.scale) ** 2, axis=1))
    sigma[sigma <= CERTAIN * length] = 0.0
    noise[sigma == 0.0] = 0.0
    return _Limits(matrix, lower, upper, noise, sigma)


def _add_individual(program: Any, y: Any, rows: _Limits, weight: float) -> tuple[Any, FloatArray]:
    """The cost w R_ind; no variable of its own."""

    def value(at: FloatArray) -> tuple[float, FloatArray]:
        risk, by_row = _individual(rows, rows.matrix @ at)
        return weight * risk, weight * (by_row @ rows.matrix)

    name_binding(program.AddCost(_differentiable(value), vars=y), ROBUSTNESS)
    return y[:0], np.zeros(0)


def _individual(rows: _Limits, value: FloatArray) -> tuple[float, FloatArray]:
    """R_ind and its derivative by each row's B y."""
    erring = rows.sigma > 0.0
    sigma = np.where(erring, rows.sigma, 1.0)
    slope, risk = np.zeros(value.size), 0.0
    for sign, side in ((1.0, rows.upper), (-1.0, -rows.lower)):
        counted = erring & np.isfinite(side)
        u = (side[counted] - sign * value[counted]) / sigma[counted]
        log_phi = log_ndtr(u)
        risk -= float(log_phi.sum())
        hazard = np.exp(-0.5 * u**2 - _HALF_LOG_TWO_PI - log_phi)
        slope[counted] += sign * hazard / sigma[counted]
    return risk, slope


def _add_box(program: Any, y: Any, rows: _Limits, weight: float) -> tuple[Any, FloatArray]:
    """The half width s [sigma], its reward, and the limits drawn in by it."""
    s = program.NewContinuousVariables(1, "s")
    reach = np.abs(rows.noise).sum(axis=1)
    side = rows.upper[reach > 0.0], rows.lower[reach > 0.0]
    if not np.isfinite(np.concatenate(side)).any():  # every box fits
        name_binding(program.AddBoundingBoxConstraint(1.0, 1.0, s), ROBUSTNESS)
        return s, np.ones(1)
    name_binding(program.AddBoundingBoxConstraint(0.0, np.inf, s), ROBUSTNESS)
    name_binding(program.AddLinearCost(np.array([-weight]), 0.0, s), ROBUSTNESS)
    _add_rows(program, np.concatenate((y, s)), rows, reach[:, None], reach[:, None])
    return s, np.zeros(1)


def _add_rectangle(program: Any, y: Any, rows: _Limits, weight: float) -> tuple[Any, FloatArray]:
    """The sides (a, b) [sigma], their cost w R_rect, and the limits drawn in by them."""
    r = rows.noise.shape[1]
    sides = program.NewContinuousVariables(2 * r, "sides")
    positive, negative = np.maximum(rows.noise, 0.0), np.maximum(-rows.noise, 0.0)
    above, below = np.hstack((positive, negative)), np.hstack((negative, positive))
    _add_rows(program, np.concatenate((y, sides)), rows, above, below)
    widths = np.hstack((np.eye(r), np.eye(r)))
    name_binding(program.AddLinearConstraint(widths, np.full(r, WIDTH), np.full(r, np.inf), sides), ROBUSTNESS)

    def value(at: FloatArray) -> tuple[float, FloatArray]:
        risk, slope = _rectangle(at)
        return weight * risk, weight * slope

    name_binding(program.AddCost(_differentiable(value), vars=sides), ROBUSTNESS)
    return sides, np.ones(2 * r)


def _rectangle(sides: FloatArray) -> tuple[float, FloatArray]:
    """R_rect = -sum log(Phi(a) - Phi(-b)) and its derivative by (a, b)."""
    a, b = np.split(sides, 2)
    low, high = np.where(a + b > 0.0, -b, -1e-9 - a), a
    flip = low > 0.0  # the tail in which the difference is exact
    top, bottom = np.where(flip, -low, high), np.where(flip, -high, low)
    log_top = log_ndtr(top)
    inside = log_top + np.log1p(-np.exp(np.minimum(log_ndtr(bottom) - log_top, -1e-12)))
    density = np.exp(-0.5 * np.stack((a, b)) ** 2 - _HALF_LOG_TWO_PI - inside)
    return -float(inside.sum()), -density.ravel()


def _add_rows(program: Any, variables: Any, rows: _Limits, above: FloatArray, below: FloatArray) -> None:
    """B y + above x <= upper and B y - below x >= lower, of the sides that there are."""
    for matrix, side, is_upper in ((above, rows.upper, True), (-below, rows.lower, False)):
        there = np.isfinite(side) & (rows.sigma > 0.0)
        whole = np.hstack((rows.matrix[there], matrix[there]))
        none = np.full(there.sum(), np.inf)
        ends = (-none, side[there]) if is_upper else (side[there], none)
        if there.any():
            name_binding(program.AddLinearConstraint(whole, *ends, variables), ROBUSTNESS)


_ADD: dict[str, Callable[[Any, Any, _Limits, float], tuple[Any, FloatArray]]] = {
    "individual": _add_individual,
    "box": _add_box,
    "rectangle": _add_rectangle,
}


def _differentiable(function: Callable[[FloatArray], tuple[float, FloatArray]]) -> Callable[[Any], Any]:
    """A cost for Drake, which asks with plain numbers or with AutoDiffXd."""

    def cost(at: Any) -> Any:
        if at.dtype != object:
            return function(at)[0]
        value, slope = function(ExtractValue(at).ravel())
        return AutoDiffXd(value, slope @ ExtractGradient(at))

    return cost


def _risk(measure: str, rows: _Limits, y: FloatArray, added: FloatArray) -> float:
    if measure == "classic":
        return 0.0
    if measure == "individual" or not rows.noise.size:
        return _individual(rows, rows.matrix @ y)[0]
    return box_risk(float(added[0]), rows.noise.shape[1]) if measure == "box" else _rectangle(added)[0]


def _packed(
    terms: Terms, tasks: Sequence[TaskRows], rows: _Limits, y: FloatArray, error: TorqueError
) -> RobustSolution:
    """The solution y, whose risk counts as 0."""
    sizes, value = sizes_of(terms), rows.matrix @ y
    unit = np.where(rows.sigma > 0.0, rows.sigma, 1.0)
    active = (value >= rows.upper - ON_BORDER * unit).astype(np.int64) - (value <= rows.lower + ON_BORDER * unit)
    chance = float(np.exp(-_individual(rows, value)[0]))
    costs = [weighted(task, sizes) for task in tasks]
    cost = float(sum(np.sum((each.matrix @ y - each.target) ** 2) for each in costs))
    torque = y[y.size - error.joints :]
    return RobustSolution(torque, 0.0, chance, cost, active, Outcome.SOLVED, True, 0, 1, None)


def _unsolved(error: TorqueError, rows: _Limits, result: Any) -> RobustSolution:
    outcome = Outcome.INFEASIBLE if result.get_solution_result() in _INFEASIBLE else Outcome.FAILED
    active = np.zeros(rows.lower.size, dtype=np.int64)
    return RobustSolution(np.zeros(error.joints), np.inf, 0.0, np.inf, active, outcome, False, 0, 1, None)
