"""The Gaussian fit of a linear model with priors and bounds, and its log evidence.

With whitened rows u = X b + n, n ~ N(0, s^2), and priors b_k ~ N(m_k, d_k^2), one-sided where a bound says so:

    log Z = -N/2 log(2 pi s^2) - RSS/(2 s^2) - sum_k ((b_k - m_k)^2/(2 d_k^2) + log d_k) + K log 2 - 1/2 log|H|
    H     = X'X/s^2 + diag(1/d_k^2)

at the most probable b, K the number of one-sided coefficients (MacKay, 1992, "Bayesian interpolation", equation 2.7).
s^2 is where RSS/s^2 equals N less the number of parameters that the rows determine (his equation 4.4).
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from drake_tc.types import BoolArray, FloatArray

ROUNDS = 4
"""Of the fixed point for s^2, which contracts by the share of determined parameters, K/N."""
RELATIVE_JITTER = 1e-12


@dataclass(frozen=True)
class Prior:
    """What is known of coefficients (k,) beforehand: mean, standard deviation, and which may not be negative."""

    mean: FloatArray
    deviation: FloatArray
    positive: BoolArray

    @classmethod
    def stacked(cls, parts: "list[Prior]") -> "Prior":
        """Of the coefficients of all parts, one after the other."""
        return cls(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("mean", "deviation", "positive")))


@dataclass(frozen=True)
class Products:
    """X'X (k, k), X'u (k,), u'u and the number of rows N of whitened rows; sums over rows that add up over data."""

    gram: FloatArray
    moment: FloatArray
    square: float
    rows: int

    @classmethod
    def of(cls, design: FloatArray, target: FloatArray) -> "Products":
        """The products of a design (N, k) and a target (N,)."""
        return cls(design.T @ design, design.T @ target, float(target @ target), target.size)

    def __add__(self, other: "Products") -> "Products":
        return Products(
            self.gram + other.gram, self.moment + other.moment, self.square + other.square, self.rows + other.rows
        )

    def rss(self, beta: FloatArray) -> float:
        """|u - X b|^2."""
        return max(float(self.square - 2.0 * beta @ self.moment + beta @ self.gram @ beta), 1e-12 * self.square)


@dataclass(frozen=True)
class Posterior:
    """The Gaussian posterior of a linear model.

    Attributes:
        beta: (k,) most probable coefficients.
        covariance: (k, k).
        variance: s^2 of the white part of the noise.
        log_evidence: log Z without the determinant of the whitening.
    """

    beta: FloatArray
    covariance: FloatArray
    variance: float
    log_evidence: float


def mode(products: Products, prior: Prior, variance: float) -> FloatArray:
    """The most probable coefficients (k,) under noise of this variance, within their bounds."""
    precision = variance / prior.deviation**2
    hessian = products.gram + np.diag(precision)
    right = products.moment + precision * prior.mean
    scale = 1.0 / np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    scaled = hessian * np.outer(scale, scale) + RELATIVE_JITTER * np.eye(scale.size)
    beta = scale * np.linalg.solve(scaled, scale * right)
    if not np.any(prior.positive & (beta < 0.0)):
        return np.asarray(beta)
    root = np.linalg.cholesky(scaled).T
    lower = np.where(prior.positive, 0.0, -np.inf)
    found = lsq_linear(root, np.linalg.solve(root.T, scale * right), bounds=(lower, np.inf), method="bvls")
    return np.asarray(scale * np.maximum(found.x, lower))


def posterior(products: Products, prior: Prior, variance: float | None = None) -> Posterior:
    """Coefficients, their covariance and the log evidence.

    Args:
        products: Of the whitened rows.
        prior: Of their coefficients.
        variance: s^2 where it is known; None estimates it.
    """
    known, size = variance is not None, prior.mean.size
    value = variance if variance is not None else max(products.square, 1e-300) / max(products.rows, 1)
    for _ in range(1 if known else ROUNDS):
        beta = mode(products, prior, value)
        rss = products.rss(beta)
        if not known:
            value = max(rss / max(products.rows - size, 1), 1e-300)
    free = ~(prior.positive & (beta <= 0.0))
    hessian = products.gram / value + np.diag(1.0 / prior.deviation**2)
    scale = 1.0 / np.sqrt(np.diag(hessian))
    eigenvalues, vectors = np.linalg.eigh(hessian * np.outer(scale, scale))
    eigenvalues = np.maximum(eigenvalues, RELATIVE_JITTER)
    log_determinant = float(np.sum(np.log(eigenvalues)) - 2.0 * np.sum(np.log(scale)))
    covariance = (vectors / eigenvalues) @ vectors.T * np.outer(scale, scale)
    kept = ((beta - prior.mean) / prior.deviation)[free | (prior.mean != 0.0)]
    evidence = -0.5 * products.rows * np.log(2.0 * np.pi * value) - 0.5 * rss / value - 0.5 * float(kept @ kept)
    evidence += -float(np.sum(np.log(prior.deviation))) - 0.5 * log_determinant
    evidence += float(np.log(2.0) * np.count_nonzero(prior.positive))
    return Posterior(beta, covariance, value, evidence)
