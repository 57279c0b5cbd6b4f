"""R_ind = -log p_ind: every side of every row by itself (paper B, eq. 7 and 13)."""

from dataclasses import dataclass

import numpy as np

from drake_tc.tsid.polytope import LeastSquares, Polytope
from drake_tc.tsid.robust.gaussian_tail import curvature_of, hazard, log_cdf
from drake_tc.tsid.robust.scaled import Rows, scaled
from drake_tc.tsid.robust.torque_error import TorqueError
from drake_tc.types import BoolArray, FloatArray

SAFE = 12.0
"""Margin beyond which a side bends R by less than 1e-30 and counts as this far."""

VISIBLE = 1e-14
"""Curvature, of the row that bends most, below which a row does not show in the Hessian."""


class IndividualRisk:
    """R(x) = -sum log Phi(A x - lower) - sum log Phi(upper - A x), over rows whose error has variance 1; convex, C^2.

    With u of both sides stacked, lambda = hazard(u), kappa = lambda (lambda + u):
        gradient = A^T (lambda_upper - lambda_lower),  Hessian = A^T diag(kappa_upper + kappa_lower) A.
    """

    def __init__(self, rows: Rows) -> None:
        self.matrix = rows.matrix
        self._offset = np.concatenate((-rows.lower, rows.upper))
        self._rows = len(rows.lower)

    def margins(self, x: FloatArray) -> FloatArray:
        """(2 m,) distances to the lower, then the upper sides [sigma], cut at `SAFE`."""
        value = self.matrix @ x
        u = np.concatenate((value, -value))
        u += self._offset
        return np.minimum(u, SAFE, out=u)

    def value(self, margins: FloatArray) -> float:
        """R, to the last digit however small."""
        return -float(log_cdf(margins).sum())

    def slope(self, first: FloatArray) -> FloatArray:
        """(m,) derivative of R by each row's A_i x, from the hazards of both its sides."""
        m = self._rows
        slope: FloatArray = first[m:] - first[:m]
        return slope

    def bend(self, second: FloatArray) -> FloatArray:
        """(m,) second derivative of R by each row's A_i x, from the curvatures of both its sides."""
        m = self._rows
        bend: FloatArray = second[:m] + second[m:]
        return bend

    def hessian(self, curvature: FloatArray) -> FloatArray:
        """(n, n) A^T diag(curvature) A, without the rows that do not show."""
        near = np.flatnonzero(curvature > VISIBLE * curvature.max())
        root = self.matrix[near] * np.sqrt(curvature[near])[:, None]
        hessian: FloatArray = root.T @ root
        return hessian


@dataclass(frozen=True, eq=False)
class RiskDerivatives:
    """R_ind at one torque: value, gradient (n,) [1/(N m)], Hessian (n, n) [1/(N m)^2]."""

    value: float
    gradient: FloatArray
    hessian: FloatArray


def individual_risk(polytope: Polytope, torque: FloatArray, error: TorqueError) -> RiskDerivatives:
    """R_ind of the rows that err at torque (n,) [N m]; a row that does not err takes no part.

    gradient = -G^T (lambda / sigma_G), Hessian = G^T diag(lambda (lambda + u) / sigma_G^2) G, both sides of a row.
    """
    problem = scaled(LeastSquares(np.zeros((0, error.joints)), np.zeros(0)), polytope, error)
    risk = IndividualRisk(problem.erring)
    margins = risk.margins(torque / problem.scale)
    first = hazard(margins)
    second = curvature_of(margins, first)
    return RiskDerivatives(
        risk.value(margins),
        (risk.slope(first) @ risk.matrix) / problem.scale,
        risk.hessian(risk.bend(second)) / np.outer(problem.scale, problem.scale),
    )


def p_ind(polytope: Polytope, torque: FloatArray, error: TorqueError) -> float:
    """Product of the probabilities of the single sides (eq. 7); 0 where a row that does not err is violated.

    Exact where no row has two sides and the rows are orthogonal in the metric of Sigma.
    """
    problem = scaled(LeastSquares(np.zeros((0, error.joints)), np.zeros(0)), polytope, error)
    x = torque / problem.scale
    if certain_miss(problem.limits, problem.certain, x):
        return 0.0
    risk = IndividualRisk(problem.erring)
    return float(np.exp(-risk.value(risk.margins(x))))


def certain_miss(rows: Rows, certain: BoolArray | None, x: FloatArray, tolerance: float = 1e-9) -> bool:
    """Whether a row that does not err is missed at x."""
    if certain is None:
        return False
    some = Rows(rows.matrix[certain], rows.lower[certain], rows.upper[certain])
    return some.miss(x) > tolerance
