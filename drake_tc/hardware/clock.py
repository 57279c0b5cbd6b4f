"""`WallClock`: the time of a real-time loop, and waiting for a tick; the priority with which it is woken."""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from drake_tc.errors import ParamsError


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


@contextmanager
def real_time_priority(priority: int) -> Iterator[None]:
    """Run before all processes without a real-time priority (SCHED_FIFO).

    Args:
        priority: From 1 to 99; 0 leaves everything as it is.

    Raises:
        ParamsError: a system or a user that may not.
    """
    if priority == 0:
        yield
        return
    try:
        policy, before = os.sched_getscheduler(0), os.sched_getparam(0)
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except (AttributeError, OSError) as error:
        raise ParamsError(
            f"priority: expected 0, or 1 to 99 with the right to real-time scheduling (`ulimit -r`, CAP_SYS_NICE), got"
            f" {priority}: {error}"
        ) from None
    try:
        yield
    finally:
        os.sched_setscheduler(0, policy, before)
