"""`FusedStages`: the stages of a plan as one Drake system.

`Scratch`: the arrays of fused stages in one Context.
"""

from collections.abc import Callable, Iterable, Sequence
from itertools import groupby
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, LeafSystem, OutputPort, System, ValueProducer

from drake_tc.array_stage import Arrays, Held, PortMethods
from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import KernelCall, gathering, sequences
from drake_tc.loops.fused.plan import Node, Plan, Source
from drake_tc.types import Call, FloatArray, IntArray


class Inputs(dict[str, Any]):
    """Name of each connected input port of a stage to its value; another name is a ParamsError."""

    def __init__(self, stage: str) -> None:
        """Empty.

        Args:
            stage: Name of the stage.
        """
        super().__init__()
        self._stage = stage

    def __missing__(self, name: str) -> Any:
        raise ParamsError(f"fuse: input port {name!r} of {self._stage!r} is not connected; connect it before fusing")


class Scratch:
    """The arrays of one Context, and the stages' functions on them.

    If the output port of a level is up to date, so are the signals of this level, as its calculation writes both. In a
    cloned Context the ports may be up to date while the arrays are new and empty; `computed` tells so.

    Attributes:
        signals: (N,) all signals; the elements in the plan are indices of it.
        before, after: (S,) states of this tick and of the next one.
        given: For each input port, by its number, where its value is written.
        outputs: For each level, the functions that compute its signals.
        updates: For each period, the functions that compute the next states.
        begins: The functions that compute the states at the start of a simulation.
        computed: Number of levels whose signals have been computed at least once in these arrays.
    """

    signals: FloatArray
    before: FloatArray
    after: FloatArray
    given: list[Any]
    outputs: list[list[Call]]
    updates: dict[float | None, list[Call]]
    begins: list[Call]

    def __init__(self, bind: Callable[["Scratch"], None]) -> None:
        """Make the arrays.

        Args:
            bind: Sets all attributes but `computed`.
        """
        self._bind, self.computed = bind, 0
        bind(self)

    def __deepcopy__(self, memo: object) -> "Scratch":
        return Scratch(self._bind)


def place_of(signals: FloatArray, elements: IntArray | None) -> Any:
    """Where a value from outside is written, by `place[:] = value`."""
    return Held() if elements is None else signals[elements[0] : elements[0] + elements.size]


def read_only(view: FloatArray) -> FloatArray:
    """The view, which is not writeable from now on."""
    view.flags.writeable = False
    return view


class FusedStages(PortMethods, LeafSystem):
    """Several stages in one system; it computes the same numbers as the stages' own systems, with fewer callbacks.

    Inputs: output ports outside that the stages read; an input is named "SYSTEM.PORT" after its source.
    Outputs:
        signals_0, signals_1, ...: signals that are read outside, by level (see `Plan`): signals_(k+1) depends on inputs
            that depend on signals_k.
    State x: the states of all stages, one behind the other. The states of the stages with one period are updated
    together, at each multiple of this period:

        x[n+1], y[n] = F(x[n], u[n])

    where F are the recursions of the stages. Gains and other parameters are those with which a stage was built.
    """

    graph_stage = "control"

    def __init__(self, plan: Plan) -> None:
        """Declare ports, state and updates.

        Args:
            plan: What is computed, in which order.
        """
        super().__init__()
        self._plan = plan
        self._nodes = _by_period(plan.nodes)
        ends = np.cumsum([0, *(node.stage.start.size for node in self._nodes)]).tolist()
        self._states = {node: slice(a, b) for node, a, b in zip(self._nodes, ends, ends[1:], strict=False)}
        start: Any = np.concatenate([np.zeros(0), *(node.stage.start for node in self._nodes)])
        memory = self.DeclareDiscreteState(start)
        self._memory = int(memory)
        self._inputs: list[Any] = [self._declare_input(number) for number in range(len(plan.given))]
        self._scratch: Any = self.DeclareCacheEntry(
            "scratch",
            ValueProducer(allocate=lambda: Value(Scratch(self.bind)), calc=lambda context, value: None),
            {self.nothing_ticket()},
        )
        tickets = {self.discrete_state_ticket(memory), self.time_ticket()}
        self._levels: list[Any] = []
        self._ports: list[list[tuple[int, Callable[[Context], Any]]]] = []
        for level in range(plan.num_levels):
            tickets |= {self._inputs[number].ticket() for number in self._read_at(level)}
            width, name = self._elements_at(level).size, f"signals_{level}"
            self._levels.append(self.DeclareVectorOutputPort(name, width, self._writer(level), set(tickets)))
        late = sorted(set(range(len(self._inputs))) - plan.read_now)
        self._late_ports = [(number, self._inputs[number].Eval) for number in late]
        self._parts: dict[float | None, slice] = {}
        for period, nodes in groupby(self._nodes, lambda node: node.stage.period):
            if period is not None:
                group = list(nodes)
                self._parts[period] = slice(self._states[group[0]].start, self._states[group[-1]].stop)
                self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._updater(period))
        if any(node.stage.begin is not None for node in self._nodes):
            self.DeclareInitializationDiscreteUpdateEvent(self._begin)

    def _declare_input(self, number: int) -> Any:
        port: Any = self._plan.given[number].port
        name = f"{port.get_system().get_name()}.{port.get_name()}"
        if self._plan.given[number].elements is None:
            return self.DeclareAbstractInputPort(name, port.Allocate())
        return self.DeclareVectorInputPort(name, port.size())

    def exported_at(self, level: int) -> list[Source]:
        """The output ports of replaced systems whose values the port of a level has, in this order."""
        return [source for source, at in self._plan.export_level.items() if at == level]

    def _elements_at(self, level: int) -> IntArray:
        """The elements among the signals that the port of a level has."""
        found = [self._plan.exported[source] for source in self.exported_at(level)]
        return np.concatenate([np.zeros(0, dtype=np.intp), *found])

    def _read_at(self, level: int) -> list[int]:
        """Numbers of the inputs that are read for the outputs of a level."""
        given = self._plan.given
        return [number for number in sorted(self._plan.read_now) if given[number].level == level]

    def _writer(self, level: int) -> Callable[[Context, Any], None]:
        """The calc function of a level's port."""
        chosen, eval_scratch = self._elements_at(level), self._scratch.Eval
        eval_lower = self._levels[level - 1].Eval if level else None
        self._ports.append([(number, self._inputs[number].Eval) for number in self._read_at(level)])

        def write(context: Any, vector: Any) -> None:
            scratch = eval_scratch(context)
            if eval_lower is not None:
                eval_lower(context)
                if scratch.computed < level:
                    self._compute(context, scratch, range(scratch.computed, level))
            self._compute(context, scratch, (level,))
            scratch.signals.take(chosen, out=vector.get_mutable_value(), mode="clip")

        return write

    def _updater(self, period: float) -> Callable[[Context, Any], None]:
        """The update of the stages of one period, whose states are a part of the state."""
        memory, part = self._memory, self._parts[period]

        def update(context: Any, values: Any) -> None:
            values.get_mutable_value(memory)[part] = self._advanced(context, period).after[part]

        return update

    def _begin(self, context: Any, values: Any) -> None:
        """The states with which a simulation starts."""
        scratch, time = self._evaluated(context), context.get_time()
        scratch.after[:] = scratch.before
        for call in scratch.begins:
            call(time)
        values.get_mutable_value(self._memory)[:] = scratch.after

    def _advanced(self, context: Context, period: float | None) -> Scratch:
        """The arrays of a Context, with the next states of the stages of one period."""
        scratch, part = self._evaluated(context), self._parts[period]
        after, time = scratch.after, context.get_time()
        after[part] = scratch.before[part]
        for call in scratch.updates[period]:
            call(time)
        return scratch

    def _evaluated(self, context: Context) -> Scratch:
        """The arrays of a Context, with all signals up to date, also those on which no output depends."""
        self._levels[-1].Eval(context)
        scratch: Scratch = self._scratch.Eval(context)
        if scratch.computed < len(self._levels):
            self._compute(context, scratch, range(scratch.computed, len(self._levels)))
        for number, evaluate in self._late_ports:
            scratch.given[number][:] = evaluate(context)
        return scratch

    def replaces(self, system: System) -> bool:
        """Whether this system stands in place of a system."""
        return system in self._plan.fused

    def output(self, context: Context, port: OutputPort) -> FloatArray:
        """Value of an output port of a replaced system, in a Context of this system.

        Raises:
            ParamsError: The port is not computed, as nothing reads it, or it is abstract.
        """
        elements = self._plan.elements(port)
        return np.array(self._evaluated(context).signals[elements])

    def input(self, context: Context, stage: System, name: str) -> FloatArray:
        """Value of an input port of a replaced stage, in a Context of this system.

        Raises:
            ParamsError: The port is not connected or not used, or it is abstract.
        """
        elements = self._plan.input_elements(stage, name)
        return np.array(self._evaluated(context).signals[elements])

    def next_state(self, context: Context, stage: System) -> FloatArray:
        """(S,) x[n+1] of a replaced stage, in a Context of this system.

        Raises:
            ParamsError: The stage has no state.
        """
        node = self._node(stage)
        part = self._states[node]
        return np.array(self._advanced(context, node.stage.period).after[part])

    def set_state(self, context: Context, stage: System, state: FloatArray) -> None:
        """Set the state (S,) of a replaced stage, in a Context of this system.

        Raises:
            ParamsError: The stage has no state, or one of another size.
        """
        node = self._node(stage)
        values: Any = np.array(context.get_discrete_state(self._memory).value())
        if np.shape(state) != node.stage.start.shape:
            raise ParamsError(f"{stage.get_name()}: expected {node.stage.start.size} numbers, got {np.shape(state)}")
        values[self._states[node]] = state
        context.SetDiscreteState(self._memory, values)

    def _node(self, stage: System) -> Node:
        """The node with the state of a replaced stage.

        Raises:
            ParamsError: There is none.
        """
        node = self._plan.node_of(stage)
        if node is None or node.stage.period is None:
            raise ParamsError(f"fuse: {stage.get_name()!r} is not a stage with state in {self.get_name()!r}")
        return node

    def _compute(self, context: Any, scratch: Scratch, levels: Iterable[int]) -> None:
        """Compute the signals of some levels; those of all lower levels are up to date."""
        given, time = scratch.given, context.get_time()
        for level in levels:
            if not level:
                scratch.before[:] = context.get_discrete_state(self._memory).get_mutable_value()  # `value` copies
            for number, evaluate in self._ports[level]:
                given[number][:] = evaluate(context)
            for call in scratch.outputs[level]:
                call(time)
            scratch.computed = max(scratch.computed, level + 1)

    def bind(self, scratch: Scratch) -> None:
        """Bind all stages to the arrays of a Context."""
        plan = self._plan
        scratch.signals, size = np.zeros(plan.size), sum(node.stage.start.size for node in self._nodes)
        scratch.before, scratch.after = np.zeros(size), np.zeros(size)
        scratch.given = [place_of(scratch.signals, given.elements) for given in plan.given]
        scratch.outputs = [[] for _ in self._levels]
        scratch.updates, scratch.begins = {node.stage.period: [] for node in plan.nodes}, []
        others: list[tuple[float | None, Sequence[Call]]] = []
        for node in plan.nodes:
            inputs = Inputs(node.name)
            for name, where in node.inputs.items():
                inputs[name] = self._bound(scratch, node, name, where)
            out = scratch.signals[node.first : node.first + node.stage.width]
            state = self._states[plan.node_of(node.system) or node]
            before, after = read_only(scratch.before[state]), scratch.after[state]
            arrays = Arrays(inputs, out, before, after)
            outputs, update = node.stage.bind(arrays)
            if outputs is not None:
                scratch.outputs[node.level] += [outputs] if callable(outputs) else outputs
            if update is not None:
                group: Sequence[Call] = [update] if callable(update) else update
                if all(isinstance(call, KernelCall) for call in group):
                    scratch.updates[node.stage.period] += group
                else:
                    others.append((node.stage.period, group))
            if node.stage.begin is not None:
                scratch.begins.append(node.stage.begin(arrays))
        for period, group in others:  # behind all kernels, so that these are neighbours: no update reads another's
            scratch.updates[period] += group
        scratch.outputs = [sequences(calls) for calls in scratch.outputs]
        scratch.updates = {period: sequences(calls) for period, calls in scratch.updates.items()}

    def _bound(self, scratch: Scratch, node: Node, name: str, where: IntArray | int) -> Any:
        """A view of the signals if an input's elements are adjacent; else an array, filled before the stage runs."""
        if isinstance(where, int):
            return scratch.given[where]
        first = int(where[0]) if where.size else 0
        if np.array_equal(where, np.arange(first, first + where.size)):
            return read_only(scratch.signals[first : first + where.size])
        copy = np.zeros(where.size)
        gather = gathering(scratch.signals, where, copy)
        if name in node.stage.reads:
            scratch.outputs[node.level].append(gather)
        else:
            scratch.updates[node.stage.period].append(gather)
            scratch.begins.append(gather)
        return read_only(copy.view())


def _by_period(nodes: list[Node]) -> list[Node]:
    """Sorted by period, those without state last."""
    return sorted(nodes, key=lambda node: np.inf if node.stage.period is None else node.stage.period)
