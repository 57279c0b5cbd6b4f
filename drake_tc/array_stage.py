"""`ArrayStage`: what a stage's Drake callbacks do, as functions on arrays.

A stage that has one can run together with others in a single Drake system (`drake_tc.loops.fused`). Its own callbacks
call the same functions, so that both forms compute the same numbers.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from drake_tc.types import FloatArray, IntArray

Call = Callable[[float], object]
"""A function of the time [s] that reads and writes arrays to which it is bound."""


class Held:
    """The value of an abstract input port; set as an array is, by `held[:] = value`."""

    value: Any = None

    def __setitem__(self, where: slice, value: Any) -> None:
        self.value = value


@dataclass(frozen=True)
class Arrays:
    """The arrays of one stage in one Context; the same objects in every tick.

    Attributes:
        inputs: Name of each connected input port to its value: (n,), or a `Held` where the port is abstract.
        out: (width,) outputs y[n] of this tick.
        before: (S,) state x[n].
        after: (S,) state x[n+1]; holds x[n] when an update begins.
    """

    inputs: Mapping[str, Any]
    out: FloatArray
    before: FloatArray
    after: FloatArray


class Bind(Protocol):
    """Bind a stage's functions to arrays."""

    def __call__(self, arrays: Arrays) -> tuple[Call | Sequence[Call] | None, Call | Sequence[Call] | None]:
        """What writes `out` from inputs and `before`, and what writes `after`; None where there is nothing to do.

        A `KernelCall` (`drake_tc.kernels.calls`) runs together with its neighbours.

        All inputs, and `out`, are those of the tick when an update is called.
        """


@dataclass(frozen=True, eq=False)
class ArrayStage:
    """A stage on arrays.

    Attributes:
        width: Numbers in `Arrays.out`.
        ports: Output port to its places in `out`. Ports that are missing here exist only on the stage's own system.
        bind: Makes the functions for one Context.
        reads: Input ports on which `out` depends in the same tick.
        updates: Input ports on which the next state depends besides.
        start: (S,) first state.
        period: Of the update [s]; None for a stage without state.
    """

    width: int
    ports: Mapping[str, IntArray]
    bind: Bind
    reads: frozenset[str] = frozenset()
    updates: frozenset[str] = frozenset()
    start: FloatArray = field(default_factory=lambda: np.zeros(0))
    period: float | None = None

    @property
    def inputs(self) -> frozenset[str]:
        """All input ports that are used."""
        return self.reads | self.updates


def places(parts: Mapping[str, slice]) -> dict[str, IntArray]:
    """`ArrayStage.ports` of ports that are slices of `out`, with a stop each.

    Example:
        >>> places({"value": slice(0, 2), "rate": slice(2, 4)})["rate"]
        array([2, 3])
    """
    return {name: np.arange(part.start or 0, part.stop, part.step or 1) for name, part in parts.items()}
