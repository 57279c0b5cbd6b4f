"""A reduced problem in units of its own uncertainty: torques over sigma, rows over sigma_G."""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from drake_tc.tsid.polytope import LeastSquares, Polytope
from drake_tc.tsid.robust.torque_error import CERTAIN, TorqueError
from drake_tc.types import BoolArray, FloatArray, IntArray

FEASIBLE = 1e-6
"""In units of a row (one sigma): what a point may miss and still count as feasible."""


class RowProduct(Protocol):
    """lower <= A x <= upper, A known by what it does.

    Attributes:
        lower: (m,), or None where no row has a lower side.
        upper: (m,).
    """

    @property
    def lower(self) -> FloatArray | None:
        """See the class."""
        ...

    @property
    def upper(self) -> FloatArray:
        """See the class."""
        ...

    def times(self, x: FloatArray) -> FloatArray:
        """(m,) A x."""
        ...

    def take(self, rows: IntArray) -> FloatArray:
        """(a, n) some rows of A."""
        ...

    def dense(self) -> "Rows":
        """With A written out."""
        ...


@dataclass(frozen=True, eq=False)
class Rows:
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

    def times(self, x: FloatArray) -> FloatArray:
        """(m,) A x."""
        value: FloatArray = self.matrix.dot(x)
        return value

    def take(self, rows: IntArray) -> FloatArray:
        """(a, n) some rows of A."""
        return self.matrix[rows]

    def dense(self) -> "Rows":
        """Itself; rows of other kinds write out their matrix."""
        return self

    def miss(self, x: FloatArray) -> float:
        """By how much the worst row is missed at x; negative inside."""
        value = self.matrix @ x
        return float(max((self.lower - value).max(initial=-np.inf), (value - self.upper).max(initial=-np.inf)))

    def along(self, origin: FloatArray, basis: FloatArray) -> "Rows":
        """The same rows over y, with x = origin + basis y."""
        shift = self.matrix @ origin
        return Rows(self.matrix @ basis, self.lower - shift, self.upper - shift)


@dataclass(frozen=True, eq=False)
class ScaledProblem:
    """min ||D x - d||^2 on rows, with tau = scale * x, so that a row errs by 1 and a step of 1 in x is one sigma.

    Attributes:
        cost: D diag(scale), d.
        limits: Every row of the polytope, over its sigma_G; a row that does not err over its own length instead.
        certain: (m,) rows that do not err; None where there are none.
        noise: (m, r) of limits.matrix e: G L over the same divisors.
        scale: (n,) [N m].
        row_scale: (m,) divisors, in each row's unit.
    """

    cost: LeastSquares
    limits: Rows
    certain: BoolArray | None
    noise: FloatArray
    scale: FloatArray
    row_scale: FloatArray

    def along(self, origin: FloatArray, basis: FloatArray) -> "ScaledProblem":
        """The same problem over y, with x = origin + basis y; its `scale` stays that of x."""
        cost = LeastSquares(self.cost.matrix @ basis, self.cost.target - self.cost.matrix @ origin)
        return replace(self, cost=cost, limits=self.limits.along(origin, basis))

    @property
    def erring(self) -> Rows:
        """The limits without those of the rows that do not err: what probabilities are about."""
        if self.certain is None:
            return self.limits
        lower = np.where(self.certain, -np.inf, self.limits.lower)
        return Rows(self.limits.matrix, lower, np.where(self.certain, np.inf, self.limits.upper))


def scaled(cost: LeastSquares, polytope: Polytope, error: TorqueError) -> ScaledProblem:
    """Both over sigma; see `ScaledProblem`."""
    scale = error.scale
    matrix = polytope.matrix * scale
    plain = error.plain
    noise = matrix if plain else polytope.matrix @ error.root
    divisor = np.sqrt(np.einsum("ij,ij->i", noise, noise))
    certain: BoolArray | None = None
    if not (plain and divisor.all()):
        length = divisor if plain else np.sqrt(np.einsum("ij,ij->i", matrix, matrix))
        some = divisor <= CERTAIN * length
        certain = some if some.any() else None
    if certain is not None:
        divisor = np.where(certain, np.where(length > 0.0, length, 1.0), divisor)
        noise = np.where(certain[:, None], 0.0, noise)
    inverse = 1.0 / divisor
    column = inverse[:, None]
    noise = matrix if plain and certain is None else noise * column
    matrix *= column
    limits = Rows(matrix, polytope.lower * inverse, polytope.upper * inverse, polytope.bounds)
    return ScaledProblem(
        LeastSquares(cost.matrix * scale, cost.target),
        limits,
        certain,
        noise,
        scale,
        divisor,
    )
