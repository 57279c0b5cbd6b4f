"""A sensor that fails for a while: `SensorFault`."""

import math
from dataclasses import dataclass
from typing import Literal

from drake_tc.config.records import check_choices
from drake_tc.errors import ParamsError

FaultKind = Literal["frozen", "dropped", "biased", "nan", "spikes", "late"]

SPIKE_CHANCE = 0.05
"""One sample in twenty."""
_SIZED = {"biased": "bias", "spikes": "spikes", "late": "delay [s]"}
_TICK_TOLERANCE = 1e-6


@dataclass(frozen=True)
class SensorFault:
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
    start: float = 0.0
    duration: float = math.inf
    channels: tuple[int, ...] | None = None
    value: float = 0.0
    chance: float = SPIKE_CHANCE

    def __post_init__(self) -> None:
        check_choices(self)
        if not math.isfinite(self.start):
            raise ParamsError(f"start: expected a time [s], got {self.start!r}")
        if not self.duration > 0.0:
            raise ParamsError(f"duration: expected a time > 0 [s], or .inf, got {self.duration!r}")
        if not math.isfinite(self.value):
            raise ParamsError(f"value: expected a finite number, got {self.value!r}")
        if self.kind in _SIZED and self.value == 0.0:
            raise ParamsError(f"value: expected the size of the {_SIZED[self.kind]}, got 0")
        if self.kind == "late" and self.value < 0.0:
            raise ParamsError(f"value: expected an additional age > 0 [s], got {self.value:g}")
        if self.kind not in _SIZED and self.value != 0.0:
            raise ParamsError(
                f"value: expected only with kind {' or '.join(_SIZED)}, got {self.value:g} with {self.kind}"
            )
        if not 0.0 < self.chance <= 1.0:
            raise ParamsError(f"chance: expected a probability above 0, 1 at most, got {self.chance!r}")
        if self.kind != "spikes" and self.chance != SPIKE_CHANCE:
            raise ParamsError(f"chance: expected only with kind spikes, got it with {self.kind}")
        if self.channels is not None and (not self.channels or len(set(self.channels)) < len(self.channels)):
            raise ParamsError(f"channels: expected different indices, or None for all, got {self.channels!r}")

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
                raise ParamsError(f"channels: expected 0 to {size - 1}, got {channel}")
        return list(self.channels)
