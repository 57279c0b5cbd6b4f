"""Compiled functions from Python.

`Kernel`: one by its name, so that Numba is imported where it is called and not before. `KernelCall`: a kernel with its
arguments; and `sequences`, which runs several of them in one call.
"""

from collections.abc import Callable, Sequence
from importlib import import_module
from itertools import groupby
from typing import Any

import numpy as np

from drake_tc.types import Call, FloatArray, IntArray


class Kernel:
    """A compiled function by name; its module is imported, and with it Numba, at the first call."""

    def __init__(self, module: str, name: str) -> None:
        """Keep the names.

        Args:
            module: Below `drake_tc.kernels`.
            name: Of the entry.
        """
        self._module, self._name = module, name
        self._entry: Callable[..., Any] | None = None

    def __call__(self, *arguments: Any) -> Any:
        """Call the entry."""
        entry = self._entry
        if entry is None:
            entry = self.entry()
        return entry(*arguments)

    def entry(self) -> Callable[..., Any]:
        """The compiled function itself."""
        if self._entry is None:
            self._entry = getattr(import_module(f"drake_tc.kernels.{self._module}"), self._name)
        return self._entry


COPY, GATHER, ADD, MULTIPLY, READING, ESTIMATE, MOTION, SOLVE, GUARD, ADVANCE, FILTER, RAISE_FLAGS = range(12)
ABOVE, COPY_BELOW, COPY_AFTER, MOTORS, BASE_OUTPUTS, VOTE, REMEMBER, SPRING_LAW, IMU, WRENCHES, SWING = range(12, 23)
"""Kinds of calls in a sequence."""
BETWEEN_TICKS = 1e-6
"""Fraction of a tick: a time that is later than a tick by less than this counts as the tick itself."""
MOST_ARGUMENTS = 16
TIME, SKIPPED = "time", "skipped"
"""Arguments that are passed by the sequence itself and need no array."""
_RUN = Kernel("sequence", "run")


class KernelCall:
    """A function of the time [s] that calls one kernel, on arrays that stay the same objects.

    Attributes:
        kind: Of the call in a sequence.
        arguments: Contiguous arrays of real or whole numbers, numbers, `TIME`, or `SKIPPED`.
    """

    def __init__(self, kind: int, call: Call, *arguments: Any) -> None:
        """Keep the arguments, so that their addresses stay valid."""
        self.kind, self._call = kind, call
        self.arguments = tuple(_array(argument) for argument in arguments)

    def __call__(self, time: float) -> object:
        """Call the kernel from Python."""
        return self._call(time)

    def row(self) -> IntArray:
        """(1 + 3 A,) kind, and address and shape of each argument."""
        row = np.zeros(1 + 3 * MOST_ARGUMENTS, dtype=np.int64)
        row[0] = self.kind
        for number, argument in enumerate(self.arguments):
            if argument is not None:
                shape = (*argument.shape, 1)[:2]
                row[1 + 3 * number : 4 + 3 * number] = argument.ctypes.data, *shape
        return row


def _array(argument: Any) -> Any:
    """An argument as an array; None where there is nothing to pass."""
    if isinstance(argument, str):
        return None
    if not isinstance(argument, np.ndarray):
        return np.array([argument], dtype=np.int64 if isinstance(argument, int | np.integer) else np.float64)
    if not argument.flags.c_contiguous or argument.dtype not in (np.dtype(np.float64), np.dtype(np.int64)):
        raise TypeError(f"expected a contiguous array of float64 or int64, got {argument.dtype}, {argument.flags}")
    return argument


def copying(source: FloatArray, target: FloatArray) -> KernelCall:
    """Copy an array into another one, of the same size."""

    def copy(time: float) -> None:
        target[:] = source

    return KernelCall(COPY, copy, source, target)


def above(source: FloatArray, limit: float, target: FloatArray) -> KernelCall:
    """1 where an element of `source` is above a limit, else 0, into `target`."""

    def compare(time: float) -> None:
        target[:] = source > limit

    return KernelCall(ABOVE, compare, source, float(limit), target)


def gathering(source: FloatArray, where: IntArray, target: FloatArray) -> KernelCall:
    """Copy some elements of an array."""

    def gather(time: float) -> None:
        source.take(where, out=target, mode="clip")

    return KernelCall(GATHER, gather, source, where, target)


def sequences(calls: Sequence[Call]) -> list[Call]:
    """The same calls in the same order; adjacent kernel calls are joined to one call."""
    from drake_tc.kernels.compiling import interpreted

    if interpreted():
        return list(calls)
    found: list[Call] = []
    for _, neighbours in groupby(calls, lambda call: isinstance(call, KernelCall)):
        group = tuple(neighbours)
        kernels = tuple(call for call in group if isinstance(call, KernelCall))
        found += [_in_one(kernels)] if len(kernels) > 1 else group
    return found


def _in_one(calls: tuple[KernelCall, ...]) -> Call:
    run, table, count = _RUN.entry(), np.stack([call.row() for call in calls]), len(calls)
    table.flags.writeable = False

    def all_of_them(time: float) -> None:
        done = run(table, time)
        while done < count:
            calls[done](time)
            done += 1 + run(table[done + 1 :], time)

    return all_of_them
