"""Ports by name, "system:port", and how a loop is cut open there in a Diagram that is already built."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, Diagram

from drake_tc.analysis.state_coordinates import leaf_systems
from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray


@dataclass(frozen=True)
class Cut:
    """Where an input goes in.

    Attributes:
        name: "system:port".
        readers: Input ports that take the input in place of what they are connected to.
        value: (m,) what comes there at the operating point.
    """

    name: str
    readers: tuple[Any, ...]
    value: FloatArray

    def fix(self, root: Context, u: FloatArray) -> None:
        """Hold u (m,) at the cut, in the diagram's context."""
        for port in self.readers:
            port.FixValue(port.get_system().GetMyMutableContextFromRoot(root), u)


def _split(diagram: Diagram, name: str) -> tuple[Any, str]:
    """(system, port) of "system:port", where a nested system is "diagram::system"."""
    owner, colon, port = name.rpartition(":")
    systems = dict(leaf_systems(diagram))
    if not (colon and owner and port):
        raise ParamsError(f"port {name!r}: expected SYSTEM:PORT")
    if owner not in systems:
        raise ParamsError(f"port {name!r}: no system {owner!r}; systems: {', '.join(systems)}")
    return systems[owner], port


def _ports(system: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Vector ports by name: inputs, outputs."""
    into = (system.get_input_port(i) for i in range(system.num_input_ports()))
    out = (system.get_output_port(i) for i in range(system.num_output_ports()))
    return {p.get_name(): p for p in into if p.size()}, {p.get_name(): p for p in out if p.size()}


def _wires(diagram: Diagram) -> list[tuple[Any, Any]]:
    """(input port, output port that feeds it) of every connection, nested diagrams included."""
    wires = [
        (reader.get_input_port(into), source.get_output_port(out))
        for (reader, into), (source, out) in diagram.connection_map().items()
    ]
    for system in diagram.GetSystems():
        if isinstance(system, Diagram):
            wires += _wires(system)
    return wires


def _same(one: Any, other: Any) -> bool:
    return one.get_system() is other.get_system() and one.get_index() == other.get_index()


def output_named(diagram: Diagram, name: str) -> Any:
    """The output port, or the one that feeds the input port of that name.

    Raises:
        ParamsError: there is none, or it carries no vector.
    """
    system, port = _split(diagram, name)
    inputs, outputs = _ports(system)
    if port in outputs:
        return outputs[port]
    if port not in inputs:
        raise ParamsError(f"port {name!r}: expected one of {', '.join([*outputs, *inputs])}")
    for reader, source in _wires(diagram):
        if _same(reader, inputs[port]):
            return source
    raise ParamsError(f"port {name!r}: expected a port that is connected inside its diagram")


def cut_at(diagram: Diagram, context: Context, name: str) -> Cut:
    """The cut at a port: see `drake_tc.analysis.sampled.linearise`.

    Raises:
        ParamsError: no such port, one without readers, or one that is not a vector.
    """
    system, port = _split(diagram, name)
    inputs, outputs = _ports(system)
    source = output_named(diagram, name)
    if port in outputs:
        readers = tuple(reader for reader, fed_by in _wires(diagram) if _same(fed_by, source))
    else:
        readers = (inputs[port],)
    if not readers:
        raise ParamsError(f"port {name!r}: expected a port that something reads")
    value = np.array(source.Eval(source.get_system().GetMyContextFromRoot(context)))
    return Cut(name, readers, value)
