"""How sure the shared causes' parameters are, and what that means for each joint's own.

With H the Gauss-Newton matrix of the fit (`stacked`), sum_j w_j D_j' D_j + diag(1/t_i^2) with D_j = C~_j - e_j g_j',
and s_b the score of half second b over all joints, sum_j w_j D_j' e_j over its rows:

    Cov(delta) = H^-1 (M + diag(1/t_i^2)) H^-1 + d d'/12
    M = B/(B - f) sum_{|l| <= L} (1 - |l|/(L + 1)) sum_b s_b s_{b+l}',   f = tr(H^-1 (H - diag(1/t_i^2)))

The joints share the sensors' noise: what happens within one half second, on whichever joints, counts as one
observation (a sandwich; Cameron and Miller 2015, section II), and neighbouring half seconds are correlated too (Newey
and West 1987). Parameters with a prior deviate from the estimate because of noise, and because the prior draws them
towards 0: that is the second term. Where the weights w_j are right, M is H less the prior, and the covariance is the
posterior's, H^-1. From some tens of half seconds M scatters, and comes out too small where noise is correlated over
more than one of them: no standard deviation is taken to be smaller than the posterior's. The last term is what the
filters and the noise in the columns themselves do: the fit takes the columns that scale readings to hold all of z's
error (sensors' noise, and what filters change near reversals), and those of links to hold none. d is the difference
from the fit under the opposite assumptions. The share lies between, and the variance is that of a share about which
nothing else is known. Quantiles are those of Student's t with the degrees of freedom of Bartlett's kernel,
1.5 B/(L + 1), or B - f if smaller.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import t as student

from drake_tc.diagnosis.problem.shared.rows import JointRows
from drake_tc.diagnosis.problem.shared.stacked import StackedFit, fit_stacked, inverse
from drake_tc.types import FloatArray

LAGS = 3
"""L: half seconds over which scores are taken to be correlated; that of reversals, of motions of 0.3 to 1 Hz."""


def covariance(rows: Sequence[JointRows], fitted: StackedFit) -> tuple[FloatArray, float]:
    """Cov(delta) (p, p), and the degrees of freedom of its estimate.

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
        response = own_response(r, fitted)
        residual = fitted.residual(r, j)[:, None]
        own = response if r.held is None else response[1:]
        change = r.scales(fitted.columns) * response[0] / max(r.stiffness(fitted.beta[j]), 1e-9)
        rest = shared - r.own @ own - residual * change
        weight = fitted.share[j] / fitted.sigma[j] ** 2
        bread += weight * rest.T @ rest
        each = weight * rest * residual
        np.add.at(scores, r.block, each)
    prior = np.diag(1.0 / fitted.tolerance**2)
    inner = inverse(bread + prior)
    used = int(np.any(scores != 0.0, axis=1).sum())
    left = max(used - float(np.trace(inner @ bread)), 1.0)
    meat = _long_run(scores) * used / left
    spread = inner @ (meat + prior) @ inner
    own = np.maximum(np.diag(spread), 1e-300)
    scale = np.sqrt(np.maximum(np.diag(inner) / own, 1.0))
    apart = _opposite(rows, fitted) - fitted.delta
    spread = spread * np.outer(scale, scale) + np.outer(apart, apart) / 12.0
    return np.asarray(spread), max(min(left, 1.5 * used / (LAGS + 1)), 1.0)


def _opposite(rows: Sequence[JointRows], fitted: StackedFit) -> FloatArray:
    """(p,) delta at the same weights, if the other columns were those that hold the noise of z."""
    none = np.zeros(rows[0].shared.shape[1], dtype=np.bool_)
    turned = [replace(r, scaling=none if r.opposite is None else r.opposite) for r in rows]
    return fit_stacked(turned, fitted.columns, fitted.tolerance, fitted.sigma, fitted.share).delta


def _long_run(scores: FloatArray) -> FloatArray:
    """(p, p) of scores (B, p): Bartlett's weights keep it positive semidefinite."""
    total = scores.T @ scores
    for lag in range(1, min(LAGS, scores.shape[0] - 1) + 1):
        cross = scores[lag:].T @ scores[:-lag]
        total = total + (1.0 - lag / (LAGS + 1)) * (cross + cross.T)
    return np.asarray(total)


def own_response(rows: JointRows, fitted: StackedFit) -> FloatArray:
    """By how much 1/K and the joint's own coefficients fall as delta grows, (1 + k', p): (X' X + P)^-1 X' C.

    P is the precision of their prior. The first row is 0 where the gain is held.
    """
    prior = 0.0 if rows.precision is None else np.diag(rows.precision)
    response = inverse(rows.own.T @ rows.own + prior) @ (rows.own.T @ rows.shared[:, fitted.columns])
    return response if rows.held is None else np.concatenate([np.zeros((1, response.shape[1])), response])


def intervals(rows: Sequence[JointRows], fitted: StackedFit) -> FloatArray:
    """(p,) half widths of 95 % intervals of delta."""
    spread, freedom = covariance(rows, fitted)
    return np.asarray(student.ppf(0.975, freedom) * np.sqrt(np.maximum(np.diag(spread), 0.0)))
