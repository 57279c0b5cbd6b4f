"""R_ind = -log p_ind: every side of every row by itself; see `drake_tc.kernels.programs`.

Source: Del Prete and Mansard, 2015, eq. 7 and 13.
"""

from dataclasses import dataclass

import numpy as np

from drake_tc.kernels.lazy import Kernel
from drake_tc.tsid.polytope import Polytope
from drake_tc.tsid.robust.convex import plain
from drake_tc.tsid.robust.scaled import FEASIBLE, Rows, nothing, scaled
from drake_tc.tsid.robust.torque_error import TorqueError
from drake_tc.types import FloatArray, IntArray

_JUDGED = Kernel("scaling", "judged")


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
    problem = scaled(nothing(error.joints), polytope, error)
    rows, scale = problem.erring, problem.scale
    here = plain(problem.cost, rows, risk=rows, weight=1.0).at(torque / scale)
    hessian = (rows.matrix.T * here.bend) @ rows.matrix
    return RiskDerivatives(here.risk, (here.slope @ rows.matrix) / scale, hessian / np.outer(scale, scale))


def p_ind(polytope: Polytope, torque: FloatArray, error: TorqueError) -> float:
    """Product of the probabilities of the single sides (eq. 7); 0 where a row that does not err is violated.

    Exact where no row has two sides and the rows are orthogonal in the metric of Sigma.
    """
    problem = scaled(nothing(error.joints), polytope, error)
    limits, cost = problem.limits, problem.cost
    rows = limits.matrix, limits.lower, limits.upper, problem.certain
    return float(_JUDGED(torque / problem.scale, problem.scale, *rows, cost.matrix, cost.target)[2])


def certain_miss(rows: Rows, certain: IntArray, x: FloatArray, tolerance: float = FEASIBLE) -> bool:
    """Whether a row that does not err (1 in certain) is missed at x."""
    if not certain.any():
        return False
    sure = certain > 0
    return Rows(rows.matrix[sure], rows.lower[sure], rows.upper[sure]).miss(x) > tolerance
