"""What a sensor does to the truth, as numbers: `SensorSpec`."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeAlias

import numpy as np

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
