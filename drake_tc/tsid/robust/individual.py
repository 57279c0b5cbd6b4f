"""R_ind = -log p_ind: every side of every row by itself (Del Prete and Mansard, 2015, eq. 7 and 13)."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from drake_tc.tsid.polytope import LeastSquares, Polytope
from drake_tc.tsid.robust.gaussian_tail import curvature_of, hazard, log_cdf
from drake_tc.tsid.robust.scaled import FEASIBLE, Rows, scaled
from drake_tc.tsid.robust.torque_error import TorqueError
from drake_tc.types import BoolArray, FloatArray, IntArray

SAFE = 12.0
"""Margin beyond which a side bends R by less than 1e-30 and counts as this far."""

VISIBLE = 1e-14
"""Curvature, of the row that bends most, below which a row does not show in the Hessian."""

_NO_MARGINS: FloatArray = np.zeros(0)
_NO_SIDES: IntArray = np.zeros(0, dtype=np.int64)


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
        u = self._distances(x)
        return np.minimum(u, SAFE, out=u)

    def _distances(self, x: FloatArray) -> FloatArray:
        value = self.matrix.dot(x)
        u: FloatArray = np.concatenate((value, -value))
        u += self._offset
        return u

    def near(self, x: FloatArray) -> "NearSides":
        """The sides that are nearer than `SAFE`: all that show in R and its derivatives."""
        distances = self._distances(x)
        if distances.min(initial=np.inf) >= SAFE:
            return NearSides(_NO_MARGINS, _NO_SIDES, 0, self)
        sides = (~(distances >= SAFE)).nonzero()[0]
        return NearSides(distances[sides], sides, int(sides.searchsorted(self._rows)), self)

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


class NearSides(NamedTuple):
    """Sides of rows near one x: u = S x + c their margins, S the rows of lower sides and minus those of upper ones.

    Attributes:
        margins: (a,) u [sigma].
        sides: (a,) which of the stacked sides.
        lower: How many of them are lower sides; these come first.
        risk: Of which they are sides.
    """

    margins: FloatArray
    sides: IntArray
    lower: int
    risk: IndividualRisk

    def rows(self) -> FloatArray:
        """(a, n) |S|: the rows without the sign."""
        rows = self.sides.copy()
        rows[self.lower :] -= self.risk.matrix.shape[0]
        taken: FloatArray = self.risk.matrix.take(rows, axis=0)
        return taken

    def signed(self, first: FloatArray) -> FloatArray:
        """(a,) first derivatives by the rows' own A_i x, from hazards; `first` itself is written over."""
        lower = first[: self.lower]
        np.negative(lower, out=lower)
        return first


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


def certain_miss(rows: Rows, certain: BoolArray | None, x: FloatArray, tolerance: float = FEASIBLE) -> bool:
    """Whether a row that does not err is missed at x."""
    if certain is None:
        return False
    some = Rows(rows.matrix[certain], rows.lower[certain], rows.upper[certain])
    return some.miss(x) > tolerance
