"""A reduced problem in units of its own uncertainty: torques over sigma, rows over sigma_G."""

from typing import NamedTuple

import numpy as np

from drake_tc.kernels.lazy import Kernel
from drake_tc.tsid.polytope import LeastSquares, Polytope
from drake_tc.tsid.robust.torque_error import TorqueError
from drake_tc.types import FloatArray, IntArray

_SCALED = Kernel("scaling", "scaled")

FEASIBLE = 1e-6
"""In units of a row (one sigma): what a point may miss and still count as feasible."""


class Rows(NamedTuple):
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

    def along(self, origin: FloatArray, basis: FloatArray) -> "Rows":
        """The same rows over y, with x = origin + basis y."""
        shift = self.matrix @ origin
        return Rows(np.ascontiguousarray(self.matrix @ basis), self.lower - shift, self.upper - shift)


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
    limits: Rows
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
    def erring(self) -> Rows:
        """The limits without those of the rows that do not err: what probabilities are about."""
        if not self.sure:
            return self.limits
        sure = self.certain > 0
        lower = np.where(sure, -np.inf, self.limits.lower)
        return Rows(self.limits.matrix, lower, np.where(sure, np.inf, self.limits.upper))


def scaled(cost: LeastSquares, polytope: Polytope, error: TorqueError) -> ScaledProblem:
    """Both over sigma; see `ScaledProblem`."""
    matrix, target = np.ascontiguousarray(polytope.matrix), cost.target
    sides = np.ascontiguousarray(polytope.lower), np.ascontiguousarray(polytope.upper)
    priced, rows, lower, upper, noise, certain, _, sure = _SCALED(
        np.ascontiguousarray(cost.matrix), matrix, *sides, error.scale, error.root, error.plain
    )
    limits = Rows(rows, lower, upper, polytope.bounds)
    return ScaledProblem(LeastSquares(priced, target), limits, certain, sure, noise, error.scale)


def nothing(n: int) -> LeastSquares:
    """A cost that is 0."""
    return LeastSquares(np.zeros((0, n)), np.zeros(0))
