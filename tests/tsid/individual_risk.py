"""R_ind with its derivatives in the torque, from the solver's own value, slope and bend in its scaled variables."""

from dataclasses import dataclass

import numpy as np

from drake_tc.tsid.robust.convex import plain
from drake_tc.tsid.robust.scaled import TorqueError, nothing, scaled
from drake_tc.tsid.rows import Polytope
from drake_tc.types import FloatArray


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
    here = plain(problem.cost, rows).with_risk(rows, 1.0).at(torque / scale)
    hessian = (rows.matrix.T * here.bend) @ rows.matrix
    return RiskDerivatives(here.risk, (here.slope @ rows.matrix) / scale, hessian / np.outer(scale, scale))
