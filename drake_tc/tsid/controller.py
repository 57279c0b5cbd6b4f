"""`RobustTsid`: robust task-space inverse dynamics (Del Prete and Mansard, 2015) as a Drake system.

What a tick of robust TSID computes, stage by stage, for block graphs.
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from copy import copy, deepcopy
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, LeafSystem, ValueProducer

from drake_tc.array_stage import Arrays, ArrayStage, PortMethods, places
from drake_tc.errors import SimulationError
from drake_tc.inner_stages import InnerStage
from drake_tc.tsid.law import Law
from drake_tc.tsid.tick import TickInput, advance_tick, keep_tick, lost_tick
from drake_tc.types import Call, FloatArray


def inner_blocks(law: Law, references: Mapping[str, str], outputs: Sequence[str]) -> tuple[InnerStage, ...]:
    """Terms of the dynamics, rows of every task and limit, the reduction to joint torques, and the program.

    Args:
        law: What the controller solves.
        references: Task to the name of its input port.
        outputs: Names of the controller's output ports.
    """
    terms = InnerStage(
        "terms",
        "Kinematics and dynamics",
        {"state": "estimated_state", "contacts": "active_contacts"},
        {"terms": "M, h, J, dJ v"},
    )
    source = {"terms": "terms.terms"}
    tasks = [
        InnerStage(
            f"task {task.name}", type(task).__name__, {"reference": references[task.name], **source}, {"rows": "A, a"}
        )
        for task in law.tasks
    ]
    limits = [
        InnerStage(f"limit {limit.name}", type(limit).__name__, source, {"rows": "B, bounds"}) for limit in law.limits
    ]
    rows = {stage.name: f"{stage.name}.rows" for stage in (*tasks, *limits)}
    reduction = InnerStage("reduction", "To joint torques", source | rows, {"program": "D, d, G, bounds"})
    form = law.formulation
    chosen = "Strict priorities" if law.priorities else f"{form.measure}, {form.use}".replace("_", " ")
    program = InnerStage("program", chosen, {"program": "reduction.program"}, dict.fromkeys(outputs, "vector"))
    return (terms, *tasks, *limits, reduction, program)


_LOG = logging.getLogger(__name__)
TASK_PORT = "{}_reference"
"""Name of a task's port."""
_Given = tuple[FloatArray, Sequence[FloatArray], tuple[bool, ...] | None]
"""State, references, and which contacts carry."""


class RobustTsid(PortMethods, LeafSystem):
    """Torques by robust TSID, every `period`; between its ticks the outputs are held.

    Inputs:
        estimated_state (nq + nv): [q; v] in the plant's order, a floating base first.
        <task>_reference: one a task that follows something, blanks in its name as "_"; see the tasks for its size. Not
            connected: the task stays where the robot starts.
        active_contacts (contacts): above 1/2 where a contact carries; all of them when not connected.
    Outputs, each with direct feedthrough of every input at a tick:
        torque (n): tau, in the robot's order [N m].
        acceleration (nv): vdot that the model expects of it.
        contact_force (K): of all contacts, 0 where one does not carry, each in its own axes [N, N m].
        status (11): see `drake_tc.tsid.law.Status`; `constraints` names the rows that LIMIT counts.

        y[n] = F(u[n], s[n]),  x[n+1] = [t[n]; y[n]; s[n+1]],  s: what the next tick's solve knows of this one

    At a tick (no update yet at this time) y is F, so there is no delay; after the update, and until the next tick, it
    is x's; time that goes back begins a new tick. Nothing raises in the loop and all outputs are finite: what cannot be
    solved gives the safe torque, flagged. An exception inside a task or a limit fades the torque out; it is kept
    (`last_error`), logged once in a context, and raised where `strict` is set.

    Example:
        >>> controller = RobustTsid(load_law(MODELS / "hrp2_like" / "hrp2_like_tsid.yaml"))
        >>> controller.get_torque_output_port().size()
        30
    """

    def __init__(self, law: Law, *, strict: bool = False) -> None:
        """Declare the ports.

        Args:
            law: Tasks, limits, formulation, period.
            strict: Raise the exception of a task or limit in the loop (SimulationError) in place of fading out.
        """
        super().__init__()
        self._law, self._strict = law, strict
        self._constraints = law.constraints
        memory: Any = np.zeros(1 + law.memory.size)
        memory[0] = -np.inf
        self._first: FloatArray = memory
        index = self.DeclareDiscreteState(memory)
        self._memory = int(index)
        self._declare_inputs()
        self._solution: Any = self.DeclareCacheEntry(
            "solution",
            ValueProducer(allocate=lambda: Value(_Solution(law)), calc=self._solve),
            {
                *(port.ticket() for port in (self._state, self._active, *self._references)),
                self.discrete_state_ticket(index),
                self.time_ticket(),
            },
        )
        for name, place in law.memory.places.items():
            size = place.stop - place.start
            self.DeclareVectorOutputPort(name, size, self._writer(place), {self._solution.ticket()})
        self.DeclarePeriodicDiscreteUpdateEvent(law.period, 0.0, self._update)

    def _declare_inputs(self) -> None:
        model, terms = self._law.model, self._law.starting_terms()
        self._state: Any = self.DeclareVectorInputPort("estimated_state", model.nq + model.nv)
        self._active: Any = self.DeclareVectorInputPort("active_contacts", len(model.contacts))
        self._all = (True,) * len(model.contacts)
        self._references: list[Any] = []
        self._rest: list[FloatArray] = []
        for task in self._law.tasks:
            self._references.append(self.DeclareVectorInputPort(reference_port(task.name), task.reference_size))
            self._rest.append(task.rest(terms))

    @property
    def law(self) -> Law:
        """What it solves."""
        return self._law

    @property
    def inner_stages(self) -> tuple[InnerStage, ...]:
        """What a tick computes, in the order of computation, for block graphs."""
        references = {task.name: reference_port(task.name) for task in self._law.tasks}
        return inner_blocks(self._law, references, tuple(self._law.memory.places))

    @property
    def constraints(self) -> tuple[str, ...]:
        """Names of the rows that `Status.LIMIT` counts."""
        return self._constraints

    def last_error(self, context: Context) -> Exception | None:
        """The last exception of a task or limit in this context; None where there was none.

        Args:
            context: Of this system.

        Raises:
            RuntimeError: `context` is not this system's, for example because `fuse` has removed the system.
        """
        self.ValidateContext(context)
        solution: _Solution = self._solution.Eval(context)
        return solution.error

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        state, active, *references = (port.get_name() for port in (self._state, self._active, *self._references))
        width = self._law.memory.width

        def bind(arrays: Arrays) -> tuple[Call, Call]:
            given, held, after = arrays.inputs, arrays.before, arrays.after
            solution, out = _Solution(self._law), arrays.out
            now = [given.get(name, rest) for name, rest in zip(references, self._rest, strict=True)]
            known, carrying = given[state], given.get(active)

            def outputs(time: float) -> None:
                self._solved(solution, held, time, lambda: (known, now, self._switches(carrying)))
                out[:] = solution.memory[:width]

            def update(time: float) -> None:
                self._remember(solution, time, after)

            return outputs, update

        shown, reads = places(self._law.memory.places), frozenset({state, active, *references})
        return ArrayStage(width, shown, bind, reads, start=self._first, period=self._law.period)

    def _solve(self, context: Any, value: Any) -> None:
        """This tick's answer, or what is held, into the cache entry."""

        def given() -> _Given:
            references = [
                port.Eval(context) if port.HasValue(context) else rest
                for port, rest in zip(self._references, self._rest, strict=True)
            ]
            carrying = self._active.Eval(context) if self._active.HasValue(context) else None
            return self._state.Eval(context), references, self._switches(carrying)

        held = context.get_discrete_state(self._memory).value()
        self._solved(value.get_mutable_value(), held, context.get_time(), given)

    def _solved(self, solution: "_Solution", held: FloatArray, time: float, given: Callable[[], _Given]) -> None:
        """The answer of a tick, or what the state x[n] = `held` holds between ticks, into the solution."""
        before, solution.ticks = held[1:], not 0.0 <= time - held[0] <= 0.99 * self._law.period
        if not solution.ticks:
            solution.memory[:] = before
            return
        state, references, active = given()
        if active is None:
            keep_tick(self._law, lost_tick(self._law, self._law.memory.previous(before)), solution.memory)
            return
        error = advance_tick(self._law, solution.scratch, TickInput(state, references, active), before, solution.memory)
        if error is not None:
            self._report(solution, error, time)

    def _report(self, solution: "_Solution", error: Exception, time: float) -> None:
        """Keep an exception, and log the first one or raise it."""
        first, solution.error = solution.error is None, error
        text = f"tsid: a task or limit failed at t = {time:g} s: {type(error).__name__}: {error}"
        if self._strict:
            raise SimulationError(text) from error
        if first:
            _LOG.error("%s; the torque fades out", text, exc_info=error)

    def _switches(self, given: FloatArray | None) -> tuple[bool, ...] | None:
        """Which contacts carry; all of them where nothing is given, None where that is not a number."""
        if given is None:
            return self._all
        return tuple((given > 0.5).tolist()) if np.isfinite(given).all() else None

    def _writer(self, place: slice) -> Callable[[Context, Any], None]:
        def write(context: Context, vector: Any) -> None:
            vector.set_value(self._solution.Eval(context).memory[place])

        return write

    def _update(self, context: Any, values: Any) -> None:
        """x[n+1]."""
        after = values.get_mutable_value(self._memory)
        self._remember(self._solution.Eval(context), context.get_time(), after)

    @staticmethod
    def _remember(solution: "_Solution", time: float, after: FloatArray) -> None:
        """x[n+1] of a tick."""
        if solution.ticks:
            after[0], after[1:] = time, solution.memory


class _Solution:
    """What the cache entry holds.

    Attributes:
        scratch: Of the model.
        memory: (S,) the last tick, as `Law.memory` lays it out.
        ticks: Whether it is one of this instant.
        error: The last exception.
    """

    def __init__(self, law: Law) -> None:
        self.scratch, self.memory = law.model.create_scratch(), np.zeros(law.memory.size)
        self.ticks = False
        self.error: Exception | None = None

    def __deepcopy__(self, memo: object) -> "_Solution":
        """For a cloned context: own memory; exceptions are never changed, so they are shared."""
        other = copy(self)
        other.scratch, other.memory = deepcopy(self.scratch), self.memory.copy()
        return other


def reference_port(task: str) -> str:
    """Name of the port of a task's reference."""
    return TASK_PORT.format(task.replace(" ", "_"))
