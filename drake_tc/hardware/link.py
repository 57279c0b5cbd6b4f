"""`RobotLink`: what a controller needs of a robot's driver, and one made of two functions of the user's own.

`WallClock`: the time of a real-time loop, and waiting for a tick.

What a real-time loop asks of its process: signals that stop it, a priority, no pauses for garbage.
"""

import gc
import os
import signal
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Protocol

from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray

Message = Mapping[str, FloatArray]
"""Port to its value."""


class RobotLink(Protocol):
    """The robot as the real-time loop sees it. No call may wait for the robot: the loop calls both in each tick."""

    def read(self) -> Message | None:
        """The newest readings by input port of the controller; None where nothing new has come in."""
        ...

    def write(self, command: Message) -> None:
        """Send a command: "command" (n) of the drives, and "mode" (1), a `GuardMode`."""
        ...

    def stop_requested(self) -> bool:
        """Whether the other end asks the controller to stop."""
        ...

    def close(self) -> None:
        """Called once, after the last command."""
        ...


class CallbackLink:
    """A robot behind two functions.

    Example:
        >>> link = CallbackLink(lambda: {"position": np.zeros(6)}, lambda command: None)
        >>> link.read()["position"].size
        6
    """

    def __init__(self, read: Callable[[], Message | None], write: Callable[[Message], None]) -> None:
        """Keep the functions.

        Args:
            read: As `RobotLink.read`.
            write: As `RobotLink.write`.
        """
        self.read, self.write = read, write

    def stop_requested(self) -> bool:
        """Never: such a robot is stopped by a signal, or by `RealTimeLoop.stop`."""
        return False

    def close(self) -> None:
        """Nothing has to be closed."""


def whole_link(driver: object, name: str = "link") -> RobotLink:
    """The driver as a link: one with `read` and `write` alone never asks for a stop and has nothing to close.

    Args:
        driver: The user's own.
        name: Of it, for the message.

    Raises:
        ParamsError: an object without `read` or `write`.
    """
    parts: dict[str, Any] = {part: getattr(driver, part, None) for part in ("read", "write")}
    missing = [part for part, function in parts.items() if not callable(function)]
    if missing:
        raise ParamsError(f"{name}: expected an object with read() and write(), got none with {missing[0]}()")
    whole: Any = driver
    if all(hasattr(driver, part) for part in ("stop_requested", "close")):
        link: RobotLink = whole
        return link
    return CallbackLink(**parts)


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
