"""`RobustTsid`: robust task-space inverse dynamics (Del Prete and Mansard, 2015) as a Drake system.

What a tick of robust TSID computes, stage by stage, for block graphs.
"""

import logging
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydrake.systems.framework import Context

from drake_tc.array_stage import Arrays, ArrayStage, InnerStage, StageSystem, places
from drake_tc.errors import SimulationError
from drake_tc.tsid.law import Law
from drake_tc.tsid.tick import TickInput, advance_tick, keep_tick, lost_tick
from drake_tc.types import Call


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


class RobustTsid(StageSystem):
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
        model, terms = law.model, law.starting_terms()
        self._rest = {reference_port(task.name): task.rest(terms) for task in law.tasks}
        sizes = {"estimated_state": model.nq + model.nv, "active_contacts": len(model.contacts)}
        sizes |= {reference_port(task.name): task.reference_size for task in law.tasks}
        self._declare(sizes, timed=True)

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

        Raises:
            RuntimeError: `context` is not this system's, for example because `fuse` has removed the system.
        """
        self.ValidateContext(context)
        self._stage_outputs[0].Eval(context)
        error: Exception | None = self._stage_arrays.Eval(context).notes.get("error")
        return error

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports; the state is [time of the last tick; what it leaves]."""
        law, memory = self._law, self._law.memory
        start = np.append(-np.inf, np.zeros(memory.size))

        def bind(arrays: Arrays) -> tuple[Call, Call]:
            given, held, after, out = arrays.inputs, arrays.before, arrays.after, arrays.out
            now, state = [given.get(name, rest) for name, rest in self._rest.items()], given["estimated_state"]
            carrying = given.get("active_contacts", np.ones(len(law.model.contacts)))
            scratch, found = law.model.create_scratch(), np.zeros(memory.size)

            def ticks(time: float) -> bool:
                return not 0.0 <= time - held[0] <= 0.99 * law.period

            def outputs(time: float) -> None:
                before = held[1:]
                if not ticks(time):
                    found[:] = before
                elif not np.isfinite(carrying).all():
                    keep_tick(law, lost_tick(law, memory.previous(before)), found)
                else:
                    now_at = TickInput(state, now, tuple((carrying > 0.5).tolist()))
                    error = advance_tick(law, scratch, now_at, before, found)
                    if error is not None:
                        self._report(arrays.notes, error, time)
                out[:] = found[: memory.width]

            def update(time: float) -> None:
                if ticks(time):
                    after[0], after[1:] = time, found

            return outputs, update

        reads = frozenset({"estimated_state", "active_contacts", *self._rest})
        return ArrayStage(memory.width, places(memory.places), bind, reads, start=start, period=law.period)

    def _report(self, notes: dict[str, Any], error: Exception, time: float) -> None:
        """Keep an exception, and log the first one or raise it."""
        first, notes["error"] = "error" not in notes, error
        text = f"tsid: a task or limit failed at t = {time:g} s: {type(error).__name__}: {error}"
        if self._strict:
            raise SimulationError(text) from error
        if first:
            _LOG.error("%s; the torque fades out", text, exc_info=error)


def reference_port(task: str) -> str:
    """Name of the port of a task's reference."""
    return TASK_PORT.format(task.replace(" ", "_"))
