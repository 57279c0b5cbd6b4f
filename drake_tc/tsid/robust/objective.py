"""What Newton's method minimises: a least-squares cost, a linear term, and weighted R_ind."""

import numpy as np

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
        quadratic = cost.matrix.T @ cost.matrix
        quadratic += quadratic
        diagonal = quadratic.ravel()[:: quadratic.shape[0] + 1]
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

    __slots__ = ("_cdf", "_hazard", "_margins", "_objective", "_residual", "value", "x")

    def __init__(self, objective: Objective, x: FloatArray) -> None:
        self.x = x
        self._objective = objective
        self._residual = objective.cost.matrix @ x - objective.cost.target
        value = float(self._residual @ self._residual)
        if objective.linear is not None:
            value += float(objective.linear @ x)
        if objective.risk is not None:
            self._margins = objective.risk.margins(x)
            self._cdf = scaled_cdf(self._margins)
            self._hazard: FloatArray | None = None
            value += objective.weight * risk_of(self._margins, self._cdf)
        self.value = value

    @property
    def risk(self) -> float:
        """R to the last digit; 0 without."""
        risk = self._objective.risk
        return risk.value(self._margins) if risk is not None else 0.0

    def gradient(self) -> FloatArray:
        """(n,)."""
        objective = self._objective
        residual = self._residual
        gradient: FloatArray = (residual + residual) @ objective.cost.matrix
        if objective.linear is not None:
            gradient += objective.linear
        if objective.risk is not None:
            self._hazard = hazard_of(self._cdf)
            gradient += (objective.weight * objective.risk.slope(self._hazard)) @ objective.risk.matrix
        return gradient

    def factor(self) -> Factor:
        """Of the Hessian with a little damping: it is positive definite then, and Newton's iteration a proximal one."""
        objective = self._objective
        if objective.risk is None:
            return DenseFactor(objective.quadratic)
        hazard = self._hazard if self._hazard is not None else hazard_of(self._cdf)
        hessian = objective.risk.hessian(objective.weight * objective.risk.bend(curvature_of(self._margins, hazard)))
        hessian += objective.quadratic
        return DenseFactor(hessian)


def nothing(n: int) -> LeastSquares:
    """A cost that is 0."""
    return LeastSquares(np.zeros((0, n)), np.zeros(0))
