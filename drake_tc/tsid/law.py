"""One tick of robust TSID as a function: state and references in, torques, accelerations and contact forces out.

    terms -> rows of tasks and limits -> problem over the torques -> formulation -> tau -> vdot, f

A tick always has an answer, and `Tick.status` says which of these it is:

    solved        the formulation's torque
    risky         every limit can be kept but not R <= R_min: the formulation's safest torque
    infeasible    no torque keeps all limits: the one that misses least (`infeasible.diagnose`), near the safe one
    failed        no answer of the programs: the safe torque, weight and damping (`infeasible.safe_torque`)
    lost          an input is not finite, or a task or limit raised an exception: the torque before, faded out,
                  tau[n] = exp(-period/fade) tau[n-1]; `Tick.error` holds the exception
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property
from typing import NamedTuple

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.kernels.lazy import Kernel
from drake_tc.tsid.assembly import check_names, ordered
from drake_tc.tsid.check_rows import check_rows
from drake_tc.tsid.infeasible import diagnose, safe_torque
from drake_tc.tsid.limits.base import Limit
from drake_tc.tsid.model import Scratch, TsidModel
from drake_tc.tsid.priorities import Priorities
from drake_tc.tsid.program_solver import ProgramSolver
from drake_tc.tsid.qp.problem import Outcome, QpSolver
from drake_tc.tsid.reduction import Reduced, reduce
from drake_tc.tsid.robust.formulation import Formulation
from drake_tc.tsid.robust.solution import RobustSolution, Start
from drake_tc.tsid.robust.torque_error import TorqueError
from drake_tc.tsid.rows import LimitRows, TaskRows
from drake_tc.tsid.tasks.base import Task
from drake_tc.tsid.terms import Terms
from drake_tc.types import FloatArray

_RESPONSE = Kernel("reduction", "response")
LARGEST = 1e6
"""No input in SI units is as large; one that is counts as not finite. A larger R, or an infinite one, is told as it."""


class Status(IntEnum):
    """Places in the vector of a tick's status.

    OUTCOME: 0 solved, 1 infeasible, 2 failed or lost, 3 risky (`qp.problem.Outcome`).
    FALLBACK: 1 where the torque is not the formulation's.
    ITERATIONS: Of the formulation.
    ROBUSTNESS: R of the formulation's own measure, 1e6 where it is infinite; 0 for "classic" and with a fallback.
    P_IND: Product of the probabilities of the single limits, whatever the formulation; 0 with a fallback.
    LIMIT: Which of `Law.constraints` gave way first (misses most), counted from 0; -1 for none.
    MISSED: By how much, in that row's unit.
    RELAXED: How many joints' limits gave way before any program saw them, as their position, velocity and acceleration
        contradict each other at this state (`limits.viability`); 0 for none, and where the state is lost.
    CONVERGED: 1 where the formulation reached its accuracy, 0 where its budget was spent before or with a fallback.
    """

    OUTCOME = 0
    FALLBACK = 1
    ITERATIONS = 2
    ROBUSTNESS = 3
    P_IND = 4
    LIMIT = 5
    MISSED = 6
    RELAXED = 7
    CONVERGED = 8


class Tick(NamedTuple):
    """What one tick gives; finite whatever came in.

    Attributes:
        torque: (n,) tau [N m], in the robot's order.
        acceleration: (nv,) vdot that it causes; 0 where the state is lost.
        force: (K,) of all contacts, 0 where one is not active [N, N m]; 0 where the state is lost.
        status: (9,) see `Status`.
        start: For the next tick.
        error: What went wrong in the tick, where that raised an exception.
    """

    torque: FloatArray
    acceleration: FloatArray
    force: FloatArray
    status: FloatArray
    start: Start | None
    error: Exception | None = None


@dataclass(frozen=True, eq=False)
class Law:
    """Tasks, limits and formulation of one robot.

    Attributes:
        model: Of the robot and its contacts.
        tasks: Each with its own name.
        limits: Each with its own name.
        formulation: How the torques are chosen.
        priorities: Strict levels of the tasks in place of weights alone; of the formulation then its measure,
            "classic" or "individual", and its options count.
        error: Of the torques.
        solver: Of quadratic programs; a ProgramSolver solves the whole tick.
        period: Of the ticks [s].
        contact_damping: kd of J vdot + Jdot v = -kd J v at the active contacts [1/s].
        fallback_damping: Of the joints in the safe torque [N m s/rad].
        fade: Time in which the torque falls to 1/e where the state is lost [s].

    Raises:
        ParamsError: two names that are equal, an error of another number of joints, priorities that do not fit, a
            number that is not possible, or a task or limit whose rows fail or have a wrong shape at the start.

    Example:
        >>> law = load_law(MODELS / "hrp2_like" / "hrp2_like_tsid.yaml")
        >>> law.period
        0.001
    """

    model: TsidModel
    tasks: tuple[Task, ...]
    limits: tuple[Limit, ...]
    formulation: Formulation
    error: TorqueError
    solver: QpSolver
    period: float = 1e-3
    contact_damping: float = 0.0
    fallback_damping: float = 5.0
    fade: float = 0.1
    priorities: Priorities | None = None

    def __post_init__(self) -> None:
        check_names([*(task.name for task in self.tasks), *(limit.name for limit in self.limits)])
        if self.error.joints != self.model.n:
            raise ParamsError(f"sigma: expected {self.model.n} joints, the robot's, got {self.error.joints}")
        if self.priorities is not None:
            self._check_priorities(self.priorities)
        if isinstance(self.solver, ProgramSolver):
            self.solver.check(self.formulation)
            if self.priorities is not None:
                raise ParamsError("solver: program weighs tasks and knows no strict priorities")
        for name in ("period", "fade"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ParamsError(f"{name}: expected a positive number [s], got {value!r}")
        for name in ("contact_damping", "fallback_damping"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0):
                raise ParamsError(f"{name}: expected a finite number >= 0, got {value!r}")
        check_rows(self.starting_terms(), self.tasks, self.limits)

    def with_tasks(self, *tasks: Task, priority: int | None = None) -> "Law":
        """This law with more tasks; one of a name that is there takes that task's place.

        Args:
            tasks: To add.
            priority: Level of those that are new, where the law has strict priorities.

        Raises:
            ParamsError: see the class; or a priority is missing, or given to a law that has none.
        """
        old = {task.name: number for number, task in enumerate(self.tasks)}
        listed, new = list(self.tasks), [task for task in tasks if task.name not in old]
        for task in tasks:
            if task.name in old:
                listed[old[task.name]] = task
        priorities = self.priorities
        if priority is not None and priorities is None:
            raise ParamsError("priority: this law weighs its tasks and has no strict priorities")
        if priorities is not None and new:
            if priority is None:
                raise ParamsError(f"priority: task {new[0].name!r} needs one, as this law has strict priorities")
            priorities = replace(priorities, tasks=(*priorities.tasks, *(priority for _ in new)))
        return replace(self, tasks=(*listed, *new), priorities=priorities)

    def with_limits(self, *limits: Limit) -> "Law":
        """This law with more limits; one of a name that is there takes that limit's place.

        Raises:
            ParamsError: see the class.
        """
        given = {limit.name: limit for limit in limits}
        listed = [given.pop(limit.name, limit) for limit in self.limits]
        return replace(self, limits=(*listed, *given.values()))

    def _check_priorities(self, priorities: Priorities) -> None:
        if len(priorities.tasks) != len(self.tasks):
            raise ParamsError(f"priorities: expected one a task, {len(self.tasks)}, got {len(priorities.tasks)}")
        measure = self.formulation.measure
        if (priorities.robustness is not None) != (measure == "individual") or measure in ("box", "rectangle"):
            raise ParamsError(
                f"priorities: expected individual, with a level of its own, or classic, without one, got {measure}"
            )

    def starting_terms(self) -> Terms:
        """At rest in the robot's starting posture, every contact active."""
        model = self.model
        return model.terms(model.create_scratch(), model.start, np.zeros(model.nv))

    @cached_property
    def constraints(self) -> tuple[str, ...]:
        """Names of the rows of all limits at the start, "limit: row", then of the limits.

        A row that is not there at the start (an edge of another support polygon) counts as its limit.
        """
        terms = self.starting_terms()
        rows = [limit.rows(terms) for limit in self.limits]
        return _names(rows) + tuple(limit.name for limit in self.limits)


class Problem(NamedTuple):
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


class Before(NamedTuple):
    """What a tick knows of the last one.

    Attributes:
        torque: (n,) [N m].
        start: Of its solution.
    """

    torque: FloatArray
    start: Start | None


def solve_tick(
    law: Law,
    scratch: Scratch,
    state: FloatArray,
    references: Sequence[FloatArray],
    active: tuple[bool, ...],
    before: Before,
) -> Tick:
    """One tick; never raises on numbers.

    Args:
        law: What to solve.
        scratch: Of the model.
        state: (nq + nv,) [q; v].
        references: One a task.
        active: One a contact.
        before: The last tick.
    """
    given = np.concatenate((state, *references))
    if not (given.max() < LARGEST and given.min() > -LARGEST):
        return lost_tick(law, before)
    try:
        problem = problem_at(law, scratch, state, references, active)
        reduced, form = problem.reduced, law.formulation
        if isinstance(law.solver, ProgramSolver):
            rows = (problem.terms, problem.tasks, problem.limits, _held(law, problem.terms))
            solution = law.solver.solution(*rows, form, law.error)
        elif law.priorities is None:
            solution = form.solve(reduced.cost, reduced.polytope, law.error, law.solver, before.start)
        else:
            solution = law.priorities.solve(problem.tasks, reduced, law.error, law.solver, form.options, before.start)
        if solution.outcome in (Outcome.INFEASIBLE, Outcome.FAILED):
            return _given_way(law, problem, solution, before)
        risk = min(solution.robustness, LARGEST)
        found = (solution.outcome, 0.0, solution.iterations, risk, solution.p_ind, -1.0, 0.0)
        status = np.array([*found, _relaxed(problem), solution.converged])
        return _packed(law, problem, solution.torque, status, solution.start)
    except Exception as error:  # in a control loop a torque is due, whatever went wrong; the tick keeps the exception
        return lost_tick(law, before, error)


def problem_at(
    law: Law, scratch: Scratch, state: FloatArray, references: Sequence[FloatArray], active: tuple[bool, ...]
) -> Problem:
    """What a tick solves; arguments as in `solve_tick`."""
    model = law.model
    terms = model.terms(scratch, state[: model.nq], state[model.nq :], active)
    tasks = [task.rows(terms, reference) for task, reference in zip(law.tasks, references, strict=True)]
    limits = [limit.rows(terms) for limit in law.limits]
    return Problem(terms, tasks, limits, reduce(terms, tasks, limits, _held(law, terms)))


def _held(law: Law, terms: Terms) -> FloatArray | None:
    """Acceleration of the contacts that is asked for."""
    return -law.contact_damping * terms.contact_velocity if law.contact_damping else None


def _packed(law: Law, problem: Problem, torque: FloatArray, status: FloatArray, start: Start | None) -> Tick:
    causes, entries = problem.reduced.causes, problem.terms.contacts.entries
    acceleration, force = _RESPONSE(torque, *causes, entries, law.model.force_size)
    return Tick(torque, acceleration, force, status, start)


def _given_way(law: Law, problem: Problem, solution: RobustSolution, before: Before) -> Tick:
    """The torque that misses least, or the safe one, where there is no solution."""
    terms, polytope = problem.terms, problem.reduced.polytope
    lower, upper = polytope.lower[: polytope.bounds], polytope.upper[: polytope.bounds]
    torque = safe_torque(terms, law.fallback_damping, *((lower, upper) if polytope.bounds else ()))
    relaxed = _relaxed(problem)
    status = np.array([solution.outcome, 1.0, solution.iterations, 0.0, 0.0, -1.0, 0.0, relaxed, 0.0])
    if solution.outcome is Outcome.INFEASIBLE:
        found = diagnose(polytope, solver=law.solver, centre=torque)
        if found.outcome is Outcome.SOLVED:
            torque = np.clip(found.torque, lower, upper) if polytope.bounds else found.torque
        if found.rows.size:
            name = _names(problem.limits)[int(found.rows[0])]
            known = name if name in law.constraints else name.partition(": ")[0]
            status[Status.LIMIT], status[Status.MISSED] = law.constraints.index(known), found.missed[0]
    tick = _packed(law, problem, torque, status, None)
    sound = np.isfinite(np.concatenate((tick.torque, tick.acceleration, tick.force, status))).all()
    return tick if sound else lost_tick(law, before)


def _relaxed(problem: Problem) -> int:
    return sum(rows.relaxed for rows in problem.limits)


def lost_tick(law: Law, before: Before, error: Exception | None = None) -> Tick:
    """The torque before, faded, where nothing is known."""
    model = law.model
    status = np.zeros(len(Status))
    status[Status.OUTCOME], status[Status.FALLBACK], status[Status.LIMIT] = Outcome.FAILED, 1.0, -1.0
    torque = np.exp(-law.period / law.fade) * before.torque
    return Tick(torque, np.zeros(model.nv), np.zeros(model.force_size), status, None, error)


def _names(limits: Sequence[LimitRows]) -> tuple[str, ...]:
    """Of the polytope's rows."""
    return tuple(f"{rows.name}: {label}" for rows in ordered(limits) for label in rows.labels)
