"""The Gaussian fit of a linear model with priors and bounds, and its log evidence.

With whitened rows u = X b + n, n ~ N(0, s^2), and priors b_k ~ N(m_k, d_k^2), one-sided where a bound says so:

    log Z = -N/2 log(2 pi s^2) - RSS/(2 s^2) - sum_k ((b_k - m_k)^2/(2 d_k^2) + log d_k) + K log 2 - 1/2 log|H|
    H     = X'X/s^2 + diag(1/d_k^2)

at the most probable b, K the number of one-sided coefficients (MacKay, 1992, "Bayesian interpolation", equation 2.7).
s^2 is where RSS/s^2 equals N less the number of parameters that the rows determine (his equation 4.4).
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from drake_tc.types import BoolArray, FloatArray, IntArray

ROUNDS = 4
"""Of the fixed point for s^2, which contracts by the share of determined parameters, K/N."""
JITTER = 1e-12
ROUNDING = 1e-9
"""Information over that of a column below which noise in the columns is not told from rounding."""


@dataclass(frozen=True)
class Prior:
    """What is known of coefficients (k,) beforehand.

    Attributes:
        mean, deviation: Of each.
        positive: Which may not be negative.
        reach: Standard deviations from the mean beyond which a coefficient is impossible; one number for all, or (k,).
    """

    mean: FloatArray
    deviation: FloatArray
    positive: BoolArray
    reach: FloatArray | float = np.inf

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Least and largest possible values (k,)."""
        most = self.reach * self.deviation
        return np.where(self.positive, np.maximum(self.mean - most, 0.0), self.mean - most), self.mean + most

    def held_at_zero(self, share: float) -> "Prior":
        """The same coefficients held at 0, up to a share of their standard deviations."""
        return Prior(np.zeros_like(self.mean), share * self.deviation, self.positive)

    def part(self, places: slice | IntArray) -> "Prior":
        """Of these coefficients alone."""
        return Prior(self.mean[places], self.deviation[places], self.positive[places], self._reaches[places])

    @classmethod
    def stacked(cls, parts: "list[Prior]") -> "Prior":
        """Of the coefficients of all parts, one after the other."""
        names = ("mean", "deviation", "positive", "_reaches")
        return cls(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))

    @property
    def _reaches(self) -> FloatArray:
        return np.broadcast_to(self.reach, self.mean.shape)


@dataclass(frozen=True)
class Products:
    """X'X (k, k), X'u (k,), u'u and the number of rows N of whitened rows; sums over rows that add up over data."""

    gram: FloatArray
    moment: FloatArray
    square: float
    rows: float

    @classmethod
    def of(cls, design: FloatArray, target: FloatArray, share: float = 1.0) -> "Products":
        """The products of a design (N, k) and a target (N,), of which a share of the rows is independent."""
        scaled = share * design
        return cls(scaled.T @ design, scaled.T @ target, share * float(target @ target), share * target.size)

    def __add__(self, other: "Products") -> "Products":
        return Products(
            self.gram + other.gram, self.moment + other.moment, self.square + other.square, self.rows + other.rows
        )

    def times(self, weight: float) -> "Products":
        """Of rows of this weight."""
        return Products(weight * self.gram, weight * self.moment, weight * self.square, self.rows)

    def at(self, places: IntArray) -> "Products":
        """Of these columns alone."""
        return Products(self.gram[np.ix_(places, places)], self.moment[places], self.square, self.rows)

    def without_noise(self, gram: FloatArray, moment: FloatArray) -> "Products":
        """What the rows tell of the coefficients if noise dX in the columns and du in the target is part of them.

        The moments X'u - E[dX'du] are those of G b with G = X'X - E[dX'dX] (Fuller, 1987, section 2.2). Estimates
        G^-1 (X'u - E[dX'du]) have the covariance s^2 G^-1 X'X G^-1 with s^2 of what they leave of u, and these products
        are those of a fit that has them. Along a direction in which the columns are noise alone, the rows tell nothing.

        Args:
            gram: (k, k) E[dX'dX].
            moment: (k,) E[dX'du].
        """
        size = np.diag(self.gram)
        scale = 1.0 / np.sqrt(np.where(size > 0.0, size, 1.0))
        lower = np.linalg.cholesky(self.gram * np.outer(scale, scale) + ROUNDING * np.eye(scale.size))
        half = np.linalg.solve(lower, gram * np.outer(scale, scale))
        share, turn = np.linalg.eigh(np.linalg.solve(lower, half.T))
        left = np.clip(1.0 - share, 0.0, 1.0)
        root = lower @ turn / scale[:, None]
        told = turn.T @ np.linalg.solve(lower, scale * (self.moment - moment))
        return replace(self, gram=(root * left**2) @ root.T, moment=root @ (left * told))

    def leaving(self, rss: float, beta: FloatArray) -> "Products":
        """With u'u for which these coefficients leave this RSS."""
        return replace(self, square=rss + float(2.0 * beta @ self.moment - beta @ self.gram @ beta))

    def rss(self, beta: FloatArray) -> float:
        """|u - X b|^2."""
        return max(float(self.square - 2.0 * beta @ self.moment + beta @ self.gram @ beta), 1e-12 * self.square)


@dataclass(frozen=True, eq=False)
class Posterior:
    """The Gaussian posterior of a linear model.

    Attributes:
        beta: (k,) most probable coefficients.
        hessian: (k, k) H, the inverse of their covariance.
        variance: s^2 of the white part of the noise.
        log_evidence: log Z without the determinant of the whitening.
    """

    beta: FloatArray
    hessian: FloatArray
    variance: float
    log_evidence: float

    @cached_property
    def covariance(self) -> FloatArray:
        """(k, k) H^-1, its eigenvalues bounded where rounding hides them."""
        scale = 1.0 / np.sqrt(np.diag(self.hessian))
        eigenvalues, vectors = np.linalg.eigh(self.hessian * np.outer(scale, scale))
        return np.asarray((vectors / np.maximum(eigenvalues, JITTER)) @ vectors.T * np.outer(scale, scale))

    def with_covariance(self, covariance: FloatArray) -> "Posterior":
        """The same coefficients with this covariance (k, k), which may be singular."""
        sizes = np.outer(*2 * [1.0 / np.sqrt(np.diag(covariance))])
        return replace(self, hessian=np.asarray(sizes * np.linalg.pinv(covariance * sizes, JITTER, hermitian=True)))


def log_determinant(hessian: FloatArray) -> float:
    """Of a positive matrix (k, k) whose columns may have any scale."""
    scale = 1.0 / np.sqrt(np.diag(hessian))
    sign, scaled = np.linalg.slogdet(hessian * np.outer(scale, scale) + JITTER * np.eye(scale.size))
    return float(scaled if sign > 0 else scale.size * np.log(JITTER)) - 2.0 * float(np.sum(np.log(scale)))


def mode(products: Products, prior: Prior, variance: float) -> FloatArray:
    """The most probable coefficients (k,) under noise of this variance.

    Those that would be beyond a bound are set to it, all at once, until none is.
    """
    precision = variance / prior.deviation**2
    hessian = products.gram + np.diag(precision)
    right = products.moment + precision * prior.mean
    scale = 1.0 / np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    scaled = hessian * np.outer(scale, scale) + JITTER * np.eye(scale.size)
    (least, most), beta = prior.bounds, np.zeros(scale.size)
    free = np.ones(scale.size, dtype=bool)
    while True:
        rest = scale * (right - hessian[:, ~free] @ beta[~free])
        beta[free] = scale[free] * np.linalg.solve(scaled[np.ix_(free, free)], rest[free])
        beyond = free & ((beta < least) | (beta > most))
        if not beyond.any():
            return beta
        beta[beyond], free = np.clip(beta, least, most)[beyond], free & ~beyond


def posterior(
    products: Products, prior: Prior, variance: float | None = None, *, start: float | None = None
) -> Posterior:
    """The most probable coefficients and the log evidence.

    Args:
        products: Of the whitened rows.
        prior: Of their coefficients.
        variance: s^2 where it is known; None estimates it.
        start: Where the estimate of s^2 begins; the fixed point is then one step away.
    """
    size, guess = prior.mean.size, variance if start is None else start
    value = max(products.square, 1e-300) / max(products.rows, 1) if guess is None else guess
    for _ in range(ROUNDS if guess is None else 1 if start is None else 2):
        beta = mode(products, prior, value)
        rss = products.rss(beta)
        if variance is None:
            value = max(rss / max(products.rows - size, 1), 1e-300)
    hessian = products.gram / value + np.diag(1.0 / prior.deviation**2)
    off = (beta - prior.mean) / prior.deviation
    evidence = -0.5 * products.rows * np.log(2.0 * np.pi * value) - 0.5 * rss / value - 0.5 * float(off @ off)
    evidence += -float(np.sum(np.log(prior.deviation))) - 0.5 * log_determinant(hessian)
    evidence += float(np.log(2.0) * np.count_nonzero(prior.positive))
    return Posterior(beta, hessian, value, evidence)
