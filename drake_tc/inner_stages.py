"""Stages inside one Drake system that computes several things in a tick, for its block graph."""

from collections.abc import Mapping
from dataclasses import dataclass

ATTRIBUTE = "inner_stages"
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
