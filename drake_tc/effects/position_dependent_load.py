"""A load that depends on the position in a way that no other effect describes."""

from collections.abc import Callable, Mapping

import numpy as np

from drake_tc.effects.base import Context, Parameter, Plausible, Shape, Signals, Signature, TorqueEffect
from drake_tc.effects.kernel import TorqueKernel, TorqueParts
from drake_tc.types import FloatArray

_PIECES = np.array([[1.0, -3.0, 3.0, -1.0], [4.0, 0.0, -6.0, 3.0], [1.0, 3.0, 3.0, -3.0], [0.0, 0.0, 0.0, 1.0]]) / 6.0
"""The four cubic B-splines of one interval as polynomials in u in [0, 1]: row k holds the powers 0 to 3."""


def spline_columns(
    position: FloatArray, start: FloatArray | float, end: FloatArray | float, intervals: int
) -> FloatArray:
    """B (T, intervals + 3): the cubic B-splines over equal intervals of [start, end], which add up to 1.

    Source: de Boor, A Practical Guide to Splines (1978), chapter X.

    Args:
        position: q (T,) [rad]; beyond the range the curve keeps its value at the end.
        start: Of the range [rad].
        end: > start [rad].
        intervals: Number of equal intervals.
    """
    width = (np.asarray(end) - start) / intervals
    place = np.clip((position - start) / width, 0.0, intervals)
    interval = np.minimum(place.astype(np.int64), intervals - 1)
    u = place - interval
    out = np.zeros((position.size, intervals + 3))
    rows = np.arange(position.size)
    for k, (constant, linear, quadratic, cubic) in enumerate(_PIECES):
        out[rows, interval + k] = ((cubic * u + quadratic) * u + linear) * u + constant
    return out


def spline_curve(levels: FloatArray, start: float, end: float) -> Callable[[float], float]:
    """The curve sum_k levels_k B_k(q) of (intervals + 3,) levels at one position: a cubic an interval, by Horner."""
    intervals = levels.size - 3
    cubics = [tuple(map(float, levels[i : i + 4] @ _PIECES)) for i in range(intervals)]
    per_rad = intervals / (end - start)

    def curve(q: float) -> float:
        place = min(max((q - start) * per_rad, 0.0), float(intervals))
        interval = min(int(place), intervals - 1)
        a, b, c, d = cubics[interval]
        u = place - interval
        return a + u * (b + u * (c + u * d))

    return curve


LEVEL_RANGE = Plausible(
    -1.5,
    1.5,
    "a load cannot exceed the largest torques of drive and load together; half as much more is allowed for the levels "
    "beside the ends of the curve",
    "torque",
)
END_RANGE = Plausible(-np.inf, np.inf, "the ends of the curve are those of the recorded positions")
INTERVALS = 4
SIZE = INTERVALS + 3
"""Cubic B-splines over `INTERVALS` equal intervals."""


class PositionDependentLoad(TorqueEffect):
    """sum_k c_k B_k(q) [N m]: a smooth curve over the position, the same in both directions of motion.

    B_k are uniform cubic B-splines over four equal intervals of the recorded positions [q_a, q_b]; they are positive
    and add up to 1, so the curve lies between its smallest and largest coefficient. Beyond q_a and q_b the curve keeps
    its last value: nothing was measured there. Source: de Boor, A Practical Guide to Splines (1978), chapter X.

    The curve is not a cause: it holds cables, springs, gravity, detents and ripples that repeat too rarely to be
    told from a curve. Effects that name a cause have fewer parameters and are preferred where they fit as well.
    """

    id = "position_dependent_load"
    title = "load that depends on the position, of unknown form"
    equation = "tau_add = spline(q, curve_start, curve_end, levels)"
    kind = "load"
    depends_on_position = True
    coefficients = tuple(
        Parameter(f"level_{k + 1}", "N*m", description=f"coefficient {k + 1} of the spline", plausible=LEVEL_RANGE)
        for k in range(SIZE)
    )
    size = ("level", "N*m")
    given_shapes = (
        Parameter("curve_start", "rad", default=-1.0, description="q_a", plausible=END_RANGE),
        Parameter("curve_end", "rad", default=1.0, description="q_b > q_a", plausible=END_RANGE),
    )
    signature = Signature(x="position", split="direction", look_for="one curve for both directions of motion")

    def obstacle(self, context: Context) -> str:
        """Not beside an unknown load, which is such a curve."""
        return context.taken_up or super().obstacle(context)

    def unexcited(self, context: Context) -> str:
        """Needs positions to span."""
        if context.position_span[1] - context.position_span[0] < 1e-3:
            return "the joint does not move far enough to show a curve over the position"
        return ""

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """The recorded positions."""
        return [{"curve_start": context.position_span[0], "curve_end": context.position_span[1]}]

    def inconsistency(self, parameters: Mapping[str, float], context: Context) -> str:
        """The curve has a range to lie over."""
        start, end = parameters["curve_start"], parameters["curve_end"]
        return "" if end > start else f"The curve ends at {end:.3g} rad, before it starts at {start:.3g} rad."

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """B (T, 7): see the class."""
        return spline_columns(signals.position, shape["curve_start"], shape["curve_end"], INTERVALS)

    def kernel(self, parameters: Mapping[str, float]) -> TorqueKernel:
        """The same at one instant: one cubic an interval, by Horner's rule."""
        levels = np.array([parameters[p.name] for p in self.coefficients])
        curve = spline_curve(levels, parameters["curve_start"], parameters["curve_end"])

        def parts(q: float, *_: float) -> TorqueParts:
            return 0.0, 0.0, curve(q)

        return parts
