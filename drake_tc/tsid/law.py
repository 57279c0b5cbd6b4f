"""What a tick leaves to its outputs and to the next tick, in one array, as the compiled call reads and writes it.

What one tick tells the next, as numbers of a fixed size, so that it may stand in a Context's discrete state.

What a controller of robust TSID solves in each tick: tasks, limits and formulation of one robot.

Rows of tasks and limits, checked once where a law is built: a wrong shape is an error there and not a lost tick.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import Kernel
from drake_tc.tsid.assembly import check_names, names_of, order_of
from drake_tc.tsid.fused import FusedProblem, WarmTick
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.priorities import Priorities
from drake_tc.tsid.program_solver import ProgramSolver
from drake_tc.tsid.qp import QpSolver
from drake_tc.tsid.robust.convex import FREE, ActiveSet, Start
from drake_tc.tsid.robust.formulation import Formulation
from drake_tc.tsid.robust.scaled import TorqueError
from drake_tc.tsid.rows import Limit, LimitRows, Parts, Task, TaskRows, Terms
from drake_tc.types import FloatArray

_SIZE, _PACK, _UNPACK = (Kernel("tsid.active_set", name) for name in ("size", "pack", "unpack"))


class WarmStart:
    """A `Start` as the numbers that `drake_tc.kernels.tsid.active_set` lays out, and back."""

    def __init__(self, joints: int) -> None:
        """Lay it out for n joints."""
        self._n = joints
        self.size = int(_SIZE(joints))

    def pack(self, start: Start | None, out: FloatArray) -> None:
        """`start` into out (size,); zeros where there is none."""
        if start is None:
            out[:] = 0.0
        else:
            inner = out[:0] if start.inner is None else start.inner
            _PACK(start.torque, (start.rows, start.weight), tuple(start.active_set), inner, out)

    def unpack(self, packed: FloatArray) -> Start | None:
        """The `Start` in packed (size,)."""
        if packed[0] != 1.0:
            return None
        torque, held, sides, multipliers, inner = _UNPACK(packed, self._n)
        active_set = ActiveSet(held, sides, multipliers) if held.size else FREE
        return Start(torque, int(packed[1]), active_set, float(packed[2]), inner if inner.size else None)


class PreviousTick(NamedTuple):
    """What a tick knows of the last one.

    Attributes:
        torque: (n,) [N m].
        start: Of its solution.
        falling: `Status.FALLING`.
    """

    torque: FloatArray
    start: Start | None
    falling: float = 0.0


class TickMemory:
    """The layout [tau (n); vdot (nv); f (K); status (11); start] of one tick; zeros are no tick.

    Attributes:
        places: Of "torque", "acceleration", "contact_force" and "status", in this order.
        width: How many numbers these have together.
        falling: Place of `Status.FALLING`.
        size: S, all numbers.
    """

    def __init__(self, joints: int, velocities: int, forces: int, status: int, falling: int) -> None:
        """Lay it out.

        Args:
            joints: n.
            velocities: nv.
            forces: K of all contacts.
            status: Numbers of a status.
            falling: Which of these is `Status.FALLING`.
        """
        sizes = {"torque": joints, "acceleration": velocities, "contact_force": forces, "status": status}
        ends = np.cumsum([0, *sizes.values()]).tolist()
        self.places = {name: slice(first, end) for name, first, end in zip(sizes, ends, ends[1:], strict=False)}
        self._warm = WarmStart(joints)
        self.width: int = ends[-1]
        self.falling = self.places["status"].start + falling
        self.size = self.width + self._warm.size

    def shown(self, memory: FloatArray) -> list[FloatArray]:
        """The parts in `places`, as views of memory (S,)."""
        return [memory[place] for place in self.places.values()]

    def start(self, memory: FloatArray) -> Start | None:
        """What the next tick's solve knows of a tick."""
        return self._warm.unpack(memory[self.width :])

    def previous(self, memory: FloatArray) -> PreviousTick:
        """A tick as the next one knows it."""
        return PreviousTick(memory[self.places["torque"]], self.start(memory), float(memory[self.falling]))

    def packed(self, before: PreviousTick) -> FloatArray:
        """(S,) with what the next tick knows."""
        memory = np.zeros(self.size)
        memory[self.places["torque"]], memory[self.falling] = before.torque, before.falling
        self._warm.pack(before.start, memory[self.width :])
        return memory

    def keep(self, shown: Sequence[FloatArray], start: Start | None, memory: FloatArray) -> None:
        """Write a tick.

        Args:
            shown: The parts in the order of `places`.
            start: For the next tick.
            memory: (S,) written.
        """
        np.concatenate(shown, out=memory[: self.width])
        self._warm.pack(start, memory[self.width :])


T = TypeVar("T")


def check_rows(terms: Terms, tasks: Sequence[Task], limits: Sequence[Limit]) -> None:
    """Evaluate each task at its own rest reference and each limit, and check what comes.

    Args:
        terms: At a state where all rows must be finite, the robot's start.
        tasks: Of a law.
        limits: Of a law.

    Raises:
        ParamsError: `rest` or `rows` failed, or an array has another shape or type than the protocols say; the message
            names the task or limit.
    """
    for task in tasks:
        _check_task(f"task {task.name!r}", task, terms)
    for limit in limits:
        _check_limit(f"limit {limit.name!r}", limit, terms)


def _check_task(who: str, task: Task, terms: Terms) -> None:
    reference = _evaluated(f"{who}: rest", lambda: task.rest(terms))
    _expect(f"{who}: rest", reference, (task.reference_size,))
    rows = _evaluated(f"{who}: rows", lambda: task.rows(terms, reference))
    if not isinstance(rows, TaskRows):
        raise ParamsError(f"{who}: rows must return TaskRows, got {type(rows).__name__}")
    count = _length(f"{who}: target", rows.target)
    _expect(f"{who}: weight", rows.weight, (count,))
    _check_parts(who, rows.matrix, count, terms)
    for name, values in (("target", rows.target), ("weight", rows.weight)):
        if not np.isfinite(values).all():
            raise ParamsError(f"{who}: {name} is not finite at the robot's starting posture: {values.tolist()}")


def _check_limit(who: str, limit: Limit, terms: Terms) -> None:
    rows = _evaluated(f"{who}: rows", lambda: limit.rows(terms))
    if not isinstance(rows, LimitRows):
        raise ParamsError(f"{who}: rows must return LimitRows, got {type(rows).__name__}")
    count = _length(f"{who}: lower", rows.lower)
    _expect(f"{who}: upper", rows.upper, (count,))
    _check_parts(who, rows.matrix, count, terms)
    if len(rows.labels) != count:
        raise ParamsError(f"{who}: expected {count} labels, one a row, got {len(rows.labels)}")
    if np.isnan(rows.lower).any() or np.isnan(rows.upper).any():
        raise ParamsError(f"{who}: lower or upper is NaN at the robot's starting posture; infinite means no limit")


def _check_parts(who: str, matrix: Parts, count: int, terms: Terms) -> None:
    if not isinstance(matrix, Parts):
        raise ParamsError(f"{who}: matrix must be Parts(vdot=..., force=..., torque=...), got {type(matrix).__name__}")
    columns = {"vdot": terms.bias.size, "force": terms.contact_bias.size, "torque": terms.actuated.size}
    for name, width in columns.items():
        part = getattr(matrix, name)
        if part is not None:
            _expect(f"{who}: matrix.{name}", part, (count, width))
            if not np.isfinite(part).all():
                raise ParamsError(f"{who}: matrix.{name} is not finite at the robot's starting posture")


def _evaluated(what: str, call: Callable[[], T]) -> T:
    try:
        return call()
    except Exception as error:
        raise ParamsError(f"{what} failed at the robot's starting posture: {type(error).__name__}: {error}") from error


def _length(what: str, values: FloatArray) -> int:
    if not (isinstance(values, np.ndarray) and values.ndim == 1):
        raise ParamsError(f"{what} must be an array of one dimension, got shape {np.shape(values)}")
    return int(values.size)


def _expect(what: str, values: FloatArray, shape: tuple[int, ...]) -> None:
    if not (isinstance(values, np.ndarray) and values.shape == shape):
        raise ParamsError(f"{what}: expected an array of shape {shape}, got shape {np.shape(values)}")


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
        contradict each other at this state (`limits.joints.Viability`); 0 for none, and where the state is lost.
    CONVERGED: 1 where the formulation reached its accuracy, 0 where its budget was spent before or with a fallback.
    FALLING: From 0 to 1, how long ticks have had no solution; at 1 the joints are damped alone
        (`drake_tc.tsid.fallbacks`).
    DROPPED: How many contacts that should carry move, and were left out of the tick.
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
    FALLING = 9
    DROPPED = 10


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
        return names_of(rows) + tuple(limit.name for limit in self.limits)

    @cached_property
    def fused(self) -> FusedProblem | None:
        """The problem of a tick as one compiled call; None where the solver needs what is between."""
        if isinstance(self.solver, ProgramSolver):
            return None
        terms = self.starting_terms()
        order = order_of([limit.rows(terms) for limit in self.limits])
        limits = [self.limits[i] for i in order]
        return FusedProblem(self.model, self.tasks, limits, self.error, self.contact_damping)

    @cached_property
    def warm(self) -> WarmTick | None:
        """A whole tick as one compiled call; None where the formulation solves more than one program in a tick."""
        if self.fused is None or self.priorities is not None or not WarmTick.solves(self.formulation):
            return None
        return WarmTick(self.fused, self.formulation, self.model)

    @cached_property
    def memory(self) -> TickMemory:
        """How one tick is laid out in an array."""
        return TickMemory(self.model.n, self.model.nv, self.model.force_size, len(Status), Status.FALLING)
