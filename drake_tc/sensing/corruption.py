"""From truth to reading as plain arrays: `Corruption`, one sensor's compiled spec, and `corrupt` for logs.

Random numbers are a function of (seed, tick): the stream is counter-based, so it needs no generator that remembers.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.sensing.spec import SensorFault, SensorSpec, whole_ticks
from drake_tc.types import BoolArray, FloatArray, IntArray

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
