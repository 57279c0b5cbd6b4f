"""Block graphs of Drake diagrams, to look at and for programs: SVG, DOT, Mermaid and JSON.

    graph = block_graph(diagram)
    graph.to_svg()

A notebook shows a BlockGraph as its SVG.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import Any

from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Diagram, InputPortIndex, OutputPortIndex, PortDataType

from drake_tc.array_stage import INNER_STAGES, InnerStage
from drake_tc.errors import ParamsError
from drake_tc.report.block_graph.pictures import dot, graph_json, mermaid, svg
from drake_tc.report.block_graph.view import (
    TAG,
    VECTOR,
    Block,
    Candidate,
    Edge,
    GraphData,
    Port,
    Terminal,
    Update,
    assign_stages,
    certain_stage,
    view,
)

End = tuple[str, int]
"""Path of a block, and the index of one of its ports."""


def _with_inner_stages(graph: GraphData, inner: Mapping[str, Sequence[InnerStage]]) -> "BlockGraph":
    """The graph with the systems at some paths opened into their inner stages."""
    own = {block.path: block for block in graph.blocks}
    opened = {path: _Inside(own[path], stages) for path, stages in inner.items()}
    blocks: list[Block] = []
    for block in graph.blocks:
        blocks += opened[block.path].blocks() if block.path in opened else [block]
    edges = [part for edge in graph.edges for part in _carried(edge, opened)]
    edges += [edge for inside in opened.values() for edge in inside.edges()]
    return BlockGraph(
        graph.name,
        tuple(blocks),
        tuple(edges),
        tuple(Terminal(t.port, tuple(e for end in t.ends for e in _readers(end, opened))) for t in graph.inputs),
        tuple(Terminal(t.port, tuple(_writer(end, opened) for end in t.ends)) for t in graph.outputs),
    )


class _Inside:
    """The stages inside one block, and where its ports are found among them."""

    def __init__(self, block: Block, stages: Sequence[InnerStage]) -> None:
        self._block, self._stages = block, stages
        self.outputs = {f"{s.name}.{port}": (s, i) for s in stages for i, port in enumerate(s.outputs)}
        self._inputs = {port.name: port for port in block.inputs}
        self._made = {port.name: port for port in block.outputs}
        read = {source for s in stages for source in s.inputs.values()}
        made = {port for s in stages for port in s.outputs}
        if unknown := sorted(read - {*self._inputs, *self.outputs}):
            raise ParamsError(f"inner stages of {block.path!r}: nothing is called {unknown[0]!r}")
        if lost := [name for name in self._inputs if name not in read] + [n for n in self._made if n not in made]:
            raise ParamsError(f"inner stages of {block.path!r}: port {lost[0]!r} belongs to no stage")

    def blocks(self) -> Iterator[Block]:
        """One block for each stage; every output follows every input."""
        block = self._block
        for s in self._stages:
            inputs = tuple(self._input(name, source) for name, source in s.inputs.items())
            outputs = tuple(self._made.get(name, Port(name, 0, carries)) for name, carries in s.outputs.items())
            pairs = tuple((i, o) for i in range(len(inputs)) for o in range(len(outputs)))
            update = block.update if any(port.name in self._made for port in outputs) else None
            yield Block(self._path(s), s.name, s.kind, block.stage, inputs, outputs, pairs, update)

    def edges(self) -> Iterator[Edge]:
        """The connections between the stages."""
        for s in self._stages:
            for i, source in enumerate(s.inputs.values()):
                if source in self.outputs:
                    of, output = self.outputs[source]
                    port = self._input("", source)
                    yield Edge(self._path(of), output, self._path(s), i, port.size, port.type)

    def readers(self, port: int) -> list[End]:
        """The inputs of stages that read an input port of the system."""
        name = self._block.inputs[port].name
        return [
            (self._path(s), i) for s in self._stages for i, source in enumerate(s.inputs.values()) if source == name
        ]

    def writer(self, port: int) -> End:
        """The output of a stage that is an output port of the system."""
        name = self._block.outputs[port].name
        return next((self._path(s), i) for s, i in self.outputs.values() if list(s.outputs)[i] == name)

    def _input(self, name: str, source: str) -> Port:
        if source in self._inputs:
            return replace(self._inputs[source], name=name)
        stage, index = self.outputs[source]
        output, carries = list(stage.outputs.items())[index]
        made = self._made.get(output)
        return Port(name, made.size if made else 0, made.type if made else carries)

    def _path(self, stage: InnerStage) -> str:
        return f"{self._block.path}::{stage.name}"


def _carried(edge: Edge, opened: Mapping[str, _Inside]) -> Iterator[Edge]:
    source, output = _writer((edge.source, edge.output), opened)
    for target, port in _readers((edge.target, edge.input), opened):
        yield replace(edge, source=source, output=output, target=target, input=port)


def _readers(end: End, opened: Mapping[str, _Inside]) -> list[End]:
    return opened[end[0]].readers(end[1]) if end[0] in opened else [end]


def _writer(end: End, opened: Mapping[str, _Inside]) -> End:
    return opened[end[0]].writer(end[1]) if end[0] in opened else end


_UNNAMED = re.compile(r"@[0-9a-f]{8,}$")
"""Drake names a system without a name after its address, which is another one each time."""


@dataclass(frozen=True)
class BlockGraph(GraphData):
    """A diagram as blocks and edges, and its pictures; the same diagram gives the same bytes.

    The pictures leave out logs, signals that only logs read and ports that nothing is connected to, unless
    `everything` is set; `to_json` always holds all.
    """

    def to_json(self) -> str:
        """All blocks, ports, connections and exported ports as JSON; see `to_json`."""
        return graph_json(self)

    def to_svg(self, *, everything: bool = False) -> str:
        """One `<svg>` document on a background of its own, light or dark as the viewer asks."""
        return svg(view(self, everything=everything))

    def to_dot(self, *, everything: bool = False) -> str:
        """Graphviz: a cluster for each stage, records with named ports."""
        return dot(view(self, everything=everything))

    def to_mermaid(self, *, everything: bool = False) -> str:
        """A Mermaid flowchart: a subgraph for each stage, edges labelled with ports and widths."""
        return mermaid(view(self, everything=everything))

    def _repr_svg_(self) -> str:
        return self.to_svg()


def block_graph(diagram: Diagram, stages: Mapping[str, str] | None = None, depth: int | None = 1) -> BlockGraph:
    """The block graph of a diagram; a system with inner stages is shown by these.

    Args:
        diagram: Any Drake Diagram.
        stages: Path, name or class of a block to its stage, where the choice is to be another.
        depth: 1 shows the diagram's own systems, 2 also what stands in nested diagrams, …; None opens all.

    Raises:
        ParamsError: not a Diagram, a depth below 1, a stage or block that there is not.

    Example:
        >>> robot = load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")
        >>> builder = DiagramBuilder()
        >>> loop = add_torque_loop(builder, add_robot_plant(builder, robot), robot, load_models(robot.actuators))
        >>> "torque_control" in block_graph(builder.Build()).to_mermaid()
        True
    """
    if not isinstance(diagram, Diagram):
        raise ParamsError(f"expected a Drake Diagram, got {type(diagram).__name__}")
    if depth is not None and depth < 1:
        raise ParamsError(f"expected a depth of at least 1, got {depth}")
    ends = _Ends({place.system: place for place in _places(diagram, "", depth)})
    leaves = ends.leaves()
    edges = tuple(_edges(diagram, ends))
    links = [(edge.source, edge.target) for edge in edges]
    found = assign_stages([_candidate(leaf) for leaf in leaves], links, stages or {})
    carried = {(edge.target, edge.input): edge.type for edge in edges}
    blocks = tuple(_block(leaf, found[leaf.path], carried) for leaf in leaves)
    inputs = [(diagram.get_input_port(i), ends.targets(diagram, i)) for i in range(diagram.num_input_ports())]
    outputs = [(diagram.get_output_port(i), (ends.source(diagram, i),)) for i in range(diagram.num_output_ports())]
    graph = GraphData(
        "diagram" if _UNNAMED.search(diagram.get_name()) else diagram.get_name() or "diagram",
        blocks,
        edges,
        tuple(Terminal(Port(p.get_name(), p.size(), _input_type(p)), to) for p, to in inputs),
        tuple(Terminal(Port(p.get_name(), p.size(), _output_type(p)), of) for p, of in outputs),
    )
    named = {leaf.path: tuple(getattr(leaf.system, INNER_STAGES, ())) for leaf in leaves}
    return _with_inner_stages(graph, {path: inside for path, inside in named.items() if inside})


@dataclass(frozen=True)
class _Place:
    """A system in the tree: its path and name, and whether its parts stand in its place."""

    system: Any
    path: str
    name: str
    is_open: bool


class _Ends:
    """Follows ports of opened diagrams to the blocks behind them."""

    def __init__(self, places: Mapping[Any, _Place]) -> None:
        self._places = places

    def leaves(self) -> list[_Place]:
        """The systems that are blocks, in the diagram's order."""
        return [place for place in self._places.values() if not place.is_open]

    def is_open(self, system: Any) -> bool:
        """Whether the system's parts stand in its place; the top diagram's always do."""
        return system not in self._places or self._places[system].is_open

    def source(self, system: Any, output: int) -> tuple[str, int]:
        """Path and output index of the block that computes a port."""
        if not self.is_open(system):
            return self._places[system].path, output
        inner, port = system.get_output_port_locator(OutputPortIndex(output))
        return self.source(inner, int(port))

    def targets(self, system: Any, port: int) -> tuple[tuple[str, int], ...]:
        """Path and input index of every block that reads a port."""
        if not self.is_open(system):
            return ((self._places[system].path, port),)
        inner = system.GetInputPortLocators(InputPortIndex(port))
        return tuple(end for child, i in inner for end in self.targets(child, int(i)))


def _places(diagram: Diagram, above: str, depth: int | None) -> Iterator[_Place]:
    """Every system down to the depth; paths are joined by "::", as Drake does."""
    children: list[Any] = diagram.GetSystems()
    for child, name in zip(children, _names(children), strict=True):
        is_open = isinstance(child, Diagram) and depth != 1
        yield _Place(child, f"{above}{name}", name, is_open)
        if is_open:
            yield from _places(child, f"{above}{name}::", None if depth is None else depth - 1)


def _names(systems: list[Any]) -> list[str]:
    """Their names; one that has none is called after its class and counted."""
    taken = {system.get_name() for system in systems}
    names = []
    for system in systems:
        name = system.get_name()
        if _UNNAMED.search(name):
            name = next(n for i in count(1) if (n := f"{_kind(system)}_{i}") not in taken)
            taken.add(name)
        names.append(name)
    return names


def _edges(diagram: Diagram, ends: _Ends) -> Iterator[Edge]:
    """Connections of a diagram and of those opened in it, by target in the diagram's order."""
    order = {system: i for i, system in enumerate(diagram.GetSystems())}
    connections = sorted(diagram.connection_map().items(), key=lambda c: (order[c[0][0]], int(c[0][1])))
    for (target, port), (source, output) in connections:
        of = source.get_output_port(output)
        size, carried = of.size(), _output_type(of)
        path, index = ends.source(source, int(output))
        for end, entry in ends.targets(target, int(port)):
            yield Edge(path, index, end, entry, size, carried)
    for child in diagram.GetSystems():
        if isinstance(child, Diagram) and ends.is_open(child):
            yield from _edges(child, ends)


def _candidate(place: _Place) -> Candidate:
    system = place.system
    parts: tuple[str, ...] = ()
    if isinstance(system, Diagram):
        diagram: Any = system
        inside = (certain_stage(_candidate(part)) for part in _places(diagram, "", 1))
        parts = tuple(stage for stage in inside if stage)
    return Candidate(
        place.path,
        place.name,
        _kind(system),
        type(system).__module__,
        system.num_input_ports() == 0,
        system.num_output_ports() == 0,
        getattr(system, TAG, None),
        parts,
    )


def _block(place: _Place, stage: str, carried: Mapping[tuple[str, int], str]) -> Block:
    system = place.system
    inputs = [system.get_input_port(i) for i in range(system.num_input_ports())]
    outputs = [system.get_output_port(i) for i in range(system.num_output_ports())]
    pairs = [(i, o) for i in range(len(inputs)) for o in range(len(outputs)) if system.HasDirectFeedthrough(i, o)]
    types = [carried.get((place.path, i), _input_type(p)) for i, p in enumerate(inputs)]
    return Block(
        place.path,
        place.name,
        _kind(system),
        stage,
        tuple(Port(p.get_name(), p.size(), carries) for p, carries in zip(inputs, types, strict=True)),
        tuple(Port(p.get_name(), p.size(), _output_type(p)) for p in outputs),
        tuple(pairs),
        _update(system),
    )


def _kind(system: Any) -> str:
    """The class without its scalar type, as Python or, for a class Python does not know, C++ names it."""
    own = type(system).__name__.partition("𝓣")[0]
    if own in ("LeafSystem", "System"):
        own = re.sub(r"<.*", "", system.GetSystemType()).rpartition("::")[2]
    return own or "LeafSystem"


def _update(system: Any) -> Update | None:
    unique = system.GetUniquePeriodicDiscreteUpdateAttribute()
    if unique is not None:
        return Update(unique.period_sec(), unique.offset_sec())
    if isinstance(system, MultibodyPlant) and system.time_step() > 0.0:
        return Update(system.time_step(), 0.0)
    return None


def _is_vector(port: Any) -> bool:
    return bool(port.get_data_type() == PortDataType.kVectorValued)


def _input_type(port: Any) -> str:
    return VECTOR if _is_vector(port) else "abstract"


def _output_type(port: Any) -> str:
    """`vector`, or the abstract value's type: `RigidTransform`, and the like."""
    if _is_vector(port):
        return VECTOR
    held = type(port.Allocate()).__name__
    return held.removeprefix("Value").replace("𝓣", "[").replace("𝓤", "]")[1:-1] or "object"
