"""A command or effort as it acts at the instants of its samples: shifted in time, or held until the next sample."""

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import CubicSpline

from drake_tc.diagnosis.data.samples import HELD
from drake_tc.types import FloatArray


def aged(effort: FloatArray, segments: Sequence[slice], age: float) -> FloatArray:
    """Command or effort (T,) that is `age` sampling periods older; one that is held is `HELD`, half a period, old.

    Any other age is a shift, as by `delayed`; it is negative for an effort that acted before it was recorded.

    Args:
        effort: (T,) of all segments, end to end.
        segments: Uniform stretches of at least two samples.
        age: [sampling periods].
    """
    return mean_over_hold(effort, segments) if age == HELD else delayed(effort, segments, age)


def delayed(values: FloatArray, segments: Sequence[slice], periods: float) -> FloatArray:
    """Values (T,) of so many sampling periods before; linear between samples, constant beyond the ends of a segment."""
    out = values.copy()
    for s in segments:
        at = np.arange(s.stop - s.start, dtype=float)
        out[s] = np.interp(at - periods, at, values[s])
    return out


def mean_over_hold(effort: FloatArray, segments: Sequence[slice]) -> FloatArray:
    """Mean (T,) of the cubic spline through the samples, from the sample before to each sample; the first one stays.

    It lets a frequency w pass as a hold of one sampling period T does, with sin(wT/2)/(wT/2) = 1 - (wT)^2/24, half a
    period late. The mean of two samples would pass cos(wT/2) = 1 - (wT)^2/8, and a stiffness K would make an inertia of
    K T^2/12 of the difference.
    """
    out = effort.copy()
    for s in segments:
        at = np.arange(s.stop - s.start, dtype=float)
        out[s][1:] = np.diff(CubicSpline(at, effort[s]).antiderivative()(at))
    return out
