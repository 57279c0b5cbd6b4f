"""Which of a series-elastic joint's three sensors is late.

A sensor that is late by m ticks is right about the past. With theta before the spring, q behind it, its deflection d by
the gauge, r = theta - q - d, and a hat for what the other two say of a sensor,

    theta^ = q + d,   d^ = theta - q,   q^ = theta - d;   e(m)^2 = mean (x[k-i] - x^[k-i-m])^2,   i < `WINDOW`

it is late if, for some m up to `LATEST`,
    e(m)^2 is below `OF_SPREAD` of the variance of r over the window, and below `OF_OTHERS` of the least e^2 of the
    others;
    x itself has varied by `OF_OWN` of that variance;
    the RMS of r over the window is more than is allowed;
    and r has not jumped by half of that in any tick that is looked at.
An offset does not change r, and so is never taken for a delay. Where a sensor of the same kind is late at another
joint, as on a slow bus, the mean of r^2 counts in place of its variance, however small it is, and no other kind is
called late.
Source: our own.
"""

import numpy as np

from drake_tc.kernels.compiling import helper
from drake_tc.types import FloatArray

LATEST, WINDOW = 40, 40
"""Largest delay that is looked for, and the window over which it must explain the contradiction [ticks]."""
HISTORY = LATEST + WINDOW
OF_SPREAD, OF_OTHERS, OF_OWN = 0.05, 0.25, 0.25
LARGEST = 1e9
"""No reading in SI units is as large."""
THETA, TAU, Q = 0, 1, 2


@helper
def latest_of(row: int, before: float, reading: float, c: float, s: float) -> float:
    """The theta, d or q of a joint by a raw reading; one that is not finite leaves the last value.

    Args:
        row: Which sensor: THETA, TAU or Q.
        before: The value of the tick before.
        reading: theta, tau or q as it came.
        c: Compliance [rad/(N m)].
        s: Share of a new deflection in d [-].
    """
    if not abs(reading) < LARGEST:
        return before
    return before + s * (c * reading - before) if row == TAU else reading


@helper
def misfit_of(past: FloatArray, row: int, late: int) -> float:
    """Mean square over the window of a sensor against what the other two said of it `late` ticks before [rad^2].

    Args:
        past: (3, HISTORY) theta, d and q, the latest first.
        row: Which sensor.
        late: Ticks.
    """
    total = 0.0
    for i in range(WINDOW):
        theta, d, q = past[THETA, i + late], past[TAU, i + late], past[Q, i + late]
        told = q + d if row == THETA else (theta - q if row == TAU else theta - d)
        total += (past[row, i] - told) ** 2
    return total / WINDOW


@helper
def variance_of(values: FloatArray) -> float:
    """Of the window, the latest first."""
    mean = 0.0
    for i in range(WINDOW):
        mean += values[i] / WINDOW
    total = 0.0
    for i in range(WINDOW):
        total += (values[i] - mean) ** 2
    return total / WINDOW


@helper
def late_of(past: FloatArray, allowed: float, known: FloatArray) -> int:
    """Which sensor of a joint is late, or -1 where a delay explains nothing; `past` as in `misfit_of`.

    Args:
        past: (3, HISTORY) theta, d and q, the latest first.
        allowed: Of |r| [rad].
        known: (3,) 1 for a kind of sensor that is late at some joint.
    """
    r, square = past[THETA] - past[Q] - past[TAU], 0.0
    for i in range(HISTORY - 2):
        if abs(r[i] - 2.0 * r[i + 1] + r[i + 2]) > 0.5 * allowed:
            return -1
    for i in range(WINDOW):
        square += r[i] * r[i] / WINDOW
    if square <= allowed * allowed and not known.any():
        return -1
    least, spread = np.full(3, np.inf), variance_of(r)
    for row in range(3):
        if variance_of(past[row]) > OF_OWN * spread:
            for late in range(1, LATEST + 1):
                least[row] = min(least[row], misfit_of(past, row, late))
    which = int(np.argmin(least))
    others = min(least[(which + 1) % 3], least[(which + 2) % 3])
    if known.any() and not known[which]:
        return -1
    explained = square if known[which] else spread
    return which if least[which] < min(OF_SPREAD * explained, OF_OTHERS * others) else -1
