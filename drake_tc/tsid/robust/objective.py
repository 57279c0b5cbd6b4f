"""What Newton's method minimises: a least-squares cost, a linear term, and weighted R_ind."""

import numpy as np
from scipy.linalg.blas import dgemm

from drake_tc.tsid.polytope import LeastSquares
from drake_tc.tsid.robust.factor import DenseFactor, Factor
from drake_tc.tsid.robust.gaussian_tail import curvature_of, hazard_of, risk_of, scaled_cdf
from drake_tc.tsid.robust.individual import IndividualRisk
from drake_tc.types import FloatArray

DAMPING = 1e-9
"""Of the largest diagonal entry: with much less, singular costs cost their factors too many digits."""


class Objective:
    """f(x) = ||D x - d||^2 + q^T x + w R(x), convex.

    Attributes:
        cost: D, d; its residual is squared as it is, so a small cost beside a large d keeps its digits.
        linear: (n,) q, or None.
        risk: R, or None for w = 0.
        weight: w.
        bends: Whether the Hessian changes with x.
        rounding: About the error of f by rounding.
    """

    def __init__(
        self,
        cost: LeastSquares,
        *,
        linear: FloatArray | None = None,
        risk: IndividualRisk | None = None,
        weight: float = 0.0,
        damping: float = 0.0,
    ) -> None:
        self.cost, self.linear, self.weight = cost, linear, weight
        self.risk = risk if weight > 0.0 else None
        self.bends = self.risk is not None
        self.rounding = 1e-15 * float(cost.target @ cost.target) + 1e-12 * weight
        columns = cost.matrix.T
        quadratic = dgemm(2.0, columns, columns, trans_b=1)
        diagonal = quadratic.ravel(order="K")[:: quadratic.shape[0] + 1]
        diagonal += (damping + 1e-6 * weight + DAMPING * float(diagonal.max(initial=0.0))) or 1.0
        self.quadratic: FloatArray = quadratic

    def at(self, x: FloatArray) -> "ObjectivePoint":
        """F and all that its derivatives need."""
        return ObjectivePoint(self, x)


class ObjectivePoint:
    """The objective at one x; the derivatives are worked out when asked for.

    Attributes:
        x: (n,).
        value: f.
    """

    __slots__ = ("_cdf", "_near", "_objective", "_residual", "_rows", "value", "x")

    def __init__(self, objective: Objective, x: FloatArray) -> None:
        self.x = x
        self._objective = objective
        self._residual = residual = objective.cost.matrix.dot(x)
        residual -= objective.cost.target
        value = float(residual.dot(residual))
        if objective.linear is not None:
            value += float(objective.linear @ x)
        if objective.risk is not None:
            self._near = objective.risk.near(x)
            self._rows: FloatArray | None = None
            if self._near.sides.size:
                self._cdf = scaled_cdf(self._near.margins)
                value += objective.weight * risk_of(self._near.margins, self._cdf)
        self.value = value

    @property
    def risk(self) -> float:
        """R to the last digit; 0 without."""
        risk = self._objective.risk
        return risk.value(self._near.margins) if risk is not None and self._near.sides.size else 0.0

    def gradient(self) -> FloatArray:
        """(n,)."""
        objective = self._objective
        residual = self._residual
        gradient: FloatArray = (residual + residual).dot(objective.cost.matrix)
        if objective.linear is not None:
            gradient += objective.linear
        if objective.risk is not None and self._near.sides.size:
            gradient += self._near.signed(objective.weight * hazard_of(self._cdf)).dot(self._near_rows())
        return gradient

    def factor(self) -> Factor:
        """Of the Hessian with a little damping: it is positive definite then, and Newton's iteration a proximal one."""
        objective = self._objective
        if objective.risk is None or not self._near.sides.size:
            return DenseFactor(objective.quadratic)
        curvature = curvature_of(self._near.margins, hazard_of(self._cdf))
        root = self._near_rows() * np.sqrt(objective.weight * curvature)[:, None]
        hessian: FloatArray = root.T.dot(root)
        hessian += objective.quadratic
        return DenseFactor(hessian)

    def _near_rows(self) -> FloatArray:
        """(a, n) of the sides that show."""
        if self._rows is None:
            self._rows = self._near.rows()
        return self._rows


def nothing(n: int) -> LeastSquares:
    """A cost that is 0."""
    return LeastSquares(np.zeros((0, n)), np.zeros(0))
