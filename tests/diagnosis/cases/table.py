"""All rows, by theme."""

from . import drive, faults, friction, gear, load, robots, sensors, speed_only, timing
from .case import Case

CASES: tuple[Case, ...] = tuple(
    case for theme in (timing, friction, drive, load, sensors, gear, speed_only, faults, robots) for case in theme.CASES
)
ENGINES: tuple[str, ...] = ("rules",)
"""Engines that the tests hold to the table."""
