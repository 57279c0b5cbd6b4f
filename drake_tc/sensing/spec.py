"""What a sensor does to the truth, as numbers: `SensorSpec`.

A sensor that fails for a while: `SensorFault`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias

import numpy as np

from drake_tc.config.records import Checked, Finite, Range
from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray

Channels: TypeAlias = float | tuple[float, ...]
"""One value for all channels, or one a channel."""

MOST_TICKS = 10_000
"""Longest latency or delay [ticks]."""
_TICK_TOLERANCE = 1e-6


@dataclass(frozen=True)
class SensorSpec:
    """How a reading y comes from the truth u, tick by tick (period dt), channel by channel.

        y[n] = Q(scale u[n - latency/dt] + bias + noise w[n]),   w ~ N(0, 1), white
        Q(x) = resolution round(x/resolution),  Q(x) = x at resolution 0
        y[n] = NaN with probability `dropout`, each channel and tick by itself

    Attributes:
        noise: Standard deviation of one sample [unit of the signal].
        bias: Constant offset [unit of the signal].
        scale: Gain, 1 is exact [-].
        resolution: Step of the quantisation [unit of the signal]; 0 is none.
        latency: Age of a reading [s], one value for all channels; a whole number of ticks.
        dropout: Probability that a sample is lost [-].

    Raises:
        ParamsError: A value that is not finite or not possible, or channels of different numbers.

    Example:
        >>> SensorSuiteSpec(encoder=SensorSpec(noise=1e-4, latency=2e-3)).encoder.latency
        0.002
    """

    noise: Channels = 0.0
    bias: Channels = 0.0
    scale: Channels = 1.0
    resolution: Channels = 0.0
    latency: float = 0.0
    dropout: Channels = 0.0

    def __post_init__(self) -> None:
        sizes = {}
        for field in fields(self):
            value = getattr(self, field.name)
            each = value if isinstance(value, tuple) else (value,)
            if not each or not all(math.isfinite(x) for x in each):
                raise ParamsError(f"{field.name}: expected finite numbers, got {value!r}")
            if field.name in ("noise", "resolution", "latency") and min(each) < 0.0:
                raise ParamsError(f"{field.name}: expected numbers >= 0, got {value!r}")
            if isinstance(value, tuple):
                sizes[field.name] = len(value)
        if isinstance(self.latency, tuple):
            raise ParamsError(f"latency: expected one number for all channels, got {self.latency!r}")
        dropout = self.channels("dropout", sizes.get("dropout", 1))
        if dropout.min() < 0.0 or dropout.max() > 1.0:
            raise ParamsError(f"dropout: expected a probability, 0 to 1, got {self.dropout!r}")
        if len(set(sizes.values())) > 1:
            listed = ", ".join(f"{name} {size}" for name, size in sizes.items())
            raise ParamsError(f"expected one number of channels, got {listed}")

    def channels(self, name: str, size: int) -> FloatArray:
        """(size,) values of a field, one a channel.

        Raises:
            ParamsError: The field is given for another number of channels.
        """
        value = getattr(self, name)
        if isinstance(value, tuple) and len(value) != size:
            raise ParamsError(f"{name}: expected one value, or {size}, got {len(value)}")
        return np.array(np.broadcast_to(value, size), dtype=np.float64)

    def ticks(self, dt: float) -> int:
        """The latency in ticks.

        Raises:
            ParamsError: It is no whole number of ticks, within 1e-6 of a tick.
        """
        return whole_ticks("latency", self.latency, dt)


def whole_ticks(name: str, seconds: float, dt: float) -> int:
    """An age in ticks.

    Args:
        name: Of the field, for the message.
        seconds: The age [s].
        dt: Period of a tick [s].

    Raises:
        ParamsError: It is no whole number of ticks, within 1e-6 of a tick, or more than `MOST_TICKS`.
    """
    ticks = seconds / dt
    if ticks > MOST_TICKS:
        raise ParamsError(f"{name}: expected at most {MOST_TICKS} periods of {dt:g} s, got {seconds:g} s")
    if abs(ticks - round(ticks)) > _TICK_TOLERANCE:
        below, above = math.floor(ticks) * dt, math.ceil(ticks) * dt
        raise ParamsError(
            f"{name}: expected a multiple of the period {dt:g} s, got {seconds:g} s; nearest: {below:g} and {above:g}"
        )
    return round(ticks)


def joined(parts: Sequence[tuple[SensorSpec, int]]) -> SensorSpec:
    """One spec for the channels of several, in order.

    Args:
        parts: (spec, number of channels) of each.

    Raises:
        ParamsError: No parts, latencies that differ, or values for another number of channels.
    """
    latencies = {spec.latency for spec, _ in parts}
    if len(latencies) != 1:
        raise ParamsError(f"latency: expected one for all parts of a sensor, got {sorted(latencies)}")
    values: dict[str, Any] = {
        name: tuple(np.concatenate([spec.channels(name, size) for spec, size in parts]).tolist())
        for name in ("noise", "bias", "scale", "resolution", "dropout")
    }
    return SensorSpec(latency=latencies.pop(), **values)


FaultKind = Literal["frozen", "dropped", "biased", "nan", "spikes", "late"]

SPIKE_CHANCE = 0.05
"""One sample in twenty."""
_SIZED = {"biased": "bias", "spikes": "spikes", "late": "delay [s]"}
_FAULT_TOLERANCE = 1e-6


@dataclass(frozen=True)
class SensorFault(Checked):
    """What fails, when, on which channels. Active at the ticks n with start <= n dt < start + duration.

    Attributes:
        kind: `frozen` repeats the last finite reading, noise included; `dropped` and `nan` give NaN (no sample, or a
            sample that is NaN); `biased` adds `value` to the reading before quantisation; `spikes` adds or subtracts it
            at random single samples of a channel; `late` reads the truth of `value` earlier than without the fault.
        start: Start of the fault in the time of the scenario [s].
        duration: Duration [s]; infinite by default.
        channels: Indices of the channels; None: all.
        value: Size of the bias or of the spikes [unit of the signal]; of a late sensor its additional age [s], a whole
            number of ticks.
        chance: Probability of a spike per sample [-]; default 0.05.

    Raises:
        ParamsError: A value that is not possible.

    Example:
        >>> lost = SensorFault("dropped", start=1.0, duration=0.02)
        >>> TorqueLoopSpec(faults={"imu": (lost,)}).faults["imu"][0].kind
        'dropped'
    """

    kind: FaultKind
    start: Finite = 0.0
    duration: float = math.inf
    channels: tuple[int, ...] | None = None
    value: Finite = 0.0
    chance: Annotated[float, Range("a probability above 0 and at most 1", 0.0, 1.0, above=True)] = SPIKE_CHANCE

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.duration > 0.0:
            raise ParamsError(f"duration: expected a time > 0 [s], or .inf, got {self.duration!r}")
        if self.kind in _SIZED and self.value == 0.0:
            raise ParamsError(f"value: expected the size of the {_SIZED[self.kind]}, got 0")
        if self.kind == "late" and self.value < 0.0:
            raise ParamsError(f"value: expected an additional age > 0 [s], got {self.value:g}")
        if self.kind not in _SIZED and self.value != 0.0:
            raise ParamsError(
                f"value: expected only with kind {' or '.join(_SIZED)}, got {self.value:g} with {self.kind}"
            )
        if self.kind != "spikes" and self.chance != SPIKE_CHANCE:
            raise ParamsError(f"chance: expected only with kind spikes, got it with {self.kind}")
        if self.channels is not None and (not self.channels or len(set(self.channels)) < len(self.channels)):
            raise ParamsError(f"channels: expected different indices, or None for all, got {self.channels!r}")

    def ticks(self, dt: float) -> tuple[float, float]:
        """First tick of the fault and first tick after it, which may be infinite."""
        first = math.ceil(self.start / dt - _FAULT_TOLERANCE)
        end = (self.start + self.duration) / dt
        return first, math.ceil(end - _FAULT_TOLERANCE) if math.isfinite(end) else math.inf

    def indices(self, size: int) -> list[int]:
        """Channels of a sensor of `size` channels that fail.

        Raises:
            ParamsError: A channel that the sensor does not have.
        """
        if self.channels is None:
            return list(range(size))
        for channel in self.channels:
            if not 0 <= channel < size:
                raise ParamsError(f"channels: expected 0 to {size - 1}, got {channel}")
        return list(self.channels)


class Sampling(NamedTuple):
    """When a sensor samples and when it fails.

    Attributes:
        dt: Period [s].
        faults: When it fails.
        seed: Of its random numbers.
    """

    dt: float
    faults: tuple[SensorFault, ...] = ()
    seed: int = 0
