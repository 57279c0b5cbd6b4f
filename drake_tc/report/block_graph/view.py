"""What a block graph says, and what a picture of it shows: blocks with the pins in use, and nets, one for each output.

In pictures, a port that Drake calls `y0` or `u0` is called after what it is connected to. An only output is called as
its block, another one as the input that it feeds, where all inputs that have a name agree; an input as the output that
feeds it. A port whose wires know no name keeps Drake's.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

STAGES = (
    "reference",
    "control",
    "actuation",
    "plant",
    "sensing",
    "filtering",
    "estimation",
    "supervision",
    "logging",
)
"""The stages of a control loop, in the order in which a signal passes them."""

VECTOR = "vector"
"""`type` of a port or edge that carries a vector; others name the type of their abstract value."""


@dataclass(frozen=True)
class Port:
    """One port of a block: its name, how many numbers it carries (0: abstract), and what it carries."""

    name: str
    size: int
    type: str


@dataclass(frozen=True)
class Update:
    """A periodic discrete update: period and offset [s]."""

    period: float
    offset: float


@dataclass(frozen=True)
class Block:
    """One system of the diagram.

    Attributes:
        path: Names from the top diagram's children down to this system, joined by "::"; unique.
        name: The system's own name.
        kind: Its class.
        stage: One of STAGES.
        inputs: Input ports by index.
        outputs: Output ports by index.
        feedthrough: (input, output) indices where the output follows the input at the same instant.
        update: Its unique periodic discrete update; None where there is none, or more than one.
    """

    path: str
    name: str
    kind: str
    stage: str
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    feedthrough: tuple[tuple[int, int], ...]
    update: Update | None


@dataclass(frozen=True)
class Edge:
    """A connection from the output port of one block (path, index) to the input port of another."""

    source: str
    output: int
    target: str
    input: int
    size: int
    type: str


@dataclass(frozen=True)
class Terminal:
    """A port of the whole diagram, and the (path, index) of the blocks' ports that it stands for."""

    port: Port
    ends: tuple[tuple[str, int], ...]


@dataclass(frozen=True)
class GraphData:
    """A diagram as plain data: blocks and edges in the diagram's own order, and its exported ports."""

    name: str
    blocks: tuple[Block, ...]
    edges: tuple[Edge, ...]
    inputs: tuple[Terminal, ...]
    outputs: tuple[Terminal, ...]


_DEFAULT = re.compile(r"[uy]\d+")
"""Names that Drake gives to ports without one."""

PortNames = Mapping[tuple[str, int], str]
"""Path of a block and index of its port to the port's name in a picture."""


def _port_names(graph: GraphData) -> tuple[PortNames, PortNames]:
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


INPUTS, OUTPUTS = "inputs", "outputs"
SHOWN_STAGES = (INPUTS, *STAGES[:4], OUTPUTS, *STAGES[4:])
"""Stages in a picture: the diagram's own ports stand beside the loop."""


@dataclass(frozen=True)
class Pin:
    """A port in a picture.

    Attributes:
        index: In its block.
        name: As Drake has it, or what `_port_names` knows for it.
        follows: Of an output: whether it follows an input at the same instant, or has none to follow.
        used: Whether anything shown is connected to it.
    """

    index: int
    name: str
    follows: bool = True
    used: bool = True


@dataclass(frozen=True)
class Shape:
    """A block in a picture: number, title, lines below it, stage, pins, and whether it is of less interest."""

    key: int
    title: str
    notes: tuple[str, ...]
    stage: str
    inputs: tuple[Pin, ...]
    outputs: tuple[Pin, ...]
    dim: bool = False


@dataclass(frozen=True)
class Net:
    """One signal: (block, pin index) it comes from, those it goes to, how wide it is, whether only logs read it."""

    source: tuple[int, int]
    targets: tuple[tuple[int, int], ...]
    label: str
    dim: bool


@dataclass(frozen=True)
class View:
    """A picture's content: title, shapes by number, nets."""

    title: str
    shapes: tuple[Shape, ...]
    nets: tuple[Net, ...]


def view(graph: GraphData, *, everything: bool = False) -> View:
    """What to show of a graph; `everything` adds logs, systems that only logs read, and unconnected ports."""
    shown = list(graph.blocks) if everything else _without_logs(graph)
    number = {block.path: i for i, block in enumerate(shown)}
    links: list[tuple[tuple[int, int], tuple[int, int], Port]] = []
    for e in graph.edges:
        if e.source in number and e.target in number:
            port = Port("", e.size, e.type)
            links.append(((number[e.source], e.output), (number[e.target], e.input), port))
    terminals: list[Shape] = []
    for kind, ports in ((INPUTS, graph.inputs), (OUTPUTS, graph.outputs)):
        for terminal in ports:
            ends = [(number[path], index) for path, index in terminal.ends if path in number]
            if not ends:
                continue
            key, pin = len(shown) + len(terminals), (Pin(0, ""),)
            pins = ((), pin) if kind == INPUTS else (pin, ())
            terminals.append(Shape(key, terminal.port.name, (), kind, *pins))
            links += [((key, 0), e, terminal.port) if kind == INPUTS else (e, (key, 0), terminal.port) for e in ends]
    names = _port_names(graph)
    blocks = tuple(
        _shape(
            number[b.path],
            b,
            (
                {i for _, (key, i), _ in links if key == number[b.path]},
                {o for (key, o), _, _ in links if key == number[b.path]},
            ),
            names,
            everything=everything,
        )
        for b in shown
    )
    shapes = blocks + tuple(terminals)
    return View(graph.name, shapes, _nets(shapes, links))


def _without_logs(graph: GraphData) -> list[Block]:
    """The blocks but for logs and systems that only logs read, directly or through others; a plant always stays."""
    systems = [b for b in graph.blocks if b.stage != "logging"]
    exported = {path for terminal in graph.outputs for path, _ in terminal.ends}
    kept = {b.path for b in systems}
    stays = exported | {b.path for b in systems if b.stage in ("plant", "supervision")}
    read: dict[str, set[str]] = {}
    for edge in graph.edges:
        read.setdefault(edge.source, set()).add(edge.target)
    while dropped := {path for path in kept - stays if path in read and not read[path] & (kept - {path})}:
        kept -= dropped
    return [b for b in systems if b.path in kept] or systems


def _shape(
    key: int,
    block: Block,
    connected: tuple[set[int], set[int]],
    names: tuple[PortNames, PortNames],
    *,
    everything: bool,
) -> Shape:
    follows = {output for _, output in block.feedthrough} if block.inputs else set(range(len(block.outputs)))
    into, out = (
        [
            (i, named.get((block.path, i), port.name), i in used)
            for i, port in enumerate(ports)
            if everything or i in used
        ]
        for named, ports, used in zip(names, (block.inputs, block.outputs), connected, strict=True)
    )
    inputs = [Pin(i, name, used=used) for i, name, used in into]
    outputs = [Pin(i, name, i in follows, used) for i, name, used in out]
    title = block.path.replace("::", " / ")
    notes = [] if block.kind == block.name.rstrip("_0123456789") else [block.kind]
    if block.update is not None:
        notes.append(f"every {_seconds(block.update.period)}")
    return Shape(key, title, tuple(notes), block.stage, tuple(inputs), tuple(outputs), block.stage == "logging")


def _nets(shapes: tuple[Shape, ...], links: Iterable[tuple[tuple[int, int], tuple[int, int], Port]]) -> tuple[Net, ...]:
    targets: dict[tuple[int, int], list[tuple[int, int]]] = {}
    carried: dict[tuple[int, int], Port] = {}
    for source, target, port in links:
        targets.setdefault(source, []).append(target)
        carried[source] = port
    return tuple(
        Net(source, tuple(sorted(ends)), _width_of(carried[source]), all(shapes[key].dim for key, _ in ends))
        for source, ends in sorted(targets.items())
    )


def _width_of(port: Port) -> str:
    """How wide a signal is: the number of its elements, or the type of its abstract value (`T[]` for a list of T)."""
    if port.type == VECTOR:
        return str(port.size)
    name = port.type
    while name.startswith("list[") and name.endswith("]"):
        name = f"{name[5:-1]}[]"
    return name


def _seconds(period: float) -> str:
    return f"{1e3 * period:.4g} ms" if period < 1.0 else f"{period:.4g} s"
