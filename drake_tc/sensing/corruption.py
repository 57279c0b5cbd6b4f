"""From truth to reading as plain arrays: `Corruption`, one sensor's compiled spec, and `corrupt` for logs.

Random numbers are a function of (seed, tick): the stream is counter-based, so it needs no generator that remembers.

`SensorOnArrays`: a sensor's calculations as functions on arrays.
"""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from drake_tc.array_stage import Arrays, ArrayStage, Held, places
from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import BETWEEN_TICKS, READING, Kernel, KernelCall
from drake_tc.sensing.spec import SensorFault, SensorSpec, whole_ticks
from drake_tc.types import BoolArray, Call, FloatArray, IntArray

BLOCK = 256
"""Ticks whose random numbers are drawn together."""

LARGEST_SEED = 2**63 - 1


_DRAWN: "WeakKeyDictionary[Corruption, tuple[float, Corruption]]" = WeakKeyDictionary()
"""The last sample of each sensor, which a run asks for again and again."""


def quantise(x: FloatArray, resolution: FloatArray) -> FloatArray:
    """Q(x) = r round(x/r) where r > 0, else x; halves go to the even step.

    Args:
        x: (..., n).
        resolution: (n,) r >= 0.
    """
    step = np.where(resolution > 0.0, resolution, 1.0)
    return np.asarray(np.where(resolution > 0.0, np.rint(x / step) * step, x))


@dataclass(frozen=True, eq=False)
class Corruption:
    """The compiled spec and faults of one sensor of n channels, a function of the tick k.

    Attributes:
        size: Channels n.
        spec: What the sensor does.
        dt: Period of a tick [s].
        faults: When it fails.
        seed: Of its random numbers.

    Raises:
        ParamsError: No channel, a period that is not positive, a seed out of range, a latency or lateness that is no
            whole number of ticks, or a spec or fault for channels that the sensor does not have.
    """

    size: int
    spec: SensorSpec
    dt: float
    faults: tuple[SensorFault, ...] = ()
    seed: int = 0

    def __post_init__(self) -> None:
        if self.size < 1:
            raise ParamsError(f"sensor: expected at least one channel, got size {self.size}")
        if not (np.isfinite(self.dt) and self.dt > 0.0):
            raise ParamsError(f"sensor: expected a positive period dt [s], got {self.dt!r}")
        if not (isinstance(self.seed, int) and 0 <= self.seed <= LARGEST_SEED):
            raise ParamsError(f"sensor: expected a whole number 0 to 2^63 - 1 as seed, got {self.seed!r}")
        for name in ("noise", "bias", "scale", "resolution", "dropout"):
            self.spec.channels(name, self.size)
        self.spec.ticks(self.dt)
        for fault in self.faults:
            fault.indices(self.size)
            self._lateness(fault)

    def drawn(self, draw: float) -> "Corruption":
        """The same sensor as another sample of its kind: other noise, and biases from N(0, bias^2).

        Args:
            draw: Of the sample; 0 is the sensor as it was described.
        """
        if draw == 0.0 or not np.isfinite(draw):
            return self
        kept = _DRAWN.get(self)
        if kept is None or kept[0] != draw:
            words = np.array([draw]).view(np.uint32).tolist()
            generator = np.random.default_rng([self.seed, *words])
            bias = self.spec.channels("bias", self.size) * generator.standard_normal(self.size)
            spec = replace(self.spec, bias=tuple(bias.tolist()))
            _DRAWN[self] = kept = draw, replace(self, spec=spec, seed=int(generator.integers(LARGEST_SEED)))
        return kept[1]

    @property
    def delay(self) -> int:
        """Latency in ticks."""
        return self.spec.ticks(self.dt)

    @property
    def freezes(self) -> bool:
        """Whether a fault repeats earlier readings."""
        return any(fault.kind == "frozen" for fault in self.faults)

    @property
    def oldest(self) -> int:
        """Age of the oldest truth that is read [ticks]: the latency, and late faults, which add up."""
        return self.delay + sum(self._lateness(fault) for fault in self.faults)

    @property
    def changes(self) -> bool:
        """Whether `offsets` or `frozen` differ from tick to tick."""
        drawn = any(self.spec.channels(name, self.size).any() for name in ("noise", "dropout"))
        return bool(self.faults) or drawn

    def offsets(self, block: int) -> FloatArray:
        """(BLOCK, n) bias + noise w[k] + biased and spiked faults of a block's ticks; NaN where a sample is lost."""
        key = np.array([self.seed, block], dtype=np.uint64)
        generator = np.random.Generator(np.random.Philox(key=key))
        rows = generator.standard_normal((BLOCK, self.size))
        rows *= self.spec.channels("noise", self.size)
        rows += self.spec.channels("bias", self.size)
        dropout = self.spec.channels("dropout", self.size)
        if dropout.any():
            rows[generator.random((BLOCK, self.size)) < dropout] = np.nan
        for number, fault in enumerate(self.faults):
            active = self._active(fault, block)
            if fault.kind == "biased":
                rows[active] += fault.value
            elif fault.kind == "spikes":
                rows += active * self._spikes(fault, block, number)
            elif fault.kind in ("dropped", "nan"):
                rows[active] = np.nan
        return rows

    def _spikes(self, fault: SensorFault, block: int, number: int) -> FloatArray:
        """(BLOCK, n) +/- value at the ticks that are hit, else 0, from a stream of the fault's own."""
        key = np.array([self.seed, block], dtype=np.uint64)
        counter = np.array([0, 0, 0, 1 + number], dtype=np.uint64)
        drawn = np.random.Generator(np.random.Philox(counter=counter, key=key)).random((BLOCK, self.size))
        return np.asarray(fault.value * ((drawn < 0.5 * fault.chance) * 1.0 - (drawn > 1.0 - 0.5 * fault.chance)))

    def frozen(self, block: int) -> BoolArray:
        """(BLOCK, n) where a fault repeats the last finite reading."""
        mask = np.zeros((BLOCK, self.size), dtype=np.bool_)
        for fault in self.faults:
            if fault.kind == "frozen":
                mask |= self._active(fault, block)
        return mask

    def lateness(self, block: int) -> IntArray:
        """(BLOCK, n) additional age of the truth by late faults [ticks]."""
        ticks = np.zeros((BLOCK, self.size), dtype=np.int64)
        for fault in self.faults:
            if fault.kind == "late":
                ticks += self._lateness(fault) * self._active(fault, block)
        return ticks

    def _lateness(self, fault: SensorFault) -> int:
        return whole_ticks("value", fault.value, self.dt) if fault.kind == "late" else 0

    def _active(self, fault: SensorFault, block: int) -> BoolArray:
        first, end = fault.ticks(self.dt)
        ticks = block * BLOCK + np.arange(BLOCK)
        channels = np.zeros(self.size, dtype=np.bool_)
        channels[fault.indices(self.size)] = True
        return np.asarray(((ticks >= first) & (ticks < end))[:, None] & channels)


def corrupt(
    truth: FloatArray, spec: SensorSpec, dt: float, faults: Sequence[SensorFault] = (), seed: int = 0
) -> FloatArray:
    """Readings of a log: what `Sensor` with the same arguments reads at ticks 0 ... T - 1.

    See `SensorSpec` and `SensorFault` for the equations. Before the latency has passed, the first truth is read.
    A frozen channel that has had no finite reading yet takes the first one.

    Args:
        truth: (T, n), uniform period dt.
        spec: What the sensor does.
        dt: [s].
        faults: When it fails.
        seed: Of the random numbers.

    Returns:
        (T, n) readings, NaN where a sample is lost.

    Raises:
        ParamsError: As `Corruption`.
    """
    truth = np.asarray(truth, dtype=np.float64)
    if truth.ndim != 2 or truth.shape[0] == 0:
        raise ParamsError(f"corrupt: expected truth (T, n) with T > 0, got shape {truth.shape}")
    samples, size = truth.shape
    sensor = Corruption(size, spec, dt, tuple(faults), seed)
    blocks = range(-(-samples // BLOCK))
    offsets = np.concatenate([sensor.offsets(block) for block in blocks])[:samples]
    age = sensor.delay + np.concatenate([sensor.lateness(block) for block in blocks])[:samples]
    late = np.take_along_axis(truth, np.maximum(np.arange(samples)[:, None] - age, 0), axis=0)
    readings = quantise(spec.channels("scale", size) * late + offsets, spec.channels("resolution", size))
    if sensor.freezes:
        frozen = np.concatenate([sensor.frozen(block) for block in blocks])[:samples]
        _freeze(readings, frozen)
    return readings


def _freeze(readings: FloatArray, frozen: BoolArray) -> None:
    """Put the last finite reading of before into the frozen samples that came, in place."""
    finite = np.isfinite(readings)
    for channel in range(readings.shape[1]):
        came, stuck = finite[:, channel], frozen[:, channel]
        fresh = came & ~stuck
        if came.any():
            fresh[np.argmax(came)] = True
        rows = np.arange(len(came))
        last = np.maximum.accumulate(np.where(fresh, rows, -1))
        repeat = came & stuck & (last >= 0)
        readings[repeat, channel] = readings[last[repeat], channel]


_READING = Kernel("sensors", "reading")
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
            _READING(truth, rows[int(tick - first_tick[0])], (nothing, nothing), fixed, out)

        reading = KernelCall(READING, read, truth, rows, first_tick, self._dt, nothing, nothing, *fixed, out)
        return ([look, reading] if isinstance(given, Held) else [reading]), None

    def _bind_late(self, arrays: Arrays) -> tuple[Call, Call]:
        """Of a sensor that remembers ticks."""
        truth, out, size = self._truth_from(arrays), arrays.out, self._size
        row, line, last = np.split(arrays.before, self._ends())
        next_row, next_line, next_last = np.split(arrays.after, self._ends())
        rows, nothing, block, draw = row[np.newaxis], self._nothing, _Rows(), _draw_from(arrays)
        past, fixed = (line, last), (self._channels, self._layout)

        def outputs(time: float) -> None:
            seen = nothing if self._delay else truth()
            _READING(seen, row, past, fixed, out)

        shown: Call = outputs
        if self._delay:
            shown = KernelCall(
                READING, outputs, nothing, rows, np.zeros(1, dtype=np.int64), self._dt, *past, *fixed, out
            )

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
