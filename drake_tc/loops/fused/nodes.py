"""`Node`, `Given`: what a plan computes, and what it reads from outside."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from pydrake.systems.framework import OutputPort, System

from drake_tc.array_stage import ArrayStage
from drake_tc.types import IntArray

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
