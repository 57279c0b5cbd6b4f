"""What a sensor does to the truth, as numbers: `SensorSpec`."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any, TypeAlias

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.robot.fields import mapping, number
from drake_tc.types import FloatArray

Channels: TypeAlias = float | tuple[float, ...]
"""One value for all channels, or one a channel."""

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
                raise ParamsError(f"SensorSpec.{field.name}: wanted finite numbers; got {value!r}")
            if field.name in ("noise", "resolution", "latency") and min(each) < 0.0:
                raise ParamsError(f"SensorSpec.{field.name}: wanted numbers >= 0; got {value!r}")
            if isinstance(value, tuple):
                sizes[field.name] = len(value)
        if isinstance(self.latency, tuple):
            raise ParamsError(f"SensorSpec.latency: wanted one number for all channels; got {self.latency!r}")
        dropout = self.channels("dropout", sizes.get("dropout", 1))
        if dropout.min() < 0.0 or dropout.max() > 1.0:
            raise ParamsError(f"SensorSpec.dropout: wanted a probability, 0 to 1; got {self.dropout!r}")
        if len(set(sizes.values())) > 1:
            listed = ", ".join(f"{name} {size}" for name, size in sizes.items())
            raise ParamsError(f"SensorSpec: wanted one number of channels; got {listed}")

    def channels(self, name: str, size: int) -> FloatArray:
        """(size,) values of a field, one a channel.

        Raises:
            ParamsError: The field is given for another number of channels.
        """
        value = getattr(self, name)
        if isinstance(value, tuple) and len(value) != size:
            raise ParamsError(f"SensorSpec.{name}: wanted one value, or {size}; got {len(value)}")
        return np.array(np.broadcast_to(value, size), dtype=np.float64)

    def ticks(self, dt: float) -> int:
        """The latency in ticks.

        Raises:
            ParamsError: It is no whole number of ticks, within 1e-6 of a tick.
        """
        ticks = self.latency / dt
        if abs(ticks - round(ticks)) > _TICK_TOLERANCE:
            below, above = math.floor(ticks) * dt, math.ceil(ticks) * dt
            raise ParamsError(
                f"SensorSpec.latency: wanted a multiple of the period {dt:g} s; got {self.latency:g} s;"
                f" nearest: {below:g} and {above:g}"
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
        raise ParamsError(f"SensorSpec.latency: wanted one for all parts of a sensor; got {sorted(latencies)}")
    values: dict[str, Any] = {
        name: tuple(np.concatenate([spec.channels(name, size) for spec, size in parts]).tolist())
        for name in ("noise", "bias", "scale", "resolution", "dropout")
    }
    return SensorSpec(latency=latencies.pop(), **values)


def load_spec(where: str, entry: object, default: SensorSpec | None = None) -> SensorSpec:
    """A spec from a YAML mapping; keys that are not given keep the default's value.

    Args:
        where: File and field, for the error.
        entry: Mapping of the fields of SensorSpec to a number or a list of numbers.
        default: None is the perfect sensor.

    Raises:
        ParamsError: An unknown key or an impossible value; the message starts with `where`.
    """
    values: dict[str, Any] = asdict(default or SensorSpec())
    for key, value in mapping(where, entry, (), [field.name for field in fields(SensorSpec)]).items():
        at = f"{where}.{key}"
        if isinstance(value, list):
            values[key] = tuple(number(f"{at}[{i}]", item) for i, item in enumerate(value))
        else:
            values[key] = number(at, value)
    try:
        return SensorSpec(**values)
    except ParamsError as error:
        raise ParamsError(f"{where}: {error}") from None
