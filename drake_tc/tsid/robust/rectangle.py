"""p_rect: the most probable axis-aligned box inside the polytope (Del Prete and Mansard, 2015, eq. 14 to 16).

The box is -b_j <= zeta_j <= a_j in the axes of e = L zeta (see `TorqueError`), so that its probability is a product for
a full Sigma too. With a diagonal Sigma these are the joints: s_j = a_j sigma_j, s_(j+n) = -b_j sigma_j.
"""

import math

import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtrs

from drake_tc.tsid.polytope import LeastSquares
from drake_tc.tsid.robust.factor import Factor
from drake_tc.tsid.robust.interval import interval_risk, interval_slopes
from drake_tc.tsid.robust.objective import DAMPING
from drake_tc.tsid.robust.scaled import Rows
from drake_tc.types import FloatArray, IntArray

SIDE_DAMPING = 1e-6
"""Curvature, over w, of a side that nothing holds and that gains nothing any more."""


class RectangleRows:
    """Rows over (x, a, b): the corner that is worst for each side stays inside (eq. 15); 2 m, r and h rows.

        A x + K+ a + K- b <= upper, -A x + K- a + K+ b <= -lower, K+- the positive and negative parts of the noise K
        a + b >= width                                            the paper's epsilon

    As K+ a + K- b = |K| (a + b) / 2 + K (a - b) / 2, a product costs three of half the height and no copies.

    Attributes:
        lower: None.
        upper: (2 m + r + h,).
    """

    lower = None

    def __init__(self, limits: Rows, noise: FloatArray, held: FloatArray, width: float) -> None:
        """Prepare.

        Args:
            limits: A (m, n), lower, upper.
            noise: (m, r) K.
            held: (m,) sides that x itself is to keep: 1 the upper, -1 the lower, 0 none; h are not 0.
            width: Least width of the box along each axis [sigma].
        """
        self._matrix, self._noise, self._size = limits.matrix, noise, np.abs(noise)
        self._kept = np.flatnonzero(held)
        self._sign = held[self._kept]
        ends = np.where(self._sign > 0.0, limits.upper[self._kept], -limits.lower[self._kept])
        widths = np.full(noise.shape[1], -width)
        self.upper: FloatArray = np.concatenate((limits.upper, -limits.lower, widths, ends))

    def times(self, x: FloatArray) -> FloatArray:
        """See `RowProduct`."""
        n, r = self._matrix.shape[1], self._noise.shape[1]
        above, below = x[n : n + r], x[n + r :]
        own, width = self._matrix @ x[:n], above + below
        value = self._noise @ (0.5 * (above - below))
        value += own
        room = self._size @ (0.5 * width)
        return np.concatenate((room + value, room - value, -width, self._sign * own[self._kept]))

    def take(self, rows: IntArray) -> FloatArray:
        """See `RowProduct`."""
        (m, n), r = self._matrix.shape, self._noise.shape[1]
        below = rows >= m
        index, sign = rows - m * below, 1.0 - 2.0 * below
        beyond = np.flatnonzero(rows >= 2 * m)
        index[beyond] = 0
        some = np.empty((len(rows), n + 2 * r))
        np.multiply(self._matrix[index], sign[:, None], out=some[:, :n])
        noise = some[:, :n] if self._noise is self._matrix else self._noise[index] * sign[:, None]
        np.maximum(noise, 0.0, out=some[:, n : n + r])
        np.subtract(some[:, n : n + r], noise, out=some[:, n + r :])
        for i in beyond:
            some[i] = 0.0
            row = int(rows[i]) - 2 * m
            if row < r:
                some[i, [n + row, n + r + row]] = -1.0
            else:
                some[i, :n] = self._sign[row - r] * self._matrix[self._kept[row - r]]
        return some

    def dense(self) -> Rows:
        """See `RowProduct`."""
        count = len(self.upper)
        return Rows(self.take(np.arange(count)), np.full(count, -np.inf), self.upper)


class RectangleObjective:
    """f(x, a, b) = ||D x - d||^2 - w sum_j log(Phi(a_j) - Phi(-b_j)), convex.

    Attributes:
        cost: D, d.
        axes: r.
        weight: w.
        rounding: About the error of f by rounding.
        bends: True.
    """

    bends = True

    def __init__(self, cost: LeastSquares, axes: int, weight: float) -> None:
        self.cost, self.axes, self.weight = cost, axes, weight
        self.rounding = 1e-15 * float(cost.target @ cost.target) + 1e-12 * weight
        quadratic = cost.matrix.T @ cost.matrix
        quadratic += quadratic
        diagonal = quadratic.ravel()[:: quadratic.shape[0] + 1]
        diagonal += SIDE_DAMPING * weight + DAMPING * float(diagonal.max(initial=0.0))
        self.quadratic: FloatArray = quadratic
        self.lower: FloatArray
        self.lower, failed = dpotrf(quadratic, lower=1) if len(quadratic) else (quadratic, 0)
        self.failed = bool(failed)

    def at(self, x: FloatArray) -> "RectanglePoint":
        """F and what its derivatives need."""
        return RectanglePoint(self, x)


class RectanglePoint:
    """The objective at one (x, a, b).

    Attributes:
        x: (n + 2 r,).
        value: f; inf for a box that is empty.
        risk: -log of the box's probability.
    """

    __slots__ = ("_objective", "_residual", "_risks", "_slopes", "risk", "value", "x")

    def __init__(self, objective: RectangleObjective, x: FloatArray) -> None:
        self.x, self._objective = x, objective
        r = objective.axes
        n = len(x) - 2 * r
        self._residual = objective.cost.matrix @ x[:n] - objective.cost.target
        self._risks = interval_risk(x[n : n + r], x[n + r :])
        self._slopes: tuple[FloatArray, ...] | None = None
        self.risk = float(self._risks.sum())
        self.value = float(self._residual @ self._residual) + objective.weight * self.risk

    def gradient(self) -> FloatArray:
        """(n + 2 r,)."""
        by_a, by_b = self._derivatives()[:2]
        objective = self._objective
        by_x = 2.0 * (self._residual @ objective.cost.matrix)
        return np.concatenate((by_x, objective.weight * by_a, objective.weight * by_b))

    def factor(self) -> Factor:
        """Of the Hessian with a little damping: a block for x, and one of 2 by 2 for each axis."""
        return RectangleFactor(self._objective, *self._derivatives()[2:])

    def _derivatives(self) -> tuple[FloatArray, ...]:
        if self._slopes is None:
            r = self._objective.axes
            n = len(self.x) - 2 * r
            self._slopes = interval_slopes(self.x[n : n + r], self.x[n + r :], self._risks)
        return self._slopes


class RectangleFactor:
    """See `Factor`; the axes cost r divisions instead of a factorisation of 2 r columns."""

    def __init__(self, objective: RectangleObjective, aa: FloatArray, ab: FloatArray, bb: FloatArray) -> None:
        self._objective = objective
        weight = objective.weight
        self._first = np.sqrt(weight * (np.maximum(aa, 0.0) + SIDE_DAMPING))
        self._mixed = weight * ab / self._first
        rest = weight * (bb + SIDE_DAMPING) - self._mixed * self._mixed
        self._second = np.sqrt(np.maximum(rest, SIDE_DAMPING * weight))
        self.failed = objective.failed or not math.isfinite(float(self._second.sum() + self._first.sum()))

    def solve(self, vector: FloatArray) -> FloatArray:
        """See `Factor`."""
        return self.colour(self.whiten(vector[:, None])[:, 0])

    def whiten(self, columns: FloatArray) -> FloatArray:
        """See `Factor`."""
        r, n = self._objective.axes, len(self._objective.quadratic)
        whitened = np.empty(columns.shape)
        if n:
            whitened[:n] = dtrtrs(self._objective.lower, columns[:n], lower=1)[0]
        first = whitened[n : n + r]
        np.divide(columns[n : n + r], self._first[:, None], out=first)
        np.divide(columns[n + r :] - self._mixed[:, None] * first, self._second[:, None], out=whitened[n + r :])
        return whitened

    def colour(self, vector: FloatArray) -> FloatArray:
        """See `Factor`."""
        r, n = self._objective.axes, len(self._objective.quadratic)
        coloured = np.empty(vector.shape)
        if n:
            coloured[:n] = dtrtrs(self._objective.lower, vector[:n], lower=1, trans=1)[0]
        np.divide(vector[n + r :], self._second, out=coloured[n + r :])
        np.divide(vector[n : n + r] - self._mixed * coloured[n + r :], self._first, out=coloured[n : n + r])
        return coloured

    def hessian(self) -> FloatArray:
        """See `Factor`."""
        r, n = self._objective.axes, len(self._objective.quadratic)
        hessian = np.zeros((n + 2 * r, n + 2 * r))
        hessian[:n, :n] = self._objective.quadratic
        first, second = np.arange(n, n + r), np.arange(n + r, n + 2 * r)
        hessian[first, first] = self._first * self._first
        hessian[first, second] = hessian[second, first] = self._first * self._mixed
        hessian[second, second] = self._second * self._second + self._mixed * self._mixed
        return hessian
