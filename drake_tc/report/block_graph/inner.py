"""Blocks for the stages inside a system (`drake_tc.inner_stages`), in place of the system's own block."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from drake_tc.errors import ParamsError
from drake_tc.inner_stages import InnerStage
from drake_tc.report.block_graph.data import Block, Edge, GraphData, Port, Terminal

End = tuple[str, int]
"""Path of a block, and the index of one of its ports."""


def with_inner_stages(graph: GraphData, inner: Mapping[str, Sequence[InnerStage]]) -> GraphData:
    """The graph with the systems at some paths opened into their inner stages.

    Args:
        graph: Systems as blocks.
        inner: Path of a block to the stages inside.

    Raises:
        ParamsError: A stage reads what there is not, or a port of the system belongs to no stage.
    """
    own = {block.path: block for block in graph.blocks}
    opened = {path: _Inside(own[path], stages) for path, stages in inner.items()}
    blocks = [part for block in graph.blocks for part in _parts(block, opened)]
    edges = [part for edge in graph.edges for part in _carried(edge, opened)]
    edges += [edge for inside in opened.values() for edge in inside.edges()]
    return GraphData(
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


def _parts(block: Block, opened: Mapping[str, _Inside]) -> Iterator[Block]:
    if block.path in opened:
        yield from opened[block.path].blocks()
    else:
        yield block


def _carried(edge: Edge, opened: Mapping[str, _Inside]) -> Iterator[Edge]:
    source, output = _writer((edge.source, edge.output), opened)
    for target, port in _readers((edge.target, edge.input), opened):
        yield replace(edge, source=source, output=output, target=target, input=port)


def _readers(end: End, opened: Mapping[str, _Inside]) -> list[End]:
    return opened[end[0]].readers(end[1]) if end[0] in opened else [end]


def _writer(end: End, opened: Mapping[str, _Inside]) -> End:
    return opened[end[0]].writer(end[1]) if end[0] in opened else end
