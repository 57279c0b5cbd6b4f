"""The complete state of a Diagram as one vector of coordinates whose meaning does not change with time.

Most systems are taken as they are: every discrete, then every continuous state. A system that keeps time-varying
bookkeeping (a ring buffer with a head, a tick counter, a mode) says itself what of it is state, by two methods:

    coordinates(context) -> (n,)              raises ParamsError where the system cannot be linearised as it stands
    set_coordinates(context, x)               the inverse; bookkeeping stays as it is

Coordinates are named "system:name". The names are those of `coordinate_names()` where the system has this method, and
Drake's own state names for a MultibodyPlant; others are numbered, "system[i]".
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
