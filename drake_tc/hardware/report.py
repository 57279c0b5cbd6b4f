"""`RunReport`: how a real-time run ended, what went wrong and how often, and how late its ticks were."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Literal

import numpy as np

from drake_tc.types import FloatArray

Ending = Literal["duration", "signal", "stop message", "stopped", "no readings"]
"""What ended a run: its duration; a signal; the robot's stop message; `RealTimeLoop.stop`; no sound readings at all."""
SHARES = {"median": 50.0, "p99": 99.0, "p99_9": 99.9, "max": 100.0}
"""Name to percentile."""


@dataclass
class Counts:
    """What happened, in ticks.

    Attributes:
        ticks: Ticks of the controller.
        missed: Ticks that were not done when the next one was due.
        skipped: Ticks that were left out for it.
        late: Ticks without new readings, which took the last ones.
        missing: Ticks whose last readings were older than `max_age`; the stages were told that there are none.
        malformed: Readings with a port that is not there, or of another size; such a port counts as missing.
        held: Ticks in which the last guard, or the one of the controller, held or damped.
        link_errors: Exceptions of the link.
        controller_errors: Exceptions of the controller.
    """

    ticks: int = 0
    missed: int = 0
    skipped: int = 0
    late: int = 0
    missing: int = 0
    malformed: int = 0
    held: int = 0
    link_errors: int = 0
    controller_errors: int = 0


@dataclass(frozen=True, eq=False, kw_only=True)
class RunReport:
    """What a real-time run comes to.

    Attributes:
        ended: What ended it.
        seconds: Wall time from the first command to the last [s].
        counts: What happened.
        wake: (T,) how late a tick began after it was due [s].
        work: (T,) how long it took [s].
        last_error: Of link or controller; empty without one.
        flags: Flag of the controller's fault monitor that was up, to the ticks in which it was.
    """

    ended: Ending
    seconds: float
    counts: Counts
    wake: FloatArray
    work: FloatArray
    last_error: str = ""
    flags: Mapping[str, int] = field(default_factory=dict)
    period: float = 1e-3

    @property
    def miss_share(self) -> float:
        """Share of ticks that missed their deadline [-]."""
        return self.counts.missed / max(self.counts.ticks, 1)

    def percentiles(self) -> dict[str, dict[str, float]]:
        """Of `wake` and `work` [s]: median, p99, p99_9, max; NaN without a tick."""
        return {
            name: {
                share: float(np.percentile(times, at)) if times.size else float("nan") for share, at in SHARES.items()
            }
            for name, times in (("wake", self.wake), ("work", self.work))
        }

    def to_json(self) -> dict[str, Any]:
        """As plain data."""
        counts = {each.name: getattr(self.counts, each.name) for each in fields(Counts)}
        told = {"ended": self.ended, "seconds": self.seconds, "period": self.period, "last_error": self.last_error}
        return told | {
            "counts": counts,
            "flags": dict(self.flags),
            "miss_share": self.miss_share,
            "times": self.percentiles(),
        }
