"""A command or effort as it acts at the instants of its samples: shifted in time, and held where it is older."""

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import CubicSpline

from drake_tc.types import FloatArray


def aged(effort: FloatArray, segments: Sequence[slice], age: float) -> FloatArray:
    """Command or effort (T,) that is `age` sampling periods older.

    With c(t) the cubic spline through the samples of a segment, constant beyond its ends, and t in sampling periods T:

        age > 0   mean of c from t - age - 1/2 to t - age + 1/2: a value that is held for one period
        age = 0   c(t), the samples
        age < 0   c(t - age): the effort acted before it was recorded

    A hold lets a frequency w pass with sin(wT/2)/(wT/2) = 1 - (wT)^2/24, as this mean does. The mean of two samples
    passes cos(wT/2) = 1 - (wT)^2/8: a stiffness K makes an inertia of K T^2/12 of the difference.

    Args:
        effort: (T,) of all segments, end to end.
        segments: Uniform stretches of at least two samples.
        age: [sampling periods].
    """
    out = effort.copy()
    if age == 0.0:
        return out
    for s in segments:
        last = float(s.stop - s.start - 1)
        curve = CubicSpline(np.arange(s.stop - s.start), effort[s])
        at = np.arange(s.stop - s.start) - age
        out[s] = _mean_while_held(curve, at, last) if age > 0.0 else curve(np.clip(at, 0.0, last))
    return out


def _mean_while_held(curve: CubicSpline, centre: FloatArray, last: float) -> FloatArray:
    """Mean of a curve from 0 to `last`, constant beyond, over the hold around each centre (T,)."""
    total = curve.antiderivative()

    def integral(at: FloatArray) -> FloatArray:
        inside = np.clip(at, 0.0, last)
        beyond = np.minimum(at, 0.0) * curve(0.0) + np.maximum(at - last, 0.0) * curve(last)
        return np.asarray(total(inside) + beyond)

    return integral(centre + 0.5) - integral(centre - 0.5)
