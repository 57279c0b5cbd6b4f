"""`SensorOnArrays`: a sensor's calculations as functions on arrays."""

from abc import abstractmethod
from collections.abc import Sequence
from math import ceil
from typing import Any

import numpy as np

from drake_tc.array_stage import Arrays, ArrayStage, Held, places
from drake_tc.kernels.calls import BETWEEN_TICKS, READING, KernelCall
from drake_tc.kernels.lazy import Kernel
from drake_tc.sensing.corruption import BLOCK
from drake_tc.types import Call, FloatArray, IntArray

_READING = Kernel("sensor", "reading")
TICK = 0
"""Where the tick stands in a state row."""
DRAW = "draw"
"""Input port that says which sample of the sensor it is."""


class SensorOnArrays:
    """Base of `SensorBase`, which sets the attributes and states the recursion.

    A sensor that remembers ticks has the state [k, any m, o, m, a; d; l] here, as far as it has these.
    """

    is_drawn: bool
    _input: Any
    _size: int
    _delay: int
    _length: int
    _freezes: bool
    _ticks: bool
    _changes: bool
    _dt: float
    _channels: FloatArray
    _layout: IntArray
    _nothing: FloatArray
    _first: FloatArray

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        name, ports = self._input.get_name(), places({"reading": slice(self._size)})
        drawn = frozenset({DRAW}) if self.is_drawn else frozenset[str]()
        if not self._ticks:
            return ArrayStage(self._size, ports, self._bind, drawn | {name})
        reads, updates = (frozenset[str](), drawn | {name}) if self._delay else (frozenset({name}), drawn)
        kept = np.full(self._length * self._size + self._freezes * self._size, np.nan)
        return ArrayStage(
            self._size,
            ports,
            self._bind_late,
            reads,
            updates,
            start=np.concatenate([self._first[0], kept]),
            period=self._dt,
            begin=self._bind_begin,
        )

    def _bind(self, arrays: Arrays) -> tuple[Sequence[Call], None]:
        """Of a sensor that does not remember ticks."""
        given, nothing, out = arrays.inputs[self._input.get_name()], self._nothing, arrays.out
        fixed, rows = (self._channels, self._layout), self._rows(0) if self._changes else self._first.copy()
        truth, draw = np.zeros(self._size) if isinstance(given, Held) else given, _draw_from(arrays)
        first_tick = np.full(1, 0 if draw is None else -2 * len(rows), dtype=np.int64)

        def look(time: float) -> None:
            truth[:] = self._truth_of(given.value)

        def read(time: float) -> None:
            tick = max(ceil(time / self._dt - BETWEEN_TICKS), 0) if self._changes else 0
            if not 0 <= tick - first_tick[0] < len(rows):
                first_tick[0] = tick - tick % BLOCK
                rows[:] = self._rows(tick // BLOCK, 0.0 if draw is None else float(draw[0]))[: len(rows)]
            _READING(truth, rows, int(tick - first_tick[0]), nothing, nothing, *fixed, out)

        reading = KernelCall(READING, read, truth, rows, first_tick, self._dt, nothing, nothing, *fixed, out)
        return ([look, reading] if isinstance(given, Held) else [reading]), None

    def _bind_late(self, arrays: Arrays) -> tuple[Call, Call]:
        """Of a sensor that remembers ticks."""
        truth, out, size = self._truth_from(arrays), arrays.out, self._size
        row, line, last = np.split(arrays.before, self._ends())
        next_row, next_line, next_last = np.split(arrays.after, self._ends())
        rows, nothing, block, draw = row[np.newaxis], self._nothing, _Rows(), _draw_from(arrays)
        fixed = (line, last, self._channels, self._layout, out)

        def outputs(time: float) -> None:
            seen = nothing if self._delay else truth()
            _READING(seen, rows, 0, *fixed)

        shown: Call = outputs
        if self._delay:
            shown = KernelCall(READING, outputs, nothing, rows, np.zeros(1, dtype=np.int64), self._dt, *fixed)

        def update(time: float) -> None:
            tick = int(row[TICK])
            index, at = divmod(tick + 1, BLOCK)
            now = 0.0 if draw is None else float(draw[0])
            if (block.index, block.draw) != (index, now):
                block.index, block.draw, block.rows = index, now, self._rows(index, now)
            next_row[:] = block.rows[at]
            if self._length:
                place = tick % self._length * size
                next_line[place : place + size] = truth()
            if self._freezes:
                next_last[:] = np.where(np.isfinite(out), out, last)

        return shown, update

    def _bind_begin(self, arrays: Arrays) -> Call:
        """Count from the start time, and fill what is empty of the delay line."""
        truth, ends, draw = self._truth_from(arrays), self._ends(), _draw_from(arrays)
        row, line, _ = np.split(arrays.before, ends)
        next_row, next_line, _ = np.split(arrays.after, ends)

        def begin(time: float) -> None:
            now = 0.0 if draw is None else float(draw[0])
            first, start = self._first_row(float(row[TICK]), time, now), self._length and np.isnan(line).all()
            if first is not None:
                next_row[:] = first
            if start:
                next_line[:] = np.tile(truth(), self._length)

        return begin

    def _first_row(self, tick: float, time: float, draw: float) -> FloatArray | None:
        """The state row of a start time [s] that is not 0, or of a draw, where the tick is 0; None: it stays."""
        start = round(time / self._dt)
        return self._rows(start // BLOCK, draw)[start % BLOCK] if tick == 0 and (start > 0 or draw) else None

    def _ends(self) -> tuple[int, int]:
        """Where row and delay line end in the state."""
        return self._first.shape[1], self._first.shape[1] + self._length * self._size

    def _truth_from(self, arrays: Arrays) -> Any:
        """A function without arguments: (n,) u."""
        given = arrays.inputs[self._input.get_name()]
        return (lambda: self._truth_of(given.value)) if isinstance(given, Held) else (lambda: self._truth_of(given))

    @abstractmethod
    def _truth_of(self, value: Any) -> FloatArray:
        """(n,) u from the value of the input port."""

    @abstractmethod
    def _rows(self, block: int, draw: float = 0.0) -> FloatArray:
        """(BLOCK, ...) state rows of a block's ticks."""


def _draw_from(arrays: Arrays) -> Any:
    """(1,) of the input port `draw`; None where it is not connected."""
    return arrays.inputs.get(DRAW)


class _Rows:
    """State rows of the block that was drawn last."""

    def __init__(self) -> None:
        self.index, self.draw, self.rows = -1, 0.0, np.empty((0, 0))
