"""`RobotLink`: what a controller needs of a robot's driver, and one made of two functions of the user's own."""

from collections.abc import Callable, Mapping
from typing import Protocol

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
