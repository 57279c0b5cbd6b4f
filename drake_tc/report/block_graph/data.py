"""What a block graph says: blocks with a stage, ports, update period and feedthrough; edges; ports of the whole."""

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
