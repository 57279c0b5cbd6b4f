"""Names of ports in pictures: what Drake calls `y0` and `u0` is called after what it is connected to.

An only output is called as its block, another one as the input that it feeds, where all inputs that have a name agree;
an input as the output that feeds it. A port whose wires know no name keeps Drake's.
"""

import re
from collections.abc import Iterator, Mapping

from drake_tc.report.block_graph.data import GraphData

_DEFAULT = re.compile(r"[uy]\d+")
"""Names that Drake gives to ports without one."""

PortNames = Mapping[tuple[str, int], str]
"""Path of a block and index of its port to the port's name in a picture."""


def port_names(graph: GraphData) -> tuple[PortNames, PortNames]:
    """The names of the inputs and of the outputs that have another name than Drake's."""
    outputs = dict(_outputs(graph))
    there = {(block.path, i): port.name for block in graph.blocks for i, port in enumerate(block.outputs)}
    entries = {
        (block.path, i) for block in graph.blocks for i, port in enumerate(block.inputs) if _is_default(port.name)
    }
    inputs = {}
    for edge in graph.edges:
        source, target = (edge.source, edge.output), (edge.target, edge.input)
        name = outputs.get(source, there[source])
        if target in entries and not _is_default(name):
            inputs[target] = name
    return inputs, outputs


def _outputs(graph: GraphData) -> Iterator[tuple[tuple[str, int], str]]:
    there = {(block.path, i): port.name for block in graph.blocks for i, port in enumerate(block.inputs)}
    fed: dict[tuple[str, int], set[str]] = {}
    for edge in graph.edges:
        name = there[edge.target, edge.input]
        if not _is_default(name):
            fed.setdefault((edge.source, edge.output), set()).add(name)
    for block in graph.blocks:
        for index, port in enumerate(block.outputs):
            known = fed.get((block.path, index), set())
            if not _is_default(port.name):
                continue
            if len(block.outputs) == 1:
                yield (block.path, index), block.name
            elif len(known) == 1:
                yield (block.path, index), known.pop()


def _is_default(name: str) -> bool:
    return _DEFAULT.fullmatch(name) is not None
