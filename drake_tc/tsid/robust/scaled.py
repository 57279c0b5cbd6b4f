"""A reduced problem in units of its own uncertainty: torques over sigma, rows over sigma_G.

R_ind = -log p_ind: every side of every row by itself; see `drake_tc.kernels.tsid.programs`.

Source: Del Prete and Mansard, 2015, eq. 7 and 13.

Directions in which a cost does not change.

p_box: the largest box tau +- s sigma inside the polytope, by a quadratic program.

Source: Del Prete and Mansard, 2015, eq. 17.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dgeqp3, dorgqr
from scipy.special import erfcinv

from drake_tc.kernels.calls import Kernel
from drake_tc.tsid.robust.options import TorqueError
from drake_tc.tsid.rows import LeastSquares, Polytope
from drake_tc.types import FloatArray, IntArray

_SCALED = Kernel("tsid.scaling", "scaled")

FEASIBLE = 1e-6
"""In units of a row (one sigma): what a point may miss and still count as feasible."""


class ScaledRows(NamedTuple):
    """lower <= A x <= upper; infinite where a side has no limit.

    Attributes:
        matrix: (m, n) A.
        lower, upper: (m,).
        bounds: How many leading rows are those of the identity.
    """

    matrix: FloatArray
    lower: FloatArray
    upper: FloatArray
    bounds: int = 0

    def miss(self, x: FloatArray) -> float:
        """By how much the worst row is missed at x; negative inside."""
        value = self.matrix @ x
        return float(max((self.lower - value).max(initial=-np.inf), (value - self.upper).max(initial=-np.inf)))

    def along(self, origin: FloatArray, basis: FloatArray) -> "ScaledRows":
        """The same rows over y, with x = origin + basis y."""
        shift = self.matrix @ origin
        return ScaledRows(np.ascontiguousarray(self.matrix @ basis), self.lower - shift, self.upper - shift)


class ScaledProblem(NamedTuple):
    """min ||D x - d||^2 on rows, with tau = scale * x, so that a row errs by 1 and a step of 1 in x is one sigma.

    Attributes:
        cost: D diag(scale), d.
        limits: Every row of the polytope, over its sigma_G; a row that does not err over its own length instead.
        certain: (m,) 1 for a row that does not err, else 0.
        sure: How many do not err.
        noise: (m, r) of limits.matrix e: G L over the same divisors.
        scale: (n,) [N m].
    """

    cost: LeastSquares
    limits: ScaledRows
    certain: IntArray
    sure: int
    noise: FloatArray
    scale: FloatArray

    def along(self, origin: FloatArray, basis: FloatArray) -> "ScaledProblem":
        """The same problem over y, with x = origin + basis y; its `scale` stays that of x."""
        cost = LeastSquares(
            np.ascontiguousarray(self.cost.matrix @ basis), self.cost.target - self.cost.matrix @ origin
        )
        return self._replace(cost=cost, limits=self.limits.along(origin, basis))

    @property
    def rows(self) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
        """The limits and which of them do not err, as compiled functions take them."""
        return *self.limits[:3], self.certain

    @property
    def erring(self) -> ScaledRows:
        """The limits without those of the rows that do not err: what probabilities are about."""
        if not self.sure:
            return self.limits
        sure = self.certain > 0
        lower = np.where(sure, -np.inf, self.limits.lower)
        return ScaledRows(self.limits.matrix, lower, np.where(sure, np.inf, self.limits.upper))


def scaled(cost: LeastSquares, polytope: Polytope, error: TorqueError) -> ScaledProblem:
    """Both over sigma; see `ScaledProblem`."""
    matrix, target = np.ascontiguousarray(polytope.matrix), cost.target
    sides = np.ascontiguousarray(polytope.lower), np.ascontiguousarray(polytope.upper)
    priced, rows, lower, upper, noise, certain, _, sure = _SCALED(
        np.ascontiguousarray(cost.matrix), (matrix, *sides), error.scale, error.root, error.plain
    )
    limits = ScaledRows(rows, lower, upper, polytope.bounds)
    return ScaledProblem(LeastSquares(priced, target), limits, certain, sure, noise, error.scale)


def nothing(n: int) -> LeastSquares:
    """A cost that is 0."""
    return LeastSquares(np.zeros((0, n)), np.zeros(0))


_EVALUATED = Kernel("tsid.scaling", "evaluated")


def p_ind(polytope: Polytope, torque: FloatArray, error: TorqueError) -> float:
    """Product of the probabilities of the single sides (eq. 7); 0 where a row that does not err is violated.

    Exact where no row has two sides and the rows are orthogonal in the metric of Sigma.
    """
    problem = scaled(nothing(error.joints), polytope, error)
    return float(_EVALUATED(torque / problem.scale, problem.scale, problem.rows, tuple(problem.cost))[2])


def certain_miss(rows: ScaledRows, certain: IntArray, x: FloatArray) -> bool:
    """Whether a row that does not err (1 in certain) is missed at x."""
    if not certain.any():
        return False
    sure = certain > 0
    return ScaledRows(rows.matrix[sure], rows.lower[sure], rows.upper[sure]).miss(x) > FEASIBLE


_HAS_ONE_MINIMISER = Kernel("tsid.problem", "has_one_minimiser")
RANK = 1e-10
"""Relative to the longest: a row of D, less what the rows before it span, that is shorter adds no direction."""


def null_basis(matrix: FloatArray) -> FloatArray:
    """(n, n - rank) orthonormal basis of {x: D x = 0}, by QR of D^T with column pivoting."""
    rows, n = matrix.shape
    if rows == 0:
        return np.eye(n)
    if _HAS_ONE_MINIMISER(np.ascontiguousarray(matrix)):
        return np.zeros((n, 0))
    factors, _, tau, _, _ = dgeqp3(matrix.T)
    pivots = np.abs(np.diagonal(factors))
    rank = int(np.count_nonzero(pivots > RANK * pivots.max(initial=0.0)))
    square = np.zeros((n, n), order="F")
    square[:, : len(pivots)] = factors[:, : len(pivots)]
    basis: FloatArray = dorgqr(square, tau)[0][:, rank:]
    return basis


_PROGRAM, _SIZE = Kernel("tsid.scaling", "box_program"), Kernel("tsid.scaling", "box_size")
_RISK = Kernel("tsid.scaling", "box_risk")


def box_rows(problem: ScaledProblem) -> tuple[ScaledRows, LeastSquares]:
    """Rows over (x, s) of a box of half width s sigmas around x, and the cost, which s does not enter.

    See `drake_tc.kernels.tsid.scaling.box_program`.
    """
    limits, cost = problem.limits, problem.cost
    rows, lower, upper, priced = _PROGRAM(limits.matrix, limits.lower, limits.upper, problem.noise, cost.matrix)
    return ScaledRows(rows, lower, upper), LeastSquares(priced, cost.target)


def box_size(problem: ScaledProblem, x: FloatArray) -> float:
    """Largest s with x +- s inside; negative where x is outside, -inf where a row that does not err is missed."""
    size: float = _SIZE(x, problem.rows, problem.noise)
    return size


def box_risk(size: float, axes: int) -> float:
    """R_box = -log p_box of a box of half width `size` sigmas in `axes` independent directions; inf for none."""
    risk: float = _RISK(float(size), axes)
    return risk


def size_of_risk(risk: float, axes: int) -> float:
    """The half width whose R_box is `risk`; inverse of `box_risk`."""
    return math.sqrt(2.0) * float(erfcinv(-math.expm1(-risk / max(axes, 1))))


def p_box(polytope: Polytope, torque: FloatArray, error: TorqueError) -> float:
    """Probability that the error stays in the largest box |zeta_i| <= s around the torque: a lower bound of p.

    e = L zeta as in `TorqueError`; with a diagonal Sigma the box is |e_i| <= s sigma_i. 0 outside the polytope.
    """
    problem = scaled(nothing(error.joints), polytope, error)
    return math.exp(-box_risk(box_size(problem, torque / problem.scale), error.root.shape[1]))
