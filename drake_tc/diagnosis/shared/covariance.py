"""How sure the shared causes' parameters are, and what that means for each joint's own.

With H = sum_j w_j C_j' (1 - P_j) C_j + diag(1/t_i^2), P_j the projection on the joint's own columns, and s_b the score of
half second b over all joints, sum_j w_j C_j' (1 - P_j) e_j over its rows:

    Cov(delta) = H^-1 (B/(B - f) sum_b s_b s_b' + diag(1/t_i^2)) H^-1,   f = tr(H^-1 (H - diag(1/t_i^2)))

The joints share the sensors' noise, and neighbouring rows theirs: what happens within one half second, on whichever
joints, counts as one observation (a sandwich; Cameron and Miller 2015, section II). The parameters with a prior deviate
from the estimate because of noise, and because the prior draws them towards 0: that is the second term. Where the
weights w_j are right, sum_b s_b s_b' is H less the prior, and the covariance is the posterior's, H^-1.
"""

from collections.abc import Sequence

import numpy as np
from scipy.stats import t as student

from drake_tc.diagnosis.shared.stacked import JointRows, StackedFit, inverse
from drake_tc.types import FloatArray


def covariance(rows: Sequence[JointRows], fitted: StackedFit) -> tuple[FloatArray, float]:
    """Cov(delta) (p, p), and the degrees of freedom B - f of its estimate.

    Args:
        rows: Those that were fitted.
        fitted: The fit.
    """
    p = fitted.delta.size
    bread = np.zeros((p, p))
    count = int(max(int(r.block.max()) for r in rows)) + 1
    scores = np.zeros((count, p))
    for j, r in enumerate(rows):
        shared = r.shared[:, fitted.columns]
        rest = shared - r.own @ own_response(r, fitted)
        weight = fitted.effective[j] / fitted.sigma[j] ** 2
        bread += weight * rest.T @ rest
        each = weight * rest * fitted.residual(r, j)[:, None]
        np.add.at(scores, r.block, each)
    prior = np.diag(1.0 / fitted.tolerance**2)
    inner = inverse(bread + prior)
    used = int(np.any(scores != 0.0, axis=1).sum())
    freedom = max(used - float(np.trace(inner @ bread)), 1.0)
    meat = scores.T @ scores * used / freedom
    return np.asarray(inner @ (meat + prior) @ inner), freedom


def own_response(rows: JointRows, fitted: StackedFit) -> FloatArray:
    """(k, p): by how much the joint's own beta falls as delta grows, d beta_j/d delta = -(X' X)^-1 X' C."""
    return np.asarray(inverse(rows.own.T @ rows.own) @ (rows.own.T @ rows.shared[:, fitted.columns]))


def intervals(rows: Sequence[JointRows], fitted: StackedFit) -> FloatArray:
    """(p,) half widths of 95 % intervals of delta."""
    spread, freedom = covariance(rows, fitted)
    return np.asarray(student.ppf(0.975, freedom) * np.sqrt(np.maximum(np.diag(spread), 0.0)))
