"""What a block graph says, and what a picture of it shows: blocks with the pins in use, and nets, one for each output.

In pictures, a port that Drake calls `y0` or `u0` is called after what it is connected to. An only output is called as
its block, another one as the input that it feeds, where all inputs that have a name agree; an input as the output that
feeds it. A port whose wires know no name keeps Drake's.

Which stage of the control loop a system belongs to: by its tag, its class, or its neighbours; never by its name.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from drake_tc.errors import ParamsError

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


TAG = "graph_stage"
"""Attribute by which a system names its stage: `graph_stage = "control"` in the class."""
FORWARD = ("reference", "control", "actuation", "plant")
"""Stages of the forward path, in the order of the signals."""

BY_CLASS: Mapping[str, str] = {
    "FaultMonitor": "supervision",
    "StoppingReference": "reference",
    "TrajectorySource": "reference",
    "VectorLogSink": "logging",
    "SceneGraph": "plant",
}
BY_MODULE: Mapping[str, str] = {
    "drake_tc.control": "control",
    "drake_tc.tsid": "control",
    "drake_tc.actuation": "actuation",
    "drake_tc.sensing": "sensing",
    "drake_tc.filtering": "filtering",
    "drake_tc.sensor_validation": "sensing",
    "drake_tc.estimation": "estimation",
    "pydrake.multibody.plant": "plant",
    "pydrake.systems.sensors": "sensing",
    "pydrake.systems.controllers": "control",
    "pydrake.visualization": "logging",
    "pydrake.geometry": "logging",
}
"""The longest module that a system's class lives in, or under, decides."""

_WORDS: Mapping[str, str] = {
    **dict.fromkeys(("reference", "trajectory", "command", "planner", "desired", "setpoint"), "reference"),
    **dict.fromkeys(("control", "controller", "guard", "servo", "pid", "feedforward"), "control"),
    **dict.fromkeys(("actuator", "actuation", "motor", "drive"), "actuation"),
    **dict.fromkeys(("plant",), "plant"),
    **dict.fromkeys(("sensor", "encoder", "imu", "gyro", "gyroscope", "accelerometer", "camera"), "sensing"),
    **dict.fromkeys(("filter", "smoother"), "filtering"),
    **dict.fromkeys(("estimator", "observer", "estimation", "estimate"), "estimation"),
    **dict.fromkeys(("monitor", "supervisor", "supervision", "watchdog"), "supervision"),
    **dict.fromkeys(("log", "logger", "logging", "sink", "recorder", "visualizer", "meshcat"), "logging"),
}
"""The last known word of the name of a class decides: a `TorqueSensorFilter` is a filter."""


@dataclass(frozen=True)
class Candidate:
    """What the choice looks at.

    Attributes:
        path: Path of the system.
        name: Its name, by which `stages` of a block graph may choose it.
        kind: Its class.
        module: Module of the class.
        is_source: It has no inputs.
        is_sink: It has no outputs.
        tag: Stage that it names itself; None: it names none.
        parts: Stages of the systems inside a nested diagram.
    """

    path: str
    name: str
    kind: str
    module: str
    is_source: bool
    is_sink: bool
    tag: str | None = None
    parts: tuple[str, ...] = ()


def _stage_of_class(kind: str) -> str | None:
    """The stage that the CamelCase name of a class speaks of; None where it speaks of none."""
    words = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", kind)
    for word in reversed([w.lower() for w in words]):
        for form in (word, word.removesuffix("s")):
            if form in _WORDS:
                return _WORDS[form]
    return None


def certain_stage(system: Candidate) -> str | None:
    """The stage that the tag, the class or its module settle; None where the neighbours have a say.

    Raises:
        ParamsError: the tag is no stage.
    """
    if system.tag is not None:
        _check_stage(system.path, system.tag)
        return system.tag
    if system.kind in BY_CLASS:
        return BY_CLASS[system.kind]
    homes = [home for home in BY_MODULE if f"{system.module}.".startswith(f"{home}.")]
    if homes:
        return BY_MODULE[max(homes, key=len)]
    return _majority(part for part in system.parts if part != "logging")


PASSING = ("Multiplexer", "Demultiplexer", "Selector")
"""Classes that only put signals together or take them apart."""


def assign_stages(
    systems: Sequence[Candidate], links: Iterable[tuple[str, str]], chosen: Mapping[str, str]
) -> dict[str, str]:
    """The stage of every system.

    Tag, class and module come first, then the words in the name of a class that is not Drake's, unless they speak of
    the feedback path and the system passes signals along the forward path (an `OffsetFilter` between controller and
    guard is control). What is still open takes the stage that all its consumers share (a multiplexer that only logs
    read is one of them), else the one most of its sources have; then a source is a reference, a sink a log, and
    anything else control. The name of a system has no influence.

    Args:
        systems: In the diagram's order.
        links: (source path, target path) of the connections.
        chosen: Path, name or class to stage; comes before everything.

    Raises:
        ParamsError: `chosen` or a tag names no stage, or `chosen` names nothing in the diagram.
    """
    _check(systems, chosen)
    stages: dict[str, str] = {}
    for system in systems:
        keys = (system.path, system.name, system.kind)
        stage = next((chosen[key] for key in keys if key in chosen), None) or certain_stage(system)
        if stage is not None:
            stages[system.path] = stage
    pairs = list(links)
    stages |= _from_words(systems, pairs, stages)
    for _ in systems:
        known = dict(stages)
        for system in systems:
            if system.path not in stages and (near := _from_neighbours(system, pairs, known)):
                stages[system.path] = near
        if len(stages) in (len(known), len(systems)):
            break
    for system in systems:
        fallback = "reference" if system.is_source else "logging" if system.is_sink else "control"
        stages.setdefault(system.path, fallback)
    return stages


def _from_words(
    systems: Sequence[Candidate], links: list[tuple[str, str]], certain: Mapping[str, str]
) -> dict[str, str]:
    """Stages by the names of classes, but for systems of the forward path whose class speaks of another one."""
    words = {s.path: _stage_of_class(s.kind) for s in systems if s.path not in certain}
    own = {s.path for s in systems if not s.module.startswith("pydrake.")}
    spoken = {path: stage for path, stage in words.items() if stage is not None and path in own}
    known = {**spoken, **certain}
    return {path: stage for path, stage in spoken.items() if stage in FORWARD or not _is_forward(path, links, known)}


def _is_forward(path: str, links: list[tuple[str, str]], known: Mapping[str, str]) -> bool:
    """Whether a system reads and feeds stages of the forward path alone, none before one that it reads."""
    before = [known.get(s) for s, t in links if t == path]
    after = [stage for s, t in links if s == path if (stage := known.get(t)) != "logging"]
    if not before or not after or not {*before, *after} <= {*FORWARD}:
        return False
    order = [FORWARD.index(str(stage)) for stage in (*before, *after)]
    return max(order[: len(before)]) <= min(order[len(before) :])


def _from_neighbours(system: Candidate, links: list[tuple[str, str]], known: Mapping[str, str]) -> str | None:
    read = [known.get(t) for s, t in links if s == system.path]
    if system.kind in PASSING and read and set(read) == {"logging"}:
        return "logging"
    after = [known[t] for s, t in links if s == system.path and known.get(t, "logging") != "logging"]
    if len(set(after)) == 1 and not (system.is_source and after[0] == "control"):
        return after[0]
    return _majority(known[s] for s, t in links if t == system.path and s in known)


def _majority(stages: Iterable[str]) -> str | None:
    counts = Counter(stages)
    return max(STAGES, key=lambda s: counts[s]) if counts else None


def _check(systems: Sequence[Candidate], chosen: Mapping[str, str]) -> None:
    here = {key for s in systems for key in (s.path, s.name, s.kind)}
    for key, stage in chosen.items():
        _check_stage(key, stage)
        if key not in here:
            raise ParamsError(f"no block {key!r} to put into {stage}; blocks: {', '.join(s.path for s in systems)}")


def _check_stage(key: str, stage: str) -> None:
    if stage not in STAGES:
        raise ParamsError(f"block {key!r}: no stage {stage!r}; stages: {', '.join(STAGES)}")
