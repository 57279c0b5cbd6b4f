"""Ports and states of a diagram: which ones a linear analysis takes, and in which coordinates.

The complete state of a Diagram as one vector of coordinates whose meaning does not change with time.

Most systems are taken as they are: every discrete, then every continuous state. A system that keeps time-varying
bookkeeping (a ring buffer with a head, a tick counter, a mode) says itself what of it is state, by two methods:

    coordinates(context) -> (n,)              raises ParamsError where the system cannot be linearised as it stands
    set_coordinates(context, x)               the inverse; bookkeeping stays as it is

Coordinates are named "system:name". The names are those of `coordinate_names()` where the system has this method, and
Drake's own state names for a MultibodyPlant; others are numbered, "system[i]".

Ports by name, "system:port", and how a loop is cut open there in a Diagram that is already built.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, Diagram, System

from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray


@runtime_checkable
class HasCoordinates(Protocol):
    """A system that presents its own state."""

    def coordinates(self, context: Context) -> FloatArray:
        """(n,) the true state in this system's context, in an order that does not change."""
        ...

    def set_coordinates(self, context: Context, x: FloatArray) -> None:
        """Make (n,) x the state of this system's context."""
        ...


@runtime_checkable
class HasCoordinateNames(Protocol):
    """A system that names its coordinates, or its discrete and continuous states."""

    def coordinate_names(self) -> tuple[str, ...]:
        """(n,) in the order of the coordinates."""
        ...


@dataclass(frozen=True)
class StateBlock:
    """One system's part of the vector.

    Attributes:
        name: Of the system, its parents before it.
        system: The system itself.
        first, size: Where its coordinates stand.
    """

    name: str
    system: Any
    first: int
    size: int

    @property
    def names(self) -> tuple[str, ...]:
        """(size,) "system:name", or "system[i]" where the system has no names.

        Raises:
            ParamsError: a system that has another number of names.
        """
        own = _own_names(self.system, self.size)
        if own is None:
            return tuple(f"{self.name}[{i}]" for i in range(self.size))
        if len(own) != self.size:
            raise ParamsError(f"system {self.name!r}: expected {self.size} coordinate_names, got {len(own)}")
        return tuple(f"{self.name}:{name}" for name in own)

    def read(self, root: Context) -> FloatArray:
        """(size,) from the diagram's context."""
        context = self.system.GetMyContextFromRoot(root)
        if isinstance(self.system, HasCoordinates):
            return np.asarray(self.system.coordinates(context), dtype=np.float64)
        groups = [np.array(context.get_discrete_state(i).value()) for i in range(context.num_discrete_state_groups())]
        return np.concatenate([*groups, np.array(context.get_continuous_state_vector().CopyToVector())])

    def write(self, root: Context, x: FloatArray) -> None:
        """(size,) into the diagram's context."""
        context: Any = self.system.GetMyMutableContextFromRoot(root)
        if isinstance(self.system, HasCoordinates):
            self.system.set_coordinates(context, x)
            return
        at = 0
        for i in range(context.num_discrete_state_groups()):
            size = context.get_discrete_state(i).size()
            context.SetDiscreteState(i, x[at : at + size])
            at += size
        if at < x.size:
            context.SetContinuousState(x[at:])


class StateCoordinates:
    """All systems' blocks, one after the other."""

    def __init__(self, diagram: Diagram, context: Context) -> None:
        """Look what there is.

        Args:
            diagram: Whose state.
            context: Of it, at the operating point.

        Raises:
            ParamsError: a system with abstract state, or one that refuses (noise, quantisation, a mode that is not the
                normal one).
        """
        blocks, first = [], 0
        for name, system in leaf_systems(diagram):
            own: Any = system.GetMyContextFromRoot(context)
            if own.num_abstract_states() and not isinstance(system, HasCoordinates):
                raise ParamsError(f"system {name!r}: expected a state of numbers, to linearise; it has abstract state")
            size = StateBlock(name, system, 0, 0).read(context).size
            if size:
                blocks.append(StateBlock(name, system, first, size))
                first += size
        self.blocks = tuple(blocks)
        self.size = first

    @property
    def names(self) -> tuple[str, ...]:
        """Of each coordinate, as `StateBlock.names` has them."""
        return tuple(name for block in self.blocks for name in block.names)

    def read(self, context: Context) -> FloatArray:
        """(size,) x."""
        return np.concatenate([block.read(context) for block in self.blocks]) if self.blocks else np.zeros(0)

    def write(self, context: Context, x: FloatArray) -> None:
        """X into the context."""
        for block in self.blocks:
            block.write(context, x[block.first : block.first + block.size])


def _own_names(system: Any, size: int) -> tuple[str, ...] | None:
    """None for a system that has no names for its coordinates."""
    if isinstance(system, HasCoordinateNames):
        return system.coordinate_names()
    if isinstance(system, MultibodyPlant) and size == system.num_multibody_states():
        names = system.GetStateNames(add_model_instance_prefix=False)
        return tuple(names if len(set(names)) == size else system.GetStateNames(add_model_instance_prefix=True))
    return None


def leaf_systems(diagram: Diagram, above: str = "") -> Iterator[tuple[str, System]]:
    """(name, system) of all leaves; those of a nested diagram are named "diagram::system"."""
    for system in diagram.GetSystems():
        name = above + system.get_name()
        if isinstance(system, Diagram):
            yield from leaf_systems(system, f"{name}::")
        else:
            yield name, system


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
