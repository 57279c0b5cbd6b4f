"""What references refuse: numbers without sense, directions without length, pieces that do not meet."""

import math

from drake_tc.errors import ParamsError
from drake_tc.kernels.instant import unit

SHORTEST = 1e-6
"""Duration [s]: below it, rates are no numbers any more."""
MEETING = 1e-6
"""Ends as near as this are one [m, or parts of a quaternion]."""


def check_times(what: str, numbers: tuple[float, ...], begin: float, duration: float) -> None:
    """Refuse numbers that are not finite and durations below `SHORTEST`.

    Raises:
        ParamsError: as said.
    """
    if not all(map(math.isfinite, (*numbers, begin))):
        raise ParamsError(f"{what}: expected finite numbers, got {numbers} and begin {begin!r}")
    if not (math.isfinite(duration) and duration > 0.0):
        raise ParamsError(f"{what}: expected a positive duration [s], got {duration!r}")
    if duration < SHORTEST:
        raise ParamsError(f"{what}: expected a duration of at least {SHORTEST:g} s, got {duration!r}")


def check_quaternions(what: str, *quaternions: tuple[float, ...]) -> None:
    """Refuse quaternions without direction.

    Raises:
        ParamsError: not four numbers, all zero, or a length that is no number.
    """
    for quaternion in quaternions:
        if len(quaternion) != 4 or not any(quaternion) or not math.isfinite(math.hypot(*quaternion)):
            raise ParamsError(f"{what}: expected a quaternion [w x y z] that is not zero, got {quaternion}")


def meet(one: tuple[float, ...], other: tuple[float, ...], *, turns: bool) -> bool:
    """Whether two ends are one: places by their distance, quaternions up to length and sign.

    Args:
        one: m numbers.
        other: As many.
        turns: Whether these are quaternions [w x y z].
    """
    if not turns:
        return math.dist(one, other) <= MEETING
    first, second = unit(one), unit(other)
    return min(math.dist(first, second), math.dist(first, [-part for part in second])) <= MEETING
