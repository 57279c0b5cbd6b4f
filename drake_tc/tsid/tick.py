"""One tick of robust TSID as a function: state and references in, torques, accelerations and contact forces out.

    terms -> rows of tasks and limits -> problem over the torques -> formulation -> tau -> vdot, f

`drake_tc.kernels.tsid.warm_tick` does all of it in one call that goes on from the last tick, and `problem` beside it
all up to the scaled problem. Where a law or a fallback needs what is between, the same stages follow one another here.
A tick always has an answer, and `Tick.status` says which it is:

    solved        the formulation's torque
    risky         every limit can be kept but not R <= R_min: the formulation's safest torque
    infeasible    no torque keeps all limits: the one that misses least (`fallbacks.diagnose`), near the safe one
    failed        no answer of the programs: the safe torque, weight and damping (`fallbacks.safe_torque`)
    falling       ticks without a solution have lasted: the torque above gives way to damping (`falling`)
    lost          an input is not finite, or a task or limit raised an exception: the torque before, faded out,
                  tau[n] = exp(-period/fade) tau[n-1]; `Tick.error` holds the exception
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from drake_tc.errors import SimulationError
from drake_tc.kernels.calls import Kernel
from drake_tc.tsid import fallbacks
from drake_tc.tsid.assembly import AffineMap, Reduced, names_of, reduce
from drake_tc.tsid.contacts import ActiveContacts
from drake_tc.tsid.fused import LARGEST, LOST, NO_POSE, NO_ROWS, ProgramResult, WrittenRows
from drake_tc.tsid.law import Law, PreviousTick, Status
from drake_tc.tsid.model import Scratch
from drake_tc.tsid.program_solver import FullProblem, ProgramSolver
from drake_tc.tsid.qp import Outcome
from drake_tc.tsid.robust.convex import RobustSolution, Start
from drake_tc.tsid.robust.scaled import ScaledProblem, scaled
from drake_tc.tsid.rows import LimitRows, TaskRows, Terms
from drake_tc.types import FloatArray

_RESPONSE = Kernel("tsid.terms", "response")


class Tick(NamedTuple):
    """What one tick gives; finite whatever came in.

    Attributes:
        torque: (n,) tau [N m], in the robot's order.
        acceleration: (nv,) vdot that it causes; 0 where the state is lost.
        force: (K,) of all contacts, 0 where one is not active [N, N m]; 0 where the state is lost.
        status: (11,) see `Status`.
        start: For the next tick.
        error: What went wrong in the tick, where that raised an exception.
    """

    torque: FloatArray
    acceleration: FloatArray
    force: FloatArray
    status: FloatArray
    start: Start | None
    error: Exception | None = None

    @property
    def previous(self) -> PreviousTick:
        """This tick as the next one knows it."""
        return PreviousTick(self.torque, self.start, float(self.status[Status.FALLING]))


class TickInput(NamedTuple):
    """What one tick is given.

    Attributes:
        state: (nq + nv,) [q; v].
        references: One a task.
        active: One a contact: whether it carries.
    """

    state: FloatArray
    references: Sequence[FloatArray]
    active: tuple[bool, ...]

    @property
    def numbers(self) -> FloatArray:
        """(nq + nv + .,) the state and all references."""
        return np.concatenate((self.state, *self.references), dtype=np.float64)


class TickProblem(NamedTuple):
    """What a tick solves.

    Attributes:
        terms: At its state.
        tasks: Rows of each task.
        limits: Rows of each limit.
        reduced: Cost and polytope over the torques, and what torques cause.
    """

    terms: Terms
    tasks: Sequence[TaskRows]
    limits: Sequence[LimitRows]
    reduced: Reduced


def solve_tick(law: Law, scratch: Scratch, now: TickInput, before: PreviousTick) -> Tick:
    """One tick; never raises on numbers."""
    memory = law.memory
    after = np.empty(memory.size)
    error = advance_tick(law, scratch, now, memory.packed(before), after)
    torque, acceleration, force, status = memory.shown(after)
    return Tick(torque, acceleration, force, status, memory.start(after), error)


def advance_tick(law: Law, scratch: Scratch, now: TickInput, before: FloatArray, after: FloatArray) -> Exception | None:
    """One tick as `solve_tick`, on the arrays of a Context.

    Args:
        law: What to solve.
        scratch: Of the model.
        now: State, references and contacts.
        before: (S,) the last tick, as `law.memory` lays it out.
        after: (S,) this tick, written.

    Returns:
        `Tick.error`.
    """
    falling = float(before[law.memory.falling])
    dropped = 0
    if falling > 0.0:
        active, dropped = _still_standing(law, scratch, now.state, now.active)
        now = now._replace(active=active)
    error = _advance(law, scratch, now, before, after)
    status = after[law.memory.places["status"]]
    unsolved = status[Status.OUTCOME] in (Outcome.INFEASIBLE, Outcome.FAILED)
    if falling > 0.0 or unsolved:
        status[Status.DROPPED] = dropped
        status[Status.FALLING] = fallbacks.falling_share(falling, law.period, unsolved=bool(unsolved) or dropped > 0)
        _damp(law, scratch, now.state, now.active, after)
    return error


def _still_standing(law: Law, scratch: Scratch, state: FloatArray, active: tuple[bool, ...]) -> fallbacks.Standing:
    """The contacts on which a robot that may be falling stands; those that are told where its state is lost."""
    if not np.abs(state).max() < LARGEST:
        return fallbacks.Standing(active, 0)
    return fallbacks.standing_contacts(fallbacks.terms_at(law.model, scratch, state, active), active)


def _damp(law: Law, scratch: Scratch, state: FloatArray, active: tuple[bool, ...], after: FloatArray) -> None:
    """Let the torque of a tick give way to damping as far as its status says; a state that is lost fades."""
    memory = law.memory
    torque, status = (after[memory.places[name]] for name in ("torque", "status"))
    share = float(status[Status.FALLING])
    if share <= fallbacks.START or not np.abs(state).max() < LARGEST:
        return
    damped = fallbacks.damped_torque(
        fallbacks.terms_at(law.model, scratch, state, active), torque, share, law.fallback_damping, law.period
    )
    if np.isfinite(damped).all():
        torque[:], status[Status.FALLBACK] = damped, 1.0


def _advance(law: Law, scratch: Scratch, now: TickInput, before: FloatArray, after: FloatArray) -> Exception | None:
    """As `advance_tick`, of a robot that does not fall."""
    given, fused = now.numbers, law.fused
    told = fused is not None and not fused.asks  # the call itself looks whether a number is none
    if not told and not (given.max() < LARGEST and given.min() > -LARGEST):
        return keep_tick(law, lost_tick(law, law.memory.previous(before)), after)
    try:
        written = _written(law, scratch, now)
        if law.warm is not None and law.warm(given, scratch.select(now.active), written, before, after):
            return None
        tick = _by_stages(law, scratch, now, written, law.memory.previous(before))
    except Exception as error:  # in a control loop a torque is due, whatever went wrong; the tick keeps the exception
        tick = lost_tick(law, law.memory.previous(before), error)
    return keep_tick(law, tick, after)


def keep_tick(law: Law, tick: Tick, after: FloatArray) -> Exception | None:
    """Write a tick into `after` (S,); its error."""
    law.memory.keep((tick.torque, tick.acceleration, tick.force, tick.status), tick.start, after)
    return tick.error


def _by_stages(law: Law, scratch: Scratch, now: TickInput, written: WrittenRows, before: PreviousTick) -> Tick:
    """The tick from its problem on."""
    found = _found(law, scratch, now, written)
    if found is not None and found.code == LOST:
        _check_rows(problem_at(law, scratch, now))
        return lost_tick(law, before)
    if found is not None:
        solution = _of_scaled(law, scratch.select(now.active), written, found.scaled, before)
        if solution.outcome not in (Outcome.INFEASIBLE, Outcome.FAILED):
            return _told(law, found.causes, scratch.select(now.active), solution, found.relaxed)
    problem = problem_at(law, scratch, now)
    if found is None:
        solution = _solution(law, problem, before)
    if solution.outcome in (Outcome.INFEASIBLE, Outcome.FAILED):
        return _given_way(law, problem, solution, before)
    return _told(law, problem.reduced.causes, problem.terms.contacts, solution, _relaxed(problem))


def _found(law: Law, scratch: Scratch, now: TickInput, written: WrittenRows) -> ProgramResult | None:
    """The problem over the torques by one call; None for a law, or a state, that has none."""
    if law.fused is None:
        return None
    found = law.fused.problem(now.numbers, scratch.select(now.active), written)
    return None if found.code == NO_POSE else found


def _written(law: Law, scratch: Scratch, now: TickInput) -> WrittenRows:
    """Rows of tasks and limits that are no tables, of a law that has one call."""
    fused, model = law.fused, law.model
    if fused is None or not fused.asks:
        return NO_ROWS
    terms = model.terms(scratch, now.state[: model.nq], now.state[model.nq :], now.active)
    return fused.written_out(terms, now.references)


def _solution(law: Law, problem: TickProblem, before: PreviousTick) -> RobustSolution:
    reduced, form, solver = problem.reduced, law.formulation, law.solver
    if isinstance(solver, ProgramSolver):
        rows = FullProblem(problem.terms, problem.tasks, problem.limits, _held(law, problem.terms))
        return solver.solution(rows, form, law.error)
    if law.priorities is not None:
        sizes = [rows.target.size for rows in problem.tasks]
        whole = scaled(reduced.cost, reduced.polytope, law.error)
        return law.priorities.solve(whole, sizes, solver, form.options, before.start)
    return form.solve(reduced.cost, reduced.polytope, law.error, solver, before.start)


def _of_scaled(
    law: Law, contacts: ActiveContacts, written: WrittenRows, problem: ScaledProblem, before: PreviousTick
) -> RobustSolution:
    """The solution of a problem that one call has made."""
    form, solver = law.formulation, law.solver
    if law.priorities is None or law.fused is None or isinstance(solver, ProgramSolver):
        return form.solve_scaled(problem, solver, before.start)
    return law.priorities.solve(problem, law.fused.task_sizes(contacts, written), solver, form.options, before.start)


def problem_at(law: Law, scratch: Scratch, now: TickInput) -> TickProblem:
    """What a tick solves; arguments as in `solve_tick`."""
    model = law.model
    terms = model.terms(scratch, now.state[: model.nq], now.state[model.nq :], now.active)
    tasks = [task.rows(terms, reference) for task, reference in zip(law.tasks, now.references, strict=True)]
    limits = [limit.rows(terms) for limit in law.limits]
    return TickProblem(terms, tasks, limits, reduce(terms, tasks, limits, _held(law, terms)))


def _held(law: Law, terms: Terms) -> FloatArray | None:
    """Acceleration of the contacts that is asked for."""
    return -law.contact_damping * terms.contact_velocity if law.contact_damping else None


def _told(law: Law, causes: AffineMap, contacts: ActiveContacts, solution: RobustSolution, relaxed: int) -> Tick:
    """The tick of a solution."""
    risk = min(solution.robustness, LARGEST)
    found = (solution.outcome, 0.0, solution.iterations, risk, solution.p_ind, -1.0, 0.0)
    status = np.array([*found, relaxed, solution.converged, 0.0, 0.0])
    return _packed(law, causes, contacts, solution.torque, status)._replace(start=solution.start)


def _packed(law: Law, causes: AffineMap, contacts: ActiveContacts, torque: FloatArray, status: FloatArray) -> Tick:
    acceleration, force = _RESPONSE(torque, *causes, contacts.entries, law.model.force_size)
    return Tick(torque, acceleration, force, status, None)


def _given_way(law: Law, problem: TickProblem, solution: RobustSolution, before: PreviousTick) -> Tick:
    """The torque that misses least, or the safe one, where there is no solution."""
    _check_rows(problem)
    terms, polytope = problem.terms, problem.reduced.polytope
    lower, upper = polytope.lower[: polytope.bounds], polytope.upper[: polytope.bounds]
    torque = fallbacks.safe_torque(terms, law.fallback_damping, *((lower, upper) if polytope.bounds else ()))
    relaxed = _relaxed(problem)
    status = np.array([solution.outcome, 1.0, solution.iterations, 0.0, 0.0, -1.0, 0.0, relaxed, 0.0, 0.0, 0.0])
    if solution.outcome is Outcome.INFEASIBLE:
        found = fallbacks.diagnose(polytope, solver=law.solver, centre=torque)
        if found.outcome is Outcome.SOLVED:
            torque = np.clip(found.torque, lower, upper) if polytope.bounds else found.torque
        if found.rows.size:
            name = names_of(problem.limits)[int(found.rows[0])]
            known = name if name in law.constraints else name.partition(": ")[0]
            status[Status.LIMIT], status[Status.MISSED] = law.constraints.index(known), found.missed[0]
    tick = _packed(law, problem.reduced.causes, terms.contacts, torque, status)
    sound = np.isfinite(np.concatenate((tick.torque, tick.acceleration, tick.force, status))).all()
    return tick if sound else lost_tick(law, before)


def _check_rows(problem: TickProblem) -> None:
    """Rows of tasks and limits are numbers, at a state that is."""
    if not np.isfinite(problem.terms.mass_matrix).all():
        return
    for task in problem.tasks:
        if not np.isfinite(np.concatenate((task.target, task.weight, *task.matrix.flat()))).all():
            raise SimulationError(f"task {task.name!r}: its rows are not finite")
    for limit in problem.limits:
        if np.isnan(np.concatenate((limit.lower, limit.upper, *limit.matrix.flat()))).any():
            raise SimulationError(f"limit {limit.name!r}: its rows are not numbers")


def _relaxed(problem: TickProblem) -> int:
    return sum(rows.relaxed for rows in problem.limits)


def lost_tick(law: Law, before: PreviousTick, error: Exception | None = None) -> Tick:
    """The torque before, faded, where nothing is known."""
    model = law.model
    status = np.zeros(len(Status))
    status[Status.OUTCOME], status[Status.FALLBACK], status[Status.LIMIT] = Outcome.FAILED, 1.0, -1.0
    torque = np.exp(-law.period / law.fade) * before.torque
    return Tick(torque, np.zeros(model.nv), np.zeros(model.force_size), status, None, error)
