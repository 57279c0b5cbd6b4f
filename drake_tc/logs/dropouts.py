"""Stretches in which a sensor or a logger gave exactly 0 for a reading that it did not have.

A sensor that drops out leaves its signal with a leap, reads 0 in one or more rows, and comes back with a leap. One of
the two leaps is small where the signal crosses 0 at that moment.
"""

import numpy as np

from drake_tc.logs.channels import true_spans
from drake_tc.types import BoolArray, FloatArray

LEAP = 5.0
"""A leap into or out of 0, in 99th percentiles of the other steps."""
LEAST_CHANGING = 0.5
"""Share of the other steps that must not be 0: a channel that rests or moves by steps leaps by nature."""
MOST_ZEROS = 0.3
"""Share of rows with 0 above which 0 is a reading like any other."""
UNANSWERED = 1.5
"""A motion that goes on at this many 99th percentiles of its own steps at most has not answered a command of 0."""


def zero_rows(values: FloatArray, apart: BoolArray | None = None) -> BoolArray:
    """Rows (T,) of a channel that dropped out to exactly 0; NaN are none.

    Rows that are `apart` (T,) follow a gap of the clock: what lies between them and the row before is no leap.

    A stretch of zeros counts if it is left, or was entered, with a leap of more than five times the 99th percentile of
    the steps between other rows. Where the channel is 0 for two rows or more without any leap too, the sensor has a
    threshold, and only stretches with both leaps count.
    """
    dropped = np.zeros(values.size, dtype=bool)
    zero = values == 0.0
    if not zero.any() or zero.mean() > MOST_ZEROS:
        return dropped
    steps = np.abs(np.diff(values))
    others = steps[np.isfinite(steps) & ~(zero[1:] | zero[:-1])]
    if others.size < 20 or float(np.mean(others > 0.0)) < LEAST_CHANGING:
        return dropped
    leap = LEAP * float(np.percentile(others, 99))
    stretches = true_spans(zero)
    parted = np.zeros(values.size, dtype=bool) if apart is None else apart
    leaps = [_leaps(values, begin, end, leap, parted) for begin, end in stretches]
    natural = any(end - begin > 1 and not count for (begin, end), count in zip(stretches, leaps, strict=True))
    for (begin, end), count in zip(stretches, leaps, strict=True):
        if count > natural:
            dropped[begin:end] = True
    return dropped


def unanswered_zeros(command: FloatArray, position: FloatArray, apart: BoolArray | None = None) -> BoolArray:
    """Rows (T,) in which a position command was logged as 0 while the joint moved on as before.

    Both leaps must be there, the command must come back to where it was going, and the position must not answer. A
    command of 0 that was sent moves the joint, and is a command like any other.
    """
    dropped = zero_rows(command, apart)
    if not dropped.any():
        return dropped
    usual, pace = (_usual_step(values, dropped) for values in (position, command))
    for begin, end in true_spans(dropped):
        length = end - begin
        if begin == 0 or end == command.size:
            dropped[begin:end] = False
            continue
        returned = abs(command[end] - command[begin - 1]) <= pace * (length + 1)
        moved = np.abs(np.diff(position[begin - 1 : min(end + length, position.size)]))
        if not returned or np.nanmax(moved, initial=0.0) > UNANSWERED * usual:
            dropped[begin:end] = False
    return dropped


def _leaps(values: FloatArray, begin: int, end: int, leap: float, apart: BoolArray) -> int:
    """How many of the two ends of a stretch are leaps; the end of a log is none, and a gap of the clock is none."""
    before = values[begin - 1] if begin and not apart[begin] else 0.0
    sides = (before, values[end] if end < values.size and not apart[end] else 0.0)
    return sum(bool(abs(side) > leap) for side in sides)


def _usual_step(values: FloatArray, without: BoolArray) -> float:
    """The 99th percentile of the steps (T - 1,) outside of rows (T,)."""
    steps = np.abs(np.diff(values))[~(without[1:] | without[:-1])]
    steps = steps[np.isfinite(steps)]
    return float(np.percentile(steps, 99)) if steps.size else 0.0
