"""What moves, where it goes or turns, and when, as data."""

import math
from dataclasses import dataclass
from itertools import pairwise

from drake_tc.errors import ParamsError


@dataclass(frozen=True)
class TurnSpec:
    """How an orientation turns about an axis of the world: through angles, resting at each, or to and fro.

    Attributes:
        axis: Of any length but zero.
        times: Of the angles [s], increasing, two at least; none for to and fro.
        angles: From its resting orientation [rad], one a time.
        amplitude: Of the motion to and fro [rad]; with no times.
        frequency_hz: Of that [Hz].
        begin: When it starts [s].
        rise: In which its amplitude grows from 0 [s].
    """

    axis: tuple[float, ...]
    times: tuple[float, ...] = ()
    angles: tuple[float, ...] = ()
    amplitude: float = 0.0
    frequency_hz: float = 1.0
    begin: float = 0.0
    rise: float = 1.0

    def __post_init__(self) -> None:
        if len(self.axis) != 3:
            raise ParamsError(f"turn.axis: expected three numbers, got {len(self.axis)}")
        if len(self.times) == 1 or len(self.angles) != len(self.times):
            raise ParamsError(
                f"turn: expected no times, or two or more and as many angles, got {len(self.times)} and"
                f" {len(self.angles)}"
            )
        if self.times and self.amplitude:
            raise ParamsError("turn: expected either times and angles or an amplitude, got both")
        if not all(later > earlier for earlier, later in pairwise(self.times)):
            raise ParamsError(f"turn.times: expected increasing times [s], got {list(self.times)}")


@dataclass(frozen=True)
class KnotSpec:
    """Where a task goes: its resting place moved by offsets, joined smoothly, at rest at both ends; or how it turns.

    Attributes:
        times: Of the knots [s], increasing, two at least.
        offsets: One a knot, [x, y, z] in the world [m].
        turn: In place of knots, for an orientation.
    """

    times: tuple[float, ...] = ()
    offsets: tuple[tuple[float, ...], ...] = ()
    turn: TurnSpec | None = None

    def __post_init__(self) -> None:
        if self.turn is not None and not self.times and not self.offsets:
            return
        if self.turn is not None:
            raise ParamsError("motion: expected either times and offsets or a turn, got both")
        if len(self.times) < 2 or len(self.offsets) != len(self.times):
            raise ParamsError(
                f"motion: expected two times or more and as many offsets, got {len(self.times)} and {len(self.offsets)}"
            )
        if any(len(offset) != 3 for offset in self.offsets):
            raise ParamsError("motion: expected offsets of three numbers [x, y, z]")


@dataclass(frozen=True)
class SpanSpec:
    """A stretch of time, begin <= t < end.

    Attributes:
        begin: Its begin [s].
        end: Its end [s].
    """

    begin: float
    end: float = math.inf

    def __post_init__(self) -> None:
        if not self.begin < self.end:
            raise ParamsError(f"span: expected begin < end [s], got {self.begin:g} and {self.end:g}")
