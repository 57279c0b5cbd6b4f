"""`ArrayStage`: the calculations of a stage as functions on arrays, without Drake's ports and Contexts.

A stage with a method `on_arrays() -> ArrayStage` can run together with other stages in a single Drake system
(`drake_tc.loops.fused`). The stage's own Drake callbacks call the same functions, so that both forms compute the same
numbers. A subclass that changes or adds methods needs an `on_arrays` of its own (`offered_stage`).

`PortMethods`: `get_command_output_port()` and the like, for every port of a system by its name.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from drake_tc.types import Call, FloatArray, IntArray


class Held:
    """Holds the value of an abstract input port. It is set in the same way as an array, by `held[:] = value`."""

    value: Any = None

    def __setitem__(self, where: slice, value: Any) -> None:
        self.value = value


@dataclass(frozen=True)
class Arrays:
    """The arrays of one stage in one Context. They are the same objects in every tick.

    Attributes:
        inputs: Name of each connected input port to its value: (n,) and read-only, or a `Held` if the port is abstract.
        out: (width,) outputs y[n] of this tick.
        before: (S,) state x[n], read-only.
        after: (S,) state x[n+1]; equal to x[n] when an update begins.
    """

    inputs: Mapping[str, Any]
    out: FloatArray
    before: FloatArray
    after: FloatArray


class Bind(Protocol):
    """Bind a stage's functions to arrays."""

    def __call__(self, arrays: Arrays) -> tuple[Call | Sequence[Call] | None, Call | Sequence[Call] | None]:
        """Return the functions of one stage in one Context.

        Args:
            arrays: What the functions read and write.

        Returns:
            First the function, or several in their order, that computes `out` from the inputs in `ArrayStage.reads` and
            `before`. Second the one that computes `after` (the update); all inputs and `out` have the values of the
            tick when it is called. None where there is nothing to compute. Neighbouring functions that are a
            `KernelCall` (`drake_tc.kernels.calls`) run in one compiled call.
        """


@dataclass(frozen=True, eq=False)
class ArrayStage:
    """A stage on arrays.

    Attributes:
        width: Length of `Arrays.out`.
        ports: Name of an output port to its indices in `out`. An output port that is missing here exists only on the
            stage's own Drake system.
        bind: Makes the functions for one Context.
        reads: Input ports on which `out` depends in the same tick.
        updates: Further input ports, on which only the next state depends.
        start: (S,) initial state.
        period: Period of the update [s]; None for a stage without state.
        early: Outputs that depend on fewer inputs than `reads`, where the stage has such outputs and another stage may
            lie between them and the others. It has no state of its own: its `Arrays.before` is the state of this stage.
        begin: Makes the function for one Context that computes `after` when a simulator is initialized; None where the
            state stays as it is then.
    """

    width: int
    ports: Mapping[str, IntArray]
    bind: Bind
    reads: frozenset[str] = frozenset()
    updates: frozenset[str] = frozenset()
    start: FloatArray = field(default_factory=lambda: np.zeros(0))
    period: float | None = None
    early: "ArrayStage | None" = None
    begin: Callable[[Arrays], Call] | None = None

    @property
    def inputs(self) -> frozenset[str]:
        """All input ports that are used."""
        return self.reads | self.updates | (frozenset() if self.early is None else self.early.reads)

    def part_with(self, port: str) -> "ArrayStage | None":
        """This stage, or its early one, whichever has the output port; None where no part has it."""
        parts = (self,) if self.early is None else (self, self.early)
        return next((part for part in parts if port in part.ports), None)


def offered_stage(system: Any) -> ArrayStage | None:
    """The calculations of a system on arrays; None where it does not offer them.

    An inherited `on_arrays` does not know the methods that a subclass defines, so it is not used where there are any.
    A subclass may implement abstract methods, which `on_arrays` calls, and then may have a constructor.
    """
    classes = type(system).__mro__
    owner = next((place for place, each in enumerate(classes) if "on_arrays" in vars(each)), None)
    if owner is None or any(_differs(each, classes[place + 1 :]) for place, each in enumerate(classes[:owner])):
        return None
    stage: ArrayStage | None = system.on_arrays()
    return stage


def _differs(own: type, bases: Sequence[type]) -> bool:
    """Whether a class defines methods or properties other than implementations of abstract ones."""
    names = {name for name, value in vars(own).items() if hasattr(value, "__get__") and not name.startswith("__")}
    implemented = {name for name in names if _is_abstract(name, bases)}
    return bool(names - implemented) or ("__init__" in vars(own) and not implemented)


def _is_abstract(name: str, bases: Sequence[type]) -> bool:
    found = next((vars(each)[name] for each in bases if name in vars(each)), None)
    return bool(getattr(found, "__isabstractmethod__", False))


def places(parts: Mapping[str, slice]) -> dict[str, IntArray]:
    """`ArrayStage.ports` of ports that are slices of `out`, with a stop each.

    Example:
        >>> places({"value": slice(0, 2), "rate": slice(2, 4)})["rate"]
        array([2, 3])
    """
    return {name: np.arange(part.start or 0, part.stop, part.step or 1) for name, part in parts.items()}


_KINDS = ("input", "output")


class PortMethods:
    """Base beside Drake's LeafSystem: a method `get_<port>_input_port()` or `get_<port>_output_port()` for every port.

    `system.get_command_output_port()` is `system.GetOutputPort("command")`; `dir(system)` lists the methods.

    Example:
        >>> guard = CommandGuard(6, 1e-3)
        >>> guard.get_command_output_port().size()
        6
    """

    def __getattr__(self, name: str) -> Callable[[], Any]:
        """The method of a port.

        Raises:
            AttributeError: no such attribute; names the ports where the name is that of a port's method.
        """
        own: Any = self
        for kind in _KINDS if name.startswith("get_") else ():  # Drake asks for another name in every step
            if name.endswith(f"_{kind}_port"):
                port, names = name.removeprefix("get_").removesuffix(f"_{kind}_port"), _port_names(own, kind)
                if port in names:
                    find: Any = getattr(own, f"Get{kind.title()}Port")
                    return lambda: find(port)
                raise AttributeError(
                    f"{type(self).__name__} has no {kind} port {port!r}; its ports: {', '.join(names)}"
                )
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def __dir__(self) -> list[str]:
        methods = [f"get_{port}_{kind}_port" for kind in _KINDS for port in _port_names(self, kind)]
        return [*super().__dir__(), *methods]


def _port_names(system: Any, kind: str) -> list[str]:
    count, find = getattr(system, f"num_{kind}_ports"), getattr(system, f"get_{kind}_port")
    return [find(index).get_name() for index in range(count())]
