"""What a real-time loop asks of its process: signals that stop it, a priority, no pauses for garbage."""

import gc
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from drake_tc.errors import ParamsError


@contextmanager
def stopping_signals(stop: Callable[[], None]) -> Iterator[None]:
    """SIGINT and SIGTERM call `stop`; a second one ends the process as it always does.

    Outside of the main thread, which alone can take signals, nothing happens.
    """
    before: dict[signal.Signals, Any] = {}

    def handle(number: int, frame: object) -> None:
        stop()
        signal.signal(number, before[signal.Signals(number)])

    try:
        for number in (signal.SIGINT, signal.SIGTERM):
            before[number] = signal.getsignal(number)
            signal.signal(number, handle)
    except ValueError:  # not the main thread
        before.clear()
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def paused_garbage_collection() -> Iterator[None]:
    """No collection of cycles, which would take milliseconds, while the loop runs; reference counts work on."""
    enabled = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


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
