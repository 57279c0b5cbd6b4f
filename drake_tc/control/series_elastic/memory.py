"""What a torque law remembers: the last ticks of a few signals, all joints, newest row last."""

from enum import IntEnum

import numpy as np

from drake_tc.types import FloatArray


class MemoryRow(IntEnum):
    """Rows of one tick: what was sent, read, desired."""

    VOLTAGE = 0
    ANGLE = 1
    TORQUE = 2
    DESIRED = 3
    SHAPED = 4
    LINK = 5
    FASTER = 6
    DRY = 7
    """Voltage sent [V]; motor angle [rad] and torque [N m] as read; desired torque [N m]; the same after shaping, for
    the motor; the link's desired acceleration [rad/s^2]; growth of the motor's desired speed in a tick [rad/s]; its dry
    friction by the model, in the direction in which it will move [N m]."""


MEMORY_ROWS = len(MemoryRow)


def cubic_weights(window: int, ahead: float, derivative: int, dt: float) -> FloatArray:
    """Weights (window,), oldest first, of d^k/dt^k of the least-squares cubic through the samples, at `ahead` ticks.

    A shorter window lowers the order. ahead = 0 is the newest sample; beyond it the cubic is extrapolated, which no
    filter can do for a reference that jumps.

    Args:
        window: Samples N.
        ahead: Where, in ticks after the newest sample.
        derivative: k.
        dt: Period [s].
    """
    order = min(3, window - 1)
    if derivative > order:
        return np.zeros(window)
    powers = np.vander((np.arange(window) - (window - 1.0)), order + 1, increasing=True)
    inverse = np.linalg.pinv(powers)
    factors = [
        0.0 if p < derivative else float(np.prod(np.arange(p, p - derivative, -1))) * ahead ** (p - derivative)
        for p in range(order + 1)
    ]
    return np.asarray(np.array(factors) @ inverse / dt**derivative)


def padded(weights: FloatArray, length: int, newest: int = 0) -> FloatArray:
    """Weights as (length,) on a memory whose last row they miss by `newest` rows."""
    out = np.zeros(length)
    end = length - newest
    out[end - weights.size : end] = weights
    return out
