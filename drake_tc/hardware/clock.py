"""`WallClock`: the time of a real-time loop, and waiting for a tick."""

import time
from typing import Protocol


class Clock(Protocol):
    """Time and waiting, so that a test needs no wall clock."""

    def now(self) -> float:
        """Time [s]."""
        ...

    def wait_until(self, when: float) -> None:
        """Return at `when` [s], or at once where that is past."""
        ...


class WallClock:
    """The monotonic clock of the system.

    It sleeps until `spin` before the time, and looks at the clock for the rest: a system that is no real-time system
    wakes a thread some ten microseconds late.
    """

    def __init__(self, spin: float = 0.0) -> None:
        """Keep the time to spin [s]."""
        self._spin = spin

    def now(self) -> float:
        """Time [s]."""
        return time.perf_counter()

    def wait_until(self, when: float) -> None:
        """Return at `when` [s], or at once where that is past."""
        left = when - self._spin - time.perf_counter()
        if left > 0.0:
            time.sleep(left)
        while time.perf_counter() < when:
            pass
