"""What every limit is: named rows of inequalities at one state."""

from typing import Protocol

from drake_tc.tsid.rows import LimitRows, Terms


class Limit(Protocol):
    """lower <= B y <= upper at a state, y = (vdot, f, tau).

    Attributes:
        name: Of the binding in a program, and of the rows where constraints conflict.
        group: One of "force", "torque", "acceleration", "capture_point".
    """

    @property
    def name(self) -> str:
        """Of the limit."""
        ...

    @property
    def group(self) -> str:
        """Of the limit."""
        ...

    def rows(self, terms: Terms) -> LimitRows:
        """The rows at this state; never raises, a NaN of the state stays one."""
        ...
