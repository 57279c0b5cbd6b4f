"""Convex programs inside linear limits as data: what `newton.minimise` solves (`drake_tc.kernels.programs`)."""

from typing import NamedTuple

import numpy as np

from drake_tc.kernels.lazy import Kernel
from drake_tc.tsid.polytope import LeastSquares
from drake_tc.tsid.robust.scaled import Rows
from drake_tc.types import FloatArray

PLAIN, RECTANGLE = 0, 1
_DESCRIBED, _WRITTEN_OUT = Kernel("searches", "described"), Kernel("searches", "written_out")
_NONE: FloatArray = np.zeros((0, 0))
_NOTHING: FloatArray = np.zeros(0)


class Value(NamedTuple):
    """The objective at one x (N,).

    Attributes:
        value: f.
        risk: R.
        gradient: (N,).
        hessian: (N, N), with the damping that makes it positive definite.
        slope, bend: (m,) derivatives of R_ind by each row's own A_i x.
    """

    value: float
    risk: float
    gradient: FloatArray
    hessian: FloatArray
    slope: FloatArray
    bend: FloatArray


class ConvexProgram(NamedTuple):
    """An objective and its limits, over x (N,); use `plain` or `rectangle` to make one.

    Attributes:
        kind: PLAIN or RECTANGLE.
        matrix: (m, n) A of the limits.
        noise: (m, r) K of a rectangle.
        held: (m,) sides that a rectangle's x itself keeps: 1 the upper, -1 the lower, 0 none.
        cost: D, d.
        linear: (N,) c.
        risk: Rows of R_ind.
        weight: w.
        damping: Added to the Hessian's diagonal.
        width: Least width of a rectangle along each axis [sigma].
        lower, upper: (m,) of the limits.
        bounds: How many leading limits are bounds on x itself.
    """

    kind: int
    matrix: FloatArray
    noise: FloatArray
    held: FloatArray
    cost: LeastSquares
    linear: FloatArray
    risk_lower: FloatArray
    risk_upper: FloatArray
    weight: float
    damping: float
    width: float
    lower: FloatArray
    upper: FloatArray
    bounds: int = 0

    @property
    def bends(self) -> bool:
        """Whether the Hessian changes with x."""
        return self.weight > 0.0

    def arguments(self, *search: float) -> tuple[object, ...]:
        """Of the compiled functions; search: accuracy, steps until it pauses, how it begins."""
        numbers = np.array((self.weight, self.damping, self.width, *search))
        sides = self.risk_lower, self.risk_upper
        cost = self.cost
        return self.kind, self.matrix, self.noise, self.held, cost.matrix, cost.target, self.linear, *sides, numbers

    def at(self, x: FloatArray) -> Value:
        """The objective at x (N,)."""
        return Value(*_DESCRIBED(*self.arguments(), x))

    def rows(self) -> Rows:
        """The limits over all N variables, written out."""
        if self.kind == PLAIN:
            return Rows(self.matrix, self.lower, self.upper, self.bounds)
        return Rows(*_WRITTEN_OUT(*self.arguments(), self.lower, self.upper))


def plain(
    cost: LeastSquares,
    limits: Rows,
    *,
    linear: FloatArray | None = None,
    risk: Rows | None = None,
    weight: float = 0.0,
    damping: float = 0.0,
) -> ConvexProgram:
    """||D x - d||^2 + c^T x + w R_ind(x) inside limits.

    Args:
        cost: D, d.
        limits: lower <= A x <= upper.
        linear: (n,) c; None for 0.
        risk: Rows of R_ind: the limits with sides that may be farther off; None for w = 0.
        weight: w.
        damping: Added to the Hessian's diagonal.
    """
    sides = (_NOTHING, _NOTHING) if risk is None else (risk.lower, risk.upper)
    return ConvexProgram(
        PLAIN,
        limits.matrix,
        _NONE,
        _NOTHING,
        cost,
        _NOTHING if linear is None else linear,
        *sides,
        0.0 if risk is None else weight,
        damping,
        0.0,
        limits.lower,
        limits.upper,
        limits.bounds,
    )


def rectangle(
    cost: LeastSquares, limits: Rows, noise: FloatArray, held: FloatArray, width: float, weight: float
) -> ConvexProgram:
    """||D x - d||^2 + w R_rect over (x, a, b), its box inside limits (Del Prete and Mansard, 2015, eq. 15 and 16).

    Args:
        cost: D, d.
        limits: lower <= A x <= upper.
        noise: (m, r) K.
        held: (m,) sides that x itself is to keep.
        width: Least width of the box along each axis [sigma].
        weight: w.
    """
    sides = limits.lower, limits.upper
    return ConvexProgram(
        RECTANGLE, limits.matrix, noise, held, cost, _NOTHING, _NOTHING, _NOTHING, weight, 0.0, width, *sides
    )
