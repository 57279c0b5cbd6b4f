"""The step from 0 to 1 that references take, with three derivatives that vanish at both ends, for many samples."""

from typing import NamedTuple

import numpy as np

from drake_tc.types import FloatArray


class Motion(NamedTuple):
    """A motion and its derivatives in time, (T, m) each: places, or angles and their rates in the world."""

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray


def smooth_step(time: FloatArray, begin: float, duration: float) -> FloatArray:
    """(4, T): s(u) and its first three derivatives in time, u = (t - begin)/duration, 0 before and 1 after.

    Args:
        time: (T,) [s].
        begin: When it starts to rise [s].
        duration: > 0, how long it does [s].
    """
    u = np.clip((np.asarray(time, dtype=np.float64) - begin) / duration, 0.0, 1.0)
    left = 1.0 - u
    value = u**4 * (35.0 + u * (-84.0 + u * (70.0 - 20.0 * u)))
    first = 140.0 * (u * left) ** 3
    second = 420.0 * (u * left) ** 2 * (1.0 - 2.0 * u)
    third = 840.0 * u * left * (1.0 - 5.0 * u * left)
    return np.stack([value, first / duration, second / duration**2, third / duration**3])
