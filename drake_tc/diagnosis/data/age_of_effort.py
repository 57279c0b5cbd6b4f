"""A command or effort as it acts at the instants of its samples: shifted in time, or held until the next sample."""

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import CubicSpline

from drake_tc.diagnosis.data.samples import HELD
from drake_tc.types import FloatArray


def aged(effort: FloatArray, segments: Sequence[slice], age: float) -> FloatArray:
    """Command or effort (T,) that is `age` sampling periods older.

    One that is older is held for a period, as by `mean_over_hold`: one that is held from its sample to the next is
    `HELD`, half a period, old, and one that was written before or after its sample is older or less old than that.
    One that acted before it was recorded has a negative age and is shifted, as by `delayed`.

    Args:
        effort: (T,) of all segments, end to end.
        segments: Uniform stretches of at least two samples.
        age: [sampling periods].
    """
    return mean_over_hold(effort, segments, age) if age > 0.0 else delayed(effort, segments, age)


def delayed(values: FloatArray, segments: Sequence[slice], periods: float) -> FloatArray:
    """Values (T,) of so many sampling periods before, on the cubic spline through the samples of each segment.

    Constant beyond the ends of a segment. A straight line between two samples would pass a frequency w at half a period
    with cos(wT/2) = 1 - (wT)^2/8: at 50 Hz, a sine of 2 Hz would be 0.8 % too small, and with it an inertia.
    """
    out = values.copy()
    if periods == 0.0:
        return out
    for s in segments:
        at = np.arange(s.stop - s.start, dtype=float)
        out[s] = CubicSpline(at, values[s])(np.clip(at - periods, 0.0, at[-1]))
    return out


def mean_over_hold(effort: FloatArray, segments: Sequence[slice], age: float = HELD) -> FloatArray:
    """Mean (T,) over one sampling period of the cubic spline through the samples, which is `age` periods old.

    It lets a frequency w pass as a hold of one sampling period T does, with sin(wT/2)/(wT/2) = 1 - (wT)^2/24. The mean
    of two samples would pass cos(wT/2) = 1 - (wT)^2/8, and a stiffness K would make an inertia of K T^2/12 of the
    difference. Beyond the ends of a segment the spline is constant.
    """
    out = effort.copy()
    for s in segments:
        at = np.arange(s.stop - s.start, dtype=float)
        spline = CubicSpline(at, effort[s])
        integral = spline.antiderivative()
        ends = [at - age + HELD, at - age - HELD]  # of the period
        inside = [np.clip(end, 0.0, at[-1]) for end in ends]
        until = [
            integral(held) + np.where(end < held, effort[s][0], effort[s][-1]) * (end - held)
            for end, held in zip(ends, inside, strict=True)
        ]
        out[s] = until[0] - until[1]
    return out
