"""A sensor that fails for a while: `SensorFault`, and how a scenario lists them."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, get_args

from drake_tc.errors import ParamsError
from drake_tc.robot.fields import mapping, number

FaultKind = Literal["frozen", "dropped", "biased", "nan", "spikes"]
KINDS: tuple[str, ...] = get_args(FaultKind)

SPIKE_CHANCE = 0.05
"""One sample in twenty."""
_SIZED = {"biased": "bias", "spikes": "spikes"}
_TICK_TOLERANCE = 1e-6


@dataclass(frozen=True)
class SensorFault:
    """What fails, when, on which channels. Active at the ticks n with start <= n dt < start + duration.

    Attributes:
        kind: `frozen` repeats the last finite reading, noise included; `dropped` and `nan` read NaN (the sample does
            not come; it comes as NaN); `biased` adds `value` to the reading before quantisation, `spikes` adds or
            takes it off at single samples of a channel, drawn from the sensor's seed.
        start: [s], time of the scenario.
        duration: [s]; infinite for good.
        channels: Indices; None for all.
        value: Size of the bias, or of the spikes [unit of the signal].
        chance: Of a sample to be a spike [-]; 0.05 where it is not given.

    Raises:
        ParamsError: A value that is not possible.
    """

    kind: FaultKind
    start: float = 0.0
    duration: float = math.inf
    channels: tuple[int, ...] | None = None
    value: float = 0.0
    chance: float = SPIKE_CHANCE

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ParamsError(f"SensorFault.kind: wanted one of {', '.join(KINDS)}; got {self.kind!r}")
        if not math.isfinite(self.start):
            raise ParamsError(f"SensorFault.start: wanted a time [s]; got {self.start!r}")
        if not self.duration > 0.0:
            raise ParamsError(f"SensorFault.duration: wanted a time > 0 [s], or .inf; got {self.duration!r}")
        if not math.isfinite(self.value):
            raise ParamsError(f"SensorFault.value: wanted a finite number; got {self.value!r}")
        if self.kind in _SIZED and self.value == 0.0:
            raise ParamsError(f"SensorFault.value: wanted the size of the {_SIZED[self.kind]}; got 0")
        if self.kind not in _SIZED and self.value != 0.0:
            raise ParamsError(
                f"SensorFault.value: wanted only with kind {' or '.join(_SIZED)}; got {self.value:g} with {self.kind}"
            )
        if not 0.0 < self.chance <= 1.0:
            raise ParamsError(f"SensorFault.chance: wanted a probability above 0, 1 at most; got {self.chance!r}")
        if self.kind != "spikes" and self.chance != SPIKE_CHANCE:
            raise ParamsError(f"SensorFault.chance: wanted only with kind spikes; got it with {self.kind}")
        if self.channels is not None and (not self.channels or len(set(self.channels)) < len(self.channels)):
            raise ParamsError(f"SensorFault.channels: wanted different indices, or None for all; got {self.channels!r}")

    def ticks(self, dt: float) -> tuple[float, float]:
        """First tick of the fault and first tick after it, which may be infinite."""
        first = math.ceil(self.start / dt - _TICK_TOLERANCE)
        end = (self.start + self.duration) / dt
        return first, math.ceil(end - _TICK_TOLERANCE) if math.isfinite(end) else math.inf

    def indices(self, size: int) -> list[int]:
        """Channels of a sensor of `size` channels that fail.

        Raises:
            ParamsError: A channel that the sensor does not have.
        """
        if self.channels is None:
            return list(range(size))
        for channel in self.channels:
            if not 0 <= channel < size:
                raise ParamsError(f"SensorFault.channels: wanted 0 to {size - 1}; got {channel}")
        return list(self.channels)


def _load_fault(where: str, entry: object) -> SensorFault:
    fields = mapping(where, entry, ("kind",), ("start", "duration", "channels", "value", "chance"))
    channels = fields.get("channels")
    if channels is not None:
        if not isinstance(channels, list) or not all(type(channel) is int for channel in channels):
            raise ParamsError(f"{where}.channels: wanted a list of indices; got {channels!r}")
        channels = tuple(channels)
    try:
        return SensorFault(
            fields["kind"],
            number(f"{where}.start", fields.get("start", 0.0)),
            number(f"{where}.duration", fields.get("duration", math.inf), infinite=True),
            channels,
            number(f"{where}.value", fields.get("value", 0.0)),
            number(f"{where}.chance", fields.get("chance", SPIKE_CHANCE)),
        )
    except ParamsError as error:
        text = str(error)
        raise ParamsError(text if text.startswith(where) else f"{where}: {text}") from None


def load_faults(where: str, entry: object, sensors: Iterable[str]) -> dict[str, tuple[SensorFault, ...]]:
    """Faults of a scenario: a mapping of sensor to a list of faults.

        encoder: [{kind: frozen, start: 1.0, duration: 0.02, channels: [3]}]
        imu: [{kind: nan, start: 2.0}]

    Args:
        where: File and field, for the error.
        entry: From YAML; None is no faults.
        sensors: Names that are possible.

    Returns:
        Every sensor's faults, () where none are given.

    Raises:
        ParamsError: An unknown sensor, key or kind, or an impossible value; one line that starts with `where`.
    """
    names = list(sensors)
    faults: dict[str, tuple[SensorFault, ...]] = dict.fromkeys(names, ())
    for name, listed in mapping(where, entry, (), names).items():
        if not isinstance(listed, list):
            raise ParamsError(f"{where}.{name}: wanted a list of faults; got {listed!r}")
        faults[name] = tuple(_load_fault(f"{where}.{name}[{i}]", one) for i, one in enumerate(listed))
    return faults
