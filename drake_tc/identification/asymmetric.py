"""The asymmetric penalty: a friction model that never over-compensates (Del Prete et al., 2016, section 3).

A feedforward that over-estimates friction makes the joint run away; one that under-estimates it is only weaker.
So residuals on the side of over-estimation cost w times more:

    s_i = sign(b_i),  r_i = s_i (a_iᵀ x − b_i),   min_x F(x) = Σ φ(r_i),   φ(z) = w z² if z > 0 else z²

F is convex and C¹, piecewise quadratic: a semi-smooth Newton method ends at the exact minimum in a few steps.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.errors import IdentificationError
from drake_tc.identification.autocorrelation import (
    automatic_bandwidth,
    critical_value_95,
    long_run_covariance,
)
from drake_tc.identification.regression import MAX_CONDITION, check_excitation, checked, column_scale
from drake_tc.types import FloatArray

_MAX_STEPS = 100
_COARSE = 20_000


@dataclass(frozen=True)
class AsymmetricFit:
    """Minimum of the asymmetric penalty.

    Attributes:
        names: The p parameters.
        coefficients: (p,) x.
        residual: (T,) b − A x [unit of b]; it has the sign of b where |b| is under-estimated.
        cost: F(x) [unit of b, squared].
        over_estimated: Share of samples with |A x| beyond |b|, in [0, 1].
        hac_covariance: (p, p) H⁻¹ S H⁻¹ from the penalty's own scores, autocorrelation included.
        ci95: (p, 2) 95 % confidence interval of the minimiser.
        condition_number: Of A with its columns scaled to unit length.
        steps: Newton steps taken.
    """

    names: tuple[str, ...]
    coefficients: FloatArray
    residual: FloatArray
    cost: float
    over_estimated: float
    hac_covariance: FloatArray
    ci95: FloatArray
    condition_number: float
    steps: int

    @property
    def parameters(self) -> dict[str, float]:
        """Estimates by name."""
        return dict(zip(self.names, map(float, self.coefficients), strict=True))


def penalty(z: FloatArray, weight: float = 100.0) -> FloatArray:
    """φ(z) = w z² for z > 0, z² otherwise; elementwise."""
    return np.asarray(np.where(z > 0, weight, 1.0) * z**2)


def asymmetric_least_squares(
    columns: FloatArray,
    target: FloatArray,
    *,
    names: Sequence[str] | None = None,
    weight: float = 100.0,
    lengths: Sequence[int] | None = None,
    max_condition: float = MAX_CONDITION,
) -> AsymmetricFit:
    """Minimise F by a semi-smooth Newton method with an Armijo line search; linear in the samples.

    Each step solves (Aᵀ D A) d = −Aᵀ D (A x − b), D_ii = w where r_i > 0, else 1, and halves d until F falls
    enough. Long logs start from the minimum over every k-th sample. Samples with b_i = 0 have s_i = 0 and
    take no part, as in the paper.

    Args:
        columns: A (T, p), finite.
        target: b (T,), finite.
        names: The p parameters; x0, x1, ... when None.
        weight: w >= 1; 1 is ordinary least squares.
        lengths: Lengths of the contiguous stretches, for the intervals.
        max_condition: Refuse worse column-scaled condition numbers.

    Raises:
        IdentificationError: As `least_squares`; a weight below 1; a search that does not come to rest.

    Source: Del Prete et al., 2016, eq. 8 (w = 100). The paper solved the QP below; this is exact.

    Example:
        >>> fit = asymmetric_least_squares(np.ones((2, 1)), np.array([1.0, 2.0]), weight=3.0)
        >>> fit.coefficients.round(6).tolist()  # (3 * 1 + 2) / 4
        [1.25]
    """
    a, b, labels = checked(columns, target, names)
    _check_weight(weight)
    sign = np.sign(b)
    # one row a parameter: every operation below runs along contiguous samples
    rows = np.ascontiguousarray(a.T) * np.abs(sign)
    scale = column_scale(rows.T, labels)
    rows /= scale[:, None]
    condition = check_excitation(_triangular(rows), labels, max_condition)
    y: FloatArray = np.asarray(np.linalg.solve(rows @ rows.T, rows @ b))
    if b.size > _COARSE:
        coarse = slice(None, None, b.size // _COARSE + 1)
        y, _ = _newton(rows[:, coarse], b[coarse], sign[coarse], weight, y)
    y, steps = _newton(rows, b, sign, weight, y)
    x = y / scale
    z = sign * (y @ rows - b)
    curvature = np.where(z > 0, weight, 1.0)
    scores = rows * (-sign * curvature * z)
    bandwidth = max(automatic_bandwidth(score, lengths) for score in scores)
    inverse = np.linalg.inv((rows * curvature) @ rows.T)
    meat = long_run_covariance(scores.T, bandwidth, lengths)
    covariance = inverse @ meat @ inverse / np.outer(scale, scale)
    half = critical_value_95(bandwidth, b.size) * np.sqrt(np.diag(covariance))
    return AsymmetricFit(
        names=labels,
        coefficients=x,
        residual=b - a @ x,
        cost=float(penalty(z, weight).sum()),
        over_estimated=float(np.mean(z > 0)),
        hac_covariance=covariance,
        ci95=np.stack([x - half, x + half], axis=1),
        condition_number=condition,
        steps=steps,
    )


def _triangular(rows: FloatArray) -> FloatArray:
    """R with RᵀR = rows rowsᵀ; from the samples themselves where the product is too ill-conditioned."""
    try:
        return np.asarray(np.linalg.cholesky(rows @ rows.T).T)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.qr(rows.T)[1])


def _newton(
    rows: FloatArray, goal: FloatArray, sign: FloatArray, weight: float, y: FloatArray
) -> tuple[FloatArray, int]:
    """Minimise from y; rows (p, T), goal and sign (T,). The minimiser and the steps taken."""
    error = y @ rows - goal
    for step in range(1, _MAX_STEPS + 1):
        curvature = np.where(sign * error > 0, weight, 1.0)
        weighted = curvature * error
        half_gradient = rows @ weighted
        cost = float(weighted @ error)
        direction = -np.linalg.solve((rows * curvature) @ rows.T, half_gradient)
        decrease = 2 * float(half_gradient @ direction)
        if -decrease <= 1e-15 * cost + 1e-300:
            return y, step
        along, length = direction @ rows, 1.0
        trial = error + along
        while penalty(sign * trial, weight).sum() > cost + 1e-4 * length * decrease:
            length *= 0.5
            if length < 1e-10:
                return y, step
            trial = error + length * along
        y, error = np.asarray(y + length * direction), trial
    raise IdentificationError(f"asymmetric fit did not come to rest in {_MAX_STEPS} Newton steps")


def _check_weight(weight: float) -> None:
    if not (np.isfinite(weight) and weight >= 1):
        raise IdentificationError(f"asymmetric weight must be finite and >= 1, got {weight:g}")
