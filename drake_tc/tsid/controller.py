"""`RobustTsid`: robust task-space inverse dynamics (Del Prete and Mansard, 2015) as a Drake system."""

import logging
from collections.abc import Callable, Sequence
from copy import deepcopy
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, LeafSystem, ValueProducer

from drake_tc.array_stage import Arrays, ArrayStage, places
from drake_tc.errors import SimulationError
from drake_tc.inner_stages import InnerStage
from drake_tc.port_methods import PortMethods
from drake_tc.tsid.inner_blocks import inner_blocks
from drake_tc.tsid.law import Law, Status
from drake_tc.tsid.model import Scratch
from drake_tc.tsid.tick import PreviousTick, Tick, lost_tick, solve_tick
from drake_tc.tsid.warm_start import WarmStart
from drake_tc.types import Call, FloatArray

_LOG = logging.getLogger(__name__)
TASK_PORT = "{}_reference"
"""Name of a task's port."""


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
        status (9): see `drake_tc.tsid.law.Status`; `constraints` names the rows that LIMIT counts.

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
        self._law, self._strict, model = law, strict, law.model
        self._warm = WarmStart(model.n)
        self._constraints = law.constraints
        sizes = {
            "torque": model.n,
            "acceleration": model.nv,
            "contact_force": model.force_size,
            "status": len(Status),
        }
        ends = np.cumsum([1, *sizes.values()]).tolist()
        self._places = {name: slice(end - size, end) for (name, size), end in zip(sizes.items(), ends[1:], strict=True)}
        self._start = slice(ends[-1], ends[-1] + self._warm.size)
        memory: Any = np.zeros(self._start.stop)
        memory[0] = -np.inf
        self._first: FloatArray = memory
        index = self.DeclareDiscreteState(memory)
        self._memory = int(index)
        self._declare_inputs()
        self._solution: Any = self.DeclareCacheEntry(
            "solution",
            ValueProducer(allocate=lambda: Value(_Solution(model.create_scratch())), calc=self._solve),
            {
                *(port.ticket() for port in (self._state, self._active, *self._references)),
                self.discrete_state_ticket(index),
                self.time_ticket(),
            },
        )
        for name, size in sizes.items():
            self.DeclareVectorOutputPort(name, size, self._writer(name), {self._solution.ticket()})
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
        return inner_blocks(self._law, references, tuple(self._places))

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
        first = self._places["torque"].start
        width = self._start.start - first
        state, active, *references = (port.get_name() for port in (self._state, self._active, *self._references))

        def bind(arrays: Arrays) -> tuple[Call, Call]:
            given, held, after = arrays.inputs, arrays.before, arrays.after
            solution = _Solution(self._law.model.create_scratch())
            parts = [(name, arrays.out[part.start - first : part.stop - first]) for name, part in self._places.items()]
            now = [given.get(name, rest) for name, rest in zip(references, self._rest, strict=True)]
            known, carrying = given[state], given.get(active)

            def outputs(time: float) -> None:
                if self._holds(held, time):
                    solution.hold(held, self._places)
                else:
                    self._answer(solution, held, time, now, self._switches(carrying), lambda: known)
                for name, out in parts:
                    out[:] = solution.outputs[name]

            def update(time: float) -> None:
                if solution.tick is not None:
                    self._remember(solution, time, after)

            return outputs, update

        shown = {name: slice(part.start - first, part.stop - first) for name, part in self._places.items()}
        reads = frozenset({state, active, *references})
        return ArrayStage(width, places(shown), bind, reads, start=self._first, period=self._law.period)

    def _solve(self, context: Any, value: Any) -> None:
        """This tick's answer, or what is held, into the cache entry."""
        solution: _Solution = value.get_mutable_value()
        held, time = context.get_discrete_state(self._memory).value(), context.get_time()
        if self._holds(held, time):
            solution.hold(held, self._places)
            return
        references = [
            port.Eval(context) if port.HasValue(context) else rest
            for port, rest in zip(self._references, self._rest, strict=True)
        ]
        active = self._switches(self._active.Eval(context) if self._active.HasValue(context) else None)
        self._answer(solution, held, time, references, active, lambda: self._state.Eval(context))

    def _holds(self, held: FloatArray, time: float) -> bool:
        """Whether the outputs of the last tick are held at this time [s]."""
        return bool(0.0 <= time - held[0] <= 0.99 * self._law.period)

    def _answer(
        self,
        solution: "_Solution",
        held: FloatArray,
        time: float,
        references: Sequence[FloatArray],
        active: tuple[bool, ...] | None,
        state: Callable[[], FloatArray],
    ) -> None:
        """The answer of a tick, from the state x[n] = `held`, into the solution."""
        before = PreviousTick(held[self._places["torque"]], self._warm.unpack(held[self._start]))
        if active is None:
            solution.take(lost_tick(self._law, before))
            return
        tick = solve_tick(self._law, solution.scratch, state(), references, active, before)
        solution.take(tick)
        if tick.error is not None:
            self._report(solution, tick.error, time)

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

    def _writer(self, name: str) -> Callable[[Context, Any], None]:
        def write(context: Context, vector: Any) -> None:
            vector.set_value(self._solution.Eval(context).outputs[name])

        return write

    def _update(self, context: Any, values: Any) -> None:
        """x[n+1]."""
        solution: _Solution = self._solution.Eval(context)
        if solution.tick is None:
            return
        self._remember(solution, context.get_time(), values.get_mutable_value(self._memory))

    def _remember(self, solution: "_Solution", time: float, after: FloatArray) -> None:
        """x[n+1] of a tick."""
        tick = solution.tick
        after[0] = time
        np.concatenate(tuple(solution.outputs.values()), out=after[1 : self._start.start])
        self._warm.pack(None if tick is None else tick.start, after[self._start])


class _Solution:
    """What the cache entry holds: scratch memory, the outputs, and the tick where this is one."""

    def __init__(self, scratch: Scratch) -> None:
        self.scratch = scratch
        self.tick: Tick | None = None
        self.error: Exception | None = None
        self.outputs: dict[str, FloatArray] = {}

    def __deepcopy__(self, memo: object) -> "_Solution":
        """For a cloned context: own scratch memory; ticks and exceptions are never changed, so they are shared."""
        other = _Solution(deepcopy(self.scratch))
        other.tick, other.error, other.outputs = self.tick, self.error, dict(self.outputs)
        return other

    def take(self, tick: Tick) -> None:
        """Outputs of a tick."""
        self.tick = tick
        self.outputs = {
            "torque": tick.torque,
            "acceleration": tick.acceleration,
            "contact_force": tick.force,
            "status": tick.status,
        }

    def hold(self, memory: FloatArray, places: dict[str, slice]) -> None:
        """Outputs of the last tick."""
        self.tick = None
        self.outputs = {name: memory[place] for name, place in places.items()}


def reference_port(task: str) -> str:
    """Name of the port of a task's reference."""
    return TASK_PORT.format(task.replace(" ", "_"))
