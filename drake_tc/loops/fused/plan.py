"""`Plan`: which stages run in which order, on which elements of one array of signals.

Blocks of Drake's own between the stages, which pick, join, add or multiply signals.

`Node`, `Given`: what a plan computes, and what it reads from outside.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pydrake.systems.framework import OutputPort, PortDataType, System
from pydrake.systems.primitives import Adder, Demultiplexer, MatrixGain, Multiplexer, Selector

from drake_tc.array_stage import Arrays, ArrayStage
from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import ADD, MULTIPLY, KernelCall
from drake_tc.types import Call, FloatArray, IntArray

PICKING = (Multiplexer, Demultiplexer, Selector)
"""Blocks whose outputs are some of their inputs' elements."""
GLUE = (*PICKING, MatrixGain, Adder)


def picked_elements(system: Any) -> list[IntArray] | None:
    """For each output port, the indices of its elements among all inputs, stacked; None if the block computes.

    A MatrixGain computes even where its matrix only selects: 0 times NaN is NaN.
    """
    if not isinstance(system, PICKING):
        return None
    context, first = system.CreateDefaultContext(), 0
    for index in range(system.num_input_ports()):
        port: Any = system.get_input_port(index)
        port.FixValue(context, np.arange(first, first + port.size(), dtype=np.float64))
        first += port.size()
    outputs = (system.get_output_port(index) for index in range(system.num_output_ports()))
    return [np.asarray(output.Eval(context)).astype(np.intp) for output in outputs]


def computed(system: Any) -> ArrayStage:
    """The stage of an Adder or a MatrixGain."""
    count, output = system.num_input_ports(), system.get_output_port(0)
    names = [system.get_input_port(index).get_name() for index in range(count)]
    matrix = np.ascontiguousarray(system.D()) if isinstance(system, MatrixGain) else None

    def bind(arrays: Arrays) -> tuple[Call, None]:
        terms, out = [arrays.inputs[name] for name in names], arrays.out
        return (_sum_of(terms, out) if matrix is None else _product_of(matrix, terms[0], out)), None

    width = output.size()
    return ArrayStage(width, {output.get_name(): np.arange(width)}, bind, frozenset(names))


def _sum_of(terms: Sequence[FloatArray], out: FloatArray) -> Call:
    """Sum from the first term on, as Drake's Adder does."""
    first, second, *others = terms if len(terms) > 1 else (terms[0], np.zeros(out.size))

    def outputs(time: float) -> None:
        np.add(first, second, out)
        for term in others:
            np.add(out, term, out)

    return outputs if others else KernelCall(ADD, outputs, first, second, out)


def _product_of(matrix: FloatArray, factor: FloatArray, out: FloatArray) -> Call:
    def outputs(time: float) -> None:
        out[:] = 0.0  # column by column, as Drake and the kernel: another order of the sum gives other last bits
        for j in range(factor.size):
            np.add(out, matrix[:, j] * factor[j], out)

    return KernelCall(MULTIPLY, outputs, matrix, factor, out)


Source = tuple[System, int]
"""An output port: its system and index."""
Connections = Mapping[tuple[System, int], Source]
"""Input port (system, index) to its source."""


@dataclass(eq=False)
class Node:
    """A stage, or the early outputs of one, in the plan.

    Attributes:
        system: Its system.
        stage: Its calculations.
        first: Index of its first output among the signals.
        inputs: Input port to the elements that it reads, or to the number of an abstract input of the plan.
        level: When its outputs are computed, see `Plan`.
    """

    system: System
    stage: ArrayStage
    first: int
    inputs: dict[str, IntArray | int] = field(default_factory=dict)
    level: int = 0

    @property
    def name(self) -> str:
        """Of its system."""
        return str(self.system.get_name())


@dataclass(eq=False)
class Given:
    """An output port outside that stages read.

    Attributes:
        port: The port.
        elements: Where its value is kept among the signals; None where it is abstract.
        level: The first level at which it can be read.
    """

    port: OutputPort
    elements: IntArray | None
    level: int = 0


def name_of(source: Source) -> str:
    """SYSTEM.PORT of an output port."""
    return f"{source[0].get_name()}.{source[0].get_output_port(source[1]).get_name()}"


class AlgebraicLoopError(ParamsError):
    """A stage depends on its own output within a tick."""


class Plan:
    """Stages and the blocks between them, in the order of their calculation.

    Signals of level 0 depend on the state, and on inputs from outside that do not depend on any fused stage in the same
    tick. Signals of level k + 1 depend also on inputs from outside that depend on signals of level k, as a plant's
    accelerations depend on its torques.

    Attributes:
        nodes: In the order in which their outputs are computed.
        given: Output ports outside that are read.
        size: Number of signals.
        exported: Output port that is read outside, to its elements among the signals.
        export_level: Output port that is read outside, to its level.
        num_levels: Number of levels, of nodes and of what is read outside.
    """

    def __init__(self, stages: Mapping[System, ArrayStage], connections: Connections) -> None:
        """Sort the stages.

        Args:
            stages: Systems to their calculations.
            connections: Connections of the diagram before the stages are removed.

        Raises:
            AlgebraicLoopError: A stage depends on its own output within a tick.
        """
        self._connections, self._stages = connections, dict(stages)
        self._glue = _glue_between(stages, connections)
        self.fused: set[System] = {*stages, *self._glue}
        self.nodes: list[Node] = []
        self.given: list[Given] = []
        self.size = 0
        self._node_of: dict[ArrayStage, Node] = {}
        self._given_of: dict[Source, int] = {}
        self._open: set[ArrayStage] = set()
        self._closed = False
        readers = {
            source: None
            for (system, _), source in connections.items()
            if source[0] in self.fused and system not in self.fused
        }
        for system, stage in stages.items():
            if stage.period is not None:
                self._place(system, stage)
        self.exported: dict[Source, IntArray] = {}
        for source in readers:
            self.exported[source] = np.asarray(self._elements(source))  # no stage has an abstract output
        self._closed = True
        self._set_levels()

    def _signals(self, count: int) -> IntArray:
        """That many new elements."""
        self.size += count
        return np.arange(self.size - count, self.size)

    def _elements(self, source: Source) -> IntArray | int:
        """Where the value of an output port stands, or the number of an abstract one."""
        system, index = source
        if system not in self.fused:
            return self._read(source)
        chosen = self._glue.get(system)
        if chosen is None:
            node, name = self._node_with(source), system.get_output_port(index).get_name()
            return node.first + node.stage.ports[name]
        sources = [self._connections[system, each] for each in range(system.num_input_ports())]
        return np.concatenate([self._elements(each) for each in sources])[chosen[index]]

    def _read(self, source: Source) -> IntArray | int:
        number = self._given_of.get(source)
        if number is None:
            self._require_open(source)
            port = source[0].get_output_port(source[1])
            vector = port.get_data_type() == PortDataType.kVectorValued
            number = self._given_of[source] = len(self.given)
            self.given.append(Given(port, self._signals(port.size()) if vector else None))
        elements = self.given[number].elements
        return number if elements is None else elements

    def _node_with(self, source: Source) -> Node:
        """The node that computes an output port of a stage or of a block that computes."""
        system, index = source
        if system not in self._stages:
            self._stages[system] = computed(system)
        part = self._stages[system].part_with(system.get_output_port(index).get_name())
        if part is None or part not in self._node_of:
            self._require_open(source)
        if part is None:
            raise KeyError(f"{name_of(source)} is not available on arrays")
        return self._place(system, part)

    def _require_open(self, source: Source) -> None:
        """Refuse to add a port to a plan that is complete."""
        if self._closed:
            raise ParamsError(f"fuse: {name_of(source)} is not computed, as nothing reads it")

    def _place(self, system: System, stage: ArrayStage) -> Node:
        """The node of a stage, or of its early outputs, behind those whose outputs its own depend on."""
        if stage in self._node_of:
            return self._node_of[stage]
        if stage in self._open:
            raise AlgebraicLoopError(f"fuse: {system.get_name()!r} depends on its own output within a tick")
        self._open.add(stage)
        inputs = {name: source for name, source in self._sources(system).items() if name in stage.inputs}
        before = {name: self._elements(source) for name, source in inputs.items() if name in stage.reads}
        node = Node(system, stage, int(self._signals(stage.width)[0]), before)
        self._node_of[stage] = node
        self.nodes.append(node)
        late = {name: source for name, source in inputs.items() if name in stage.updates - stage.reads}
        node.inputs |= {name: self._elements(source) for name, source in late.items()}
        return node

    def node_of(self, system: System) -> Node | None:
        """The node with the state of a stage; None where the system is none of the stages."""
        stage = self._stages.get(system)
        return None if stage is None else self._node_of.get(stage)

    def elements(self, port: OutputPort) -> IntArray:
        """Where the value of an output port of a fused system stands.

        Raises:
            ParamsError: Nothing reads the port, so that it is not computed.
        """
        system: Any = port.get_system()
        return self._vector_at((system, int(port.get_index())))

    def input_elements(self, system: System, name: str) -> IntArray:
        """Where the value of an input port of a fused system stands.

        Raises:
            ParamsError: The port is not connected, not used, or abstract.
        """
        source = self._sources(system).get(name)
        if source is None:
            raise ParamsError(f"fuse: input port {name!r} of {system.get_name()!r} is not connected")
        return self._vector_at(source)

    def _vector_at(self, source: Source) -> IntArray:
        found = self._elements(source)
        if isinstance(found, int):
            raise ParamsError(f"fuse: {name_of(source)} is abstract; expected a vector port")
        return found

    def _sources(self, system: System) -> dict[str, Source]:
        """Connected input port to its source."""
        ports = {index: system.get_input_port(index).get_name() for index in range(system.num_input_ports())}
        return {
            name: self._connections[system, index]
            for index, name in ports.items()
            if (system, index) in self._connections
        }

    def _set_levels(self) -> None:
        """Levels of nodes and of what is given, until none is too low."""
        of_element = np.zeros(self.size, dtype=np.intp)
        causes = [self._fused_causes(source, set()) for source in self._given_of]
        changed = True
        while changed:
            changed = False
            for given, sources in zip(self.given, causes, strict=True):
                behind = [self._level(of_element, self._elements(source)) for source in sources]
                level = 1 + max(behind, default=-1)
                if level > len(self.given):  # each level needs another input from outside
                    port: Any = given.port
                    name = name_of((port.get_system(), port.get_index()))
                    raise AlgebraicLoopError(
                        f"fuse: {name} depends on itself within a tick, through stages that read it"
                    )
                if level > given.level:
                    given.level, changed = level, True
                if given.elements is not None:
                    of_element[given.elements] = given.level
            for node in self.nodes:
                read = [self._level(of_element, node.inputs[name]) for name in node.stage.reads if name in node.inputs]
                level = max(read, default=0)
                if level > node.level:
                    node.level, changed = level, True
                of_element[node.first : node.first + node.stage.width] = node.level
        self.nodes.sort(key=lambda node: node.level)  # stable: within a level the order stays
        self.export_level = {source: self._level(of_element, elements) for source, elements in self.exported.items()}
        levels = [*(node.level for node in self.nodes), *self.export_level.values()]
        self.num_levels = 1 + max(levels, default=0)
        self.read_now = self._read_now()

    def _level(self, of_element: IntArray, elements: IntArray | int) -> int:
        if isinstance(elements, int):
            return self.given[elements].level
        return int(of_element[elements].max(initial=0))

    def _read_now(self) -> frozenset[int]:
        """Numbers of what is given that outputs depend on; the others are read in updates alone."""
        wanted = np.zeros(self.size, dtype=bool)
        numbers = set()
        read = [node.inputs[name] for node in self.nodes for name in node.stage.reads if name in node.inputs]
        for elements in (*read, *self.exported.values()):
            if isinstance(elements, int):
                numbers.add(elements)
            else:
                wanted[elements] = True
        for number, given in enumerate(self.given):
            if given.elements is not None and wanted[given.elements].any():
                numbers.add(number)
        return frozenset(numbers)

    def _fused_causes(self, source: Source, seen: set[Source]) -> set[Source]:
        """The outputs of fused systems on which an output port outside depends within a tick."""
        if source in seen:
            return set()
        seen.add(source)
        system, index = source
        found: set[Source] = set()
        for entering in range(system.num_input_ports()):
            before = self._connections.get((system, entering))
            if before is None or not system.HasDirectFeedthrough(entering, index):
                continue
            found |= {before} if before[0] in self.fused else self._fused_causes(before, seen)
        return found


def _glue_between(stages: Collection[System], connections: Connections) -> dict[System, list[IntArray] | None]:
    """The blocks that stages read, or that read stages alone; each with the elements that it picks, see `glue`."""
    found: dict[System, list[IntArray] | None] = {}
    blocks = {system for pair in connections.items() for (system, _) in pair if isinstance(system, GLUE)}
    blocks = {system for system in blocks if _complete(system, connections)}
    while True:
        inside = {*stages, *found}
        read = {source for (system, _), (source, _) in connections.items() if system in inside}
        outside = {system for (system, _), (source, _) in connections.items() if source not in inside}
        more = {system for system in blocks - inside if system in read or system not in outside}
        if not more:
            return found
        found |= {system: picked_elements(system) for system in more}


def _complete(system: System, connections: Connections) -> bool:
    """Whether every input port is connected."""
    return all((system, index) in connections for index in range(system.num_input_ports()))
