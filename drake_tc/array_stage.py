"""`ArrayStage`: the calculations of a stage as functions on arrays, without Drake's ports and Contexts.

A stage with a method `on_arrays() -> ArrayStage` can run together with other stages in a single Drake system
(`drake_tc.loops.fused`). The stage's own Drake callbacks call the same functions, so that both forms compute the same
numbers; those of a `StageSystem` are made from its `on_arrays`. A subclass that changes or adds methods needs an
`on_arrays` of its own (`offered_stage`).

`PortMethods`: `get_command_output_port()` and the like, for every port of a system by its name.

Systems that compute several things in a tick list these as `InnerStage`, for the block graph.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import LeafSystem, ValueProducer

from drake_tc.kernels.calls import sequences
from drake_tc.types import Call, FloatArray, IntArray


class Held:
    """Holds the value of an abstract input port. It is set in the same way as an array, by `held[:] = value`."""

    value: Any = None

    def __setitem__(self, where: slice, value: Any) -> None:
        self.value = value


@dataclass(frozen=True)
class Arrays:
    """The arrays of one stage in one Context. They are the same objects in every tick.

    Attributes:
        inputs: Name of each connected input port to its value: (n,) and read-only, or a `Held` if the port is abstract.
        out: (width,) outputs y[n] of this tick.
        before: (S,) state x[n], read-only.
        after: (S,) state x[n+1]; equal to x[n] when an update begins.
        notes: What the stage keeps in this Context beside numbers, such as an exception; a clone has it too.
    """

    inputs: Mapping[str, Any]
    out: FloatArray
    before: FloatArray
    after: FloatArray
    notes: dict[str, Any] = field(default_factory=dict)


class Bind(Protocol):
    """Bind a stage's functions to arrays."""

    def __call__(self, arrays: Arrays) -> tuple[Call | Sequence[Call] | None, Call | Sequence[Call] | None]:
        """Return the functions of one stage in one Context.

        Returns:
            First the function, or several in their order, that computes `out` from the inputs in `ArrayStage.reads` and
            `before`. Second the one that computes `after` (the update); all inputs and `out` have the values of the
            tick when it is called. None where there is nothing to compute. Neighbouring functions that are a
            `KernelCall` (`drake_tc.kernels.calls`) run in one compiled call.
        """


@dataclass(frozen=True, eq=False)
class ArrayStage:
    """A stage on arrays.

    Attributes:
        width: Length of `Arrays.out`.
        ports: Name of an output port to its indices in `out`. An output port that is missing here exists only on the
            stage's own Drake system.
        bind: Makes the functions for one Context.
        reads: Input ports on which `out` depends in the same tick.
        updates: Further input ports, on which only the next state depends.
        start: (S,) initial state.
        period: Period of the update [s]; None for a stage without state.
        early: Outputs that depend on fewer inputs than `reads`, where the stage has such outputs and another stage may
            lie between them and the others. It has no state of its own: its `Arrays.before` is the state of this stage.
        begin: Makes the function for one Context that computes `after` when a simulator is initialized; None where the
            state stays as it is then.
    """

    width: int
    ports: Mapping[str, IntArray]
    bind: Bind
    reads: frozenset[str] = frozenset()
    updates: frozenset[str] = frozenset()
    start: FloatArray = field(default_factory=lambda: np.zeros(0))
    period: float | None = None
    early: "ArrayStage | None" = None
    begin: Callable[[Arrays], Call] | None = None

    @property
    def inputs(self) -> frozenset[str]:
        """All input ports that are used."""
        return self.reads | self.updates | (frozenset() if self.early is None else self.early.reads)

    def part_with(self, port: str) -> "ArrayStage | None":
        """This stage, or its early one, whichever has the output port; None where no part has it."""
        parts = (self,) if self.early is None else (self, self.early)
        return next((part for part in parts if port in part.ports), None)


def offered_stage(system: Any) -> ArrayStage | None:
    """The calculations of a system on arrays; None where it does not offer them.

    An inherited `on_arrays` does not know the methods that a subclass defines, so it is not used where there are any.
    A subclass may implement abstract methods, which `on_arrays` calls, and then may have a constructor.
    """
    classes = type(system).__mro__
    owner = next((place for place, each in enumerate(classes) if "on_arrays" in vars(each)), None)
    if owner is None or any(_differs(each, classes[place + 1 :]) for place, each in enumerate(classes[:owner])):
        return None
    stage: ArrayStage | None = system.on_arrays()
    return stage


def _differs(own: type, bases: Sequence[type]) -> bool:
    """Whether a class defines methods or properties other than implementations of abstract ones."""
    names = {name for name, value in vars(own).items() if hasattr(value, "__get__") and not name.startswith("__")}
    implemented = {name for name in names if _is_abstract(name, bases)}
    return bool(names - implemented) or ("__init__" in vars(own) and not implemented)


def _is_abstract(name: str, bases: Sequence[type]) -> bool:
    found = next((vars(each)[name] for each in bases if name in vars(each)), None)
    return bool(getattr(found, "__isabstractmethod__", False))


def places(parts: Mapping[str, slice]) -> dict[str, IntArray]:
    """`ArrayStage.ports` of ports that are slices of `out`, with a stop each.

    Example:
        >>> places({"value": slice(0, 2), "rate": slice(2, 4)})["rate"]
        array([2, 3])
    """
    return {name: np.arange(part.start or 0, part.stop, part.step or 1) for name, part in parts.items()}


_KINDS = ("input", "output")


class PortMethods:
    """Base beside Drake's LeafSystem: a method `get_<port>_input_port()` or `get_<port>_output_port()` for every port.

    `system.get_command_output_port()` is `system.GetOutputPort("command")`; `dir(system)` lists the methods.

    Example:
        >>> guard = CommandGuard(6, 1e-3)
        >>> guard.get_command_output_port().size()
        6
    """

    def __getattr__(self, name: str) -> Callable[[], Any]:
        """The method of a port.

        Raises:
            AttributeError: no such attribute; names the ports where the name is that of a port's method.
        """
        own: Any = self
        for kind in _KINDS if name.startswith("get_") else ():  # Drake asks for another name in every step
            if name.endswith(f"_{kind}_port"):
                port, names = name.removeprefix("get_").removesuffix(f"_{kind}_port"), _port_names(own, kind)
                if port in names:
                    find: Any = getattr(own, f"Get{kind.title()}Port")
                    return lambda: find(port)
                raise AttributeError(
                    f"{type(self).__name__} has no {kind} port {port!r}; its ports: {', '.join(names)}"
                )
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def __dir__(self) -> list[str]:
        methods = [f"get_{port}_{kind}_port" for kind in _KINDS for port in _port_names(self, kind)]
        return [*super().__dir__(), *methods]


def _port_names(system: Any, kind: str) -> list[str]:
    count, find = getattr(system, f"num_{kind}_ports"), getattr(system, f"get_{kind}_port")
    return [find(index).get_name() for index in range(count())]


class StageSystem(PortMethods, LeafSystem):
    """A Drake system whose ports, state and updates are those of its `on_arrays`.

    Each output depends on the inputs in `ArrayStage.reads` of the part that has it, and on the state. The discrete
    state is one group, `ArrayStage.start`; `self._memory` is its index.
    """

    def _declare(self, sizes: Mapping[str, int], *, timed: bool = False) -> None:
        """Declare all of it; once, at the end of the subclass's constructor.

        Args:
            sizes: Name of each input port to its size.
            timed: Whether outputs depend on the time too.
        """
        own: Any = self
        stage: ArrayStage = own.on_arrays()
        ports: dict[str, Any] = {name: self.DeclareVectorInputPort(name, size) for name, size in sizes.items()}
        always = {self.time_ticket()} if timed else set()
        if stage.start.size:
            start: Any = stage.start
            state = self.DeclareDiscreteState(start)
            self._memory = int(state)
            always.add(self.discrete_state_ticket(state))
        memory = self._memory if stage.start.size else None
        self._stage_arrays: Any = self.DeclareCacheEntry(
            "arrays",
            ValueProducer(allocate=lambda: Value(_BoundStage(stage, ports, memory)), calc=lambda context, value: None),
            {self.nothing_ticket()},
        )
        self._stage_outputs: list[Any] = []
        for number, part in enumerate((stage,) if stage.early is None else (stage, stage.early)):
            tickets = {*always, *(ports[name].ticket() for name in part.reads)} or {self.nothing_ticket()}
            if [where.size for where in part.ports.values()] == [part.width]:  # the port itself holds what is solved
                (name,) = part.ports
                port = self.DeclareVectorOutputPort(name, part.width, self._solver(number), tickets)
                self._stage_outputs.append(port)
                continue
            allocate = Value(np.zeros(part.width)).Clone
            solved = self.DeclareCacheEntry(
                f"solved_{number}", ValueProducer(allocate=allocate, calc=self._solver(number)), tickets
            )
            self._stage_outputs.append(solved)
            for name, where in part.ports.items():
                self.DeclareVectorOutputPort(name, where.size, _writer(solved, where), {solved.ticket()})
        if stage.period is not None:
            self.DeclarePeriodicDiscreteUpdateEvent(stage.period, 0.0, self._update)

    def _solver(self, number: int) -> Callable[[Any, Any], None]:
        """The calc function of the outputs of a part."""

        def solve(context: Any, value: Any) -> None:
            value.get_mutable_value()[:] = self._stage_arrays.Eval(context).outputs(context, number)

        return solve

    def _update(self, context: Any, values: Any) -> None:
        """x[n+1]."""
        self._stage_outputs[0].Eval(context)
        values.set_value(self._memory, self._stage_arrays.Eval(context).update(context))


class _BoundStage:
    """The arrays of a stage in one Context, and its functions on them; a copy is empty, for another Context."""

    def __init__(self, stage: ArrayStage, ports: Mapping[str, Any], memory: int | None) -> None:
        self._stage, self._ports, self._memory = stage, ports, memory
        self._parts = (stage,) if stage.early is None else (stage, stage.early)
        self._names = [*(part.reads for part in self._parts), stage.updates - stage.reads]
        self._absent: frozenset[str] = frozenset()
        self._solved, self.notes = False, dict[str, Any]()
        self._bind()

    def __deepcopy__(self, memo: object) -> "_BoundStage":
        other = _BoundStage(self._stage, self._ports, self._memory)
        other.notes |= self.notes
        return other

    def outputs(self, context: Any, number: int) -> FloatArray:
        """(width,) outputs of a part."""
        self._read(context, number)
        if self._memory is not None:
            self._before[:] = context.get_discrete_state(self._memory).get_mutable_value()  # `value` copies
        time = context.get_time()
        for call in self._calls[number]:
            call(time)
        self._solved |= not number
        return self._out[number]

    def update(self, context: Any) -> FloatArray:
        """(S,) the next state; what the outputs have read and computed in these arrays is used."""
        if not self._solved:  # the outputs are up to date, but were computed in the Context that was cloned
            self.outputs(context, 0)
        self._read(context, -1)
        if not self._solved:  # bound to new arrays
            self.outputs(context, 0)
        self._after[:] = self._before
        time = context.get_time()
        for call in self._calls[-1]:
            call(time)
        return self._after

    def _read(self, context: Any, number: int) -> None:
        """Read the state and inputs; an input that the outputs do not depend on counts as connected until an update."""
        present, absent = self._known[number]
        try:
            for port, held in present:
                held[:] = port.Eval(context)
            changed = any(port.HasValue(context) for port in absent)
        except RuntimeError:  # an input is no longer connected
            changed = True
        if changed:
            self._bind_again(context, number)

    def _bind_again(self, context: Any, number: int) -> None:
        """Bind to the inputs that are connected now, and read those that this needs."""
        names = self._names[number]
        self._absent = self._absent - names | {name for name in names if not self._ports[name].HasValue(context)}
        try:
            self._bind()
        except KeyError as required:
            self._ports[required.args[0]].Eval(context)  # which raises Drake's own error
            raise
        for port, held in self._known[number][0]:
            held[:] = port.Eval(context)

    def _bind(self) -> None:
        size, self._solved = self._stage.start.size, False
        self._inputs = {name: np.zeros(port.size()) for name, port in self._ports.items() if name not in self._absent}
        self._before, self._after = np.zeros(size), np.zeros(size)
        self._out = [np.zeros(part.width) for part in self._parts]
        bound = [
            part.bind(Arrays(self._inputs, out, self._before, self._after, self.notes))
            for part, out in zip(self._parts, self._out, strict=True)
        ]
        self._calls = [sequences(_in_turn(calls)) for calls in (*(outputs for outputs, _ in bound), bound[0][1])]
        self._known = [
            (
                [(self._ports[name], self._inputs[name]) for name in names - self._absent],
                [self._ports[name] for name in names & self._absent],
            )
            for names in self._names
        ]


def _in_turn(calls: Call | Sequence[Call] | None) -> Sequence[Call]:
    return () if calls is None else (calls,) if callable(calls) else calls


def _writer(solved: Any, where: IntArray) -> Callable[[Any, Any], None]:
    """The calc function of an output port."""
    part = slice(int(where[0]), int(where[-1]) + 1) if where.size else slice(0)

    def write(context: Any, vector: Any) -> None:
        vector.set_value(solved.Eval(context)[part])

    return write


INNER_STAGES = "inner_stages"
"""Attribute of a system with such stages: a tuple of InnerStage. `RobustTsid` has one."""


@dataclass(frozen=True)
class InnerStage:
    """One stage inside a system.

    Attributes:
        name: Name of the stage; unique in its system.
        kind: What it is, in a few words or by its class.
        inputs: Input to its source: the name of an input port of the system, or `STAGE.OUTPUT`.
        outputs: Output to what it carries, such as `TaskRows`. An output with the name of an output port of the system
            is that port.

    Example:
        >>> InnerStage("terms", "dynamics", {"state": "estimated_state"}, {"terms": "Terms"}).kind
        'dynamics'
    """

    name: str
    kind: str
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
