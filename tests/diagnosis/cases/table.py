"""All rows, by theme."""

from . import drive, faults, friction, gear, load, robots, sensors, speed_only, timing
from .case import Case

CASES: tuple[Case, ...] = tuple(
    case for theme in (timing, friction, drive, load, sensors, gear, speed_only, faults, robots) for case in theme.CASES
)
WRONG: frozenset[str] = frozenset(
    {
        "drive: a constant torque beside a load 3 % too large",
        "faults: degrees declared as radians are refused",
        "gear: play of 1.2 mrad",
        "load: unknown without a scale, position servo",
        "load: unknown, position servo",
        "sensors: a bias of five tolerances",
        "timing: a torque logged 30 ms late",
        "timing: the same goal is late where the rig file states the hold",
    }
)
"""Rows that are known to be answered wrongly: expected failures, and to be shortened."""
QUICK: frozenset[str] = (
    frozenset(
        {
            "timing: a goal logged after it was written is no delay",
            "load: smooth",
            "sensors: the zero of a current of six tolerances",
        }
    )
    | {case.name for case in CASES if case.refusal} - WRONG
)
"""Three rows, and what is refused. `make test` runs their first seeds; all else is slow."""
