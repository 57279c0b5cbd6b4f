"""Linear least squares whose confidence intervals account for autocorrelation.

Robot logs are sampled far faster than their residuals decorrelate: an interval that counts samples as
independent is too narrow by the square root of the correlation time. Here every interval is Newey–West's.

What a linear least-squares fit returns: estimates, and how far they can be trusted.

Which columns of a regressor the data can tell apart.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr

from drake_tc.errors import IdentificationError
from drake_tc.identification.autocorrelation import (
    automatic_bandwidth,
    correlation_time,
    critical_value_95,
    long_run_covariance,
)
from drake_tc.types import FloatArray, IntArray


@dataclass(frozen=True)
class LinearFit:
    """Estimates of x in A x ≈ b, with intervals that account for autocorrelated residuals.

    Attributes:
        names: The p parameters.
        coefficients: (p,) [unit of b / unit of the column].
        residual: (T,) b − A x [unit of b].
        rms: Root mean square of the residual, weighted where weights were given [unit of b].
        covariance: (p, p) σ²(AᵀA)⁻¹, valid for white residuals only.
        hac_covariance: (p, p) Newey–West covariance.
        ci95: (p, 2) 95 % confidence interval from `hac_covariance` and a critical value that knows its bandwidth.
        bandwidth: Bartlett lags used.
        effective_samples: T over the residual's integrated autocorrelation time.
        correlation: (p, p) correlation matrix of the estimates.
        condition_number: Of A with its columns scaled to unit length.
    """

    names: tuple[str, ...]
    coefficients: FloatArray
    residual: FloatArray
    rms: float
    covariance: FloatArray
    hac_covariance: FloatArray
    ci95: FloatArray
    bandwidth: int
    effective_samples: float
    correlation: FloatArray
    condition_number: float

    @property
    def standard_errors(self) -> FloatArray:
        """(p,) square roots of the diagonal of `hac_covariance`."""
        return np.asarray(np.sqrt(np.diag(self.hac_covariance)))

    @property
    def parameters(self) -> dict[str, float]:
        """Estimates by name."""
        return dict(zip(self.names, map(float, self.coefficients), strict=True))

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """95 % intervals by name."""
        return {n: (float(lo), float(hi)) for n, (lo, hi) in zip(self.names, self.ci95, strict=True)}

    def predict(self, columns: FloatArray) -> FloatArray:
        """A x for other samples: (T, p) to (T,)."""
        return np.asarray(columns @ self.coefficients)


MAX_CONDITION = 1e6
_GRAM_LIMIT = 1e-6


def least_squares(
    columns: FloatArray,
    target: FloatArray,
    *,
    names: Sequence[str] | None = None,
    weights: FloatArray | None = None,
    lengths: Sequence[int] | None = None,
    max_condition: float = MAX_CONDITION,
) -> LinearFit:
    """Estimate x in A x ≈ b: min Σ w_t (b_t − a_tᵀ x)².

    Covariance (HAC): H⁻¹ S H⁻¹ with H = AᵀWA, S the Bartlett long-run covariance of the scores
    w_t a_t (b_t − a_tᵀx).

    Args:
        columns: A (T, p), finite.
        target: b (T,), finite.
        names: The p parameters, for results and messages; x0, x1, ... when None.
        weights: w (T,) >= 0; None for ones.
        lengths: Lengths of the contiguous stretches (runs, segments), in order; one stretch when None.
        max_condition: Refuse worse column-scaled condition numbers.

    Raises:
        IdentificationError: Shapes that do not fit, values that are not finite, fewer samples than parameters,
            or an excitation too poor, with the condition number and the parameter that suffers.

    Source: Newey and West, 1987; Kiefer and Vogelsang 2005 for the critical value.

    Example:
        >>> columns = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [2.0, 1.0]])
        >>> fit = least_squares(columns, columns @ [0.5, 2.0], names=("viscous", "coulomb"))
        >>> fit.coefficients.round(6).tolist()
        [0.5, 2.0]
    """
    a, b, labels = checked(columns, target, names)
    root = np.sqrt(checked_weights(weights, b.size))
    rows, goal = a * root[:, None], b * root
    scale = column_scale(rows, labels)
    r, projected = _factor(rows / scale, goal)
    condition = check_excitation(r, labels, max_condition)
    x = np.linalg.solve(r, projected) / scale
    residual = b - a @ x
    scores = rows * (root * residual)[:, None]
    solved = _Solved(labels, x, residual, root, scores / scale, r, scale, condition)
    return _with_uncertainty(solved, lengths)


@dataclass(frozen=True)
class _Solved:
    """A solved fit before its uncertainty; scores and r belong to columns scaled to unit length."""

    names: tuple[str, ...]
    x: FloatArray
    residual: FloatArray
    root: FloatArray
    scores: FloatArray
    r: FloatArray
    scale: FloatArray
    condition: float


def _with_uncertainty(fit: _Solved, lengths: Sequence[int] | None) -> LinearFit:
    samples, p = fit.scores.shape
    units = np.outer(fit.scale, fit.scale)
    hessian = fit.r.T @ fit.r
    bandwidth = max(automatic_bandwidth(score, lengths) for score in fit.scores.T)
    freedom = samples / max(samples - p, 1)
    meat = freedom * long_run_covariance(fit.scores, bandwidth, lengths)
    inverse = np.linalg.inv(hessian)
    hac = inverse @ meat @ inverse / units
    squares = float(np.sum((fit.root * fit.residual) ** 2))
    deviation = np.sqrt(np.diag(hac))
    half = critical_value_95(bandwidth, samples) * deviation
    safe = np.where(deviation > 0, deviation, 1.0)
    correlation = hac / np.outer(safe, safe)
    np.fill_diagonal(correlation, 1.0)
    return LinearFit(
        names=fit.names,
        coefficients=fit.x,
        residual=fit.residual,
        rms=float(np.sqrt(squares / float(fit.root @ fit.root))),
        covariance=squares / max(samples - p, 1) * inverse / units,
        hac_covariance=hac,
        ci95=np.stack([fit.x - half, fit.x + half], axis=1),
        bandwidth=bandwidth,
        effective_samples=samples / min(correlation_time(fit.root * fit.residual, lengths), samples),
        correlation=correlation,
        condition_number=fit.condition,
    )


def checked(
    columns: FloatArray, target: FloatArray, names: Sequence[str] | None
) -> tuple[FloatArray, FloatArray, tuple[str, ...]]:
    """A (T, p), b (T,) and the names, or an IdentificationError that says what does not fit."""
    a, b = np.asarray(columns, dtype=np.float64), np.asarray(target, dtype=np.float64)
    if a.ndim != 2 or b.shape != a.shape[:1] or a.shape[1] == 0:
        raise IdentificationError(f"expected columns (T, p) and target (T,), got {a.shape} and {b.shape}")
    labels = tuple(names) if names is not None else tuple(f"x{i}" for i in range(a.shape[1]))
    if len(labels) != a.shape[1]:
        raise IdentificationError(f"{a.shape[1]} columns but {len(labels)} names: {list(labels)}")
    if b.size <= a.shape[1]:
        raise IdentificationError(f"{a.shape[1]} parameters need more than {b.size} samples")
    bad = [label for label, column in zip(labels, a.T, strict=True) if not np.isfinite(column).all()]
    if bad or not np.isfinite(b).all():
        where = f"columns {bad}" if bad else "target"
        raise IdentificationError(f"expected finite samples; {where} of the fit hold NaN or infinity")
    return a, b, labels


def checked_weights(weights: FloatArray | None, samples: int) -> FloatArray:
    """Weights (T,), ones when None, or an IdentificationError."""
    if weights is None:
        return np.ones(samples)
    w = np.asarray(weights, dtype=np.float64)
    if w.shape != (samples,) or not (np.isfinite(w).all() and (w >= 0).all() and w.any()):
        raise IdentificationError(f"weights must be {samples} finite values >= 0, not all 0")
    return w


def column_scale(rows: FloatArray, names: tuple[str, ...]) -> FloatArray:
    """Euclidean length of each column (p,); an all-zero column is an IdentificationError."""
    scale = np.sqrt(np.einsum("ij,ij->j", rows, rows))
    dead = [name for name, length in zip(names, scale, strict=True) if not length > 0]
    if dead:
        raise IdentificationError(
            f"excitation too poor: condition number inf; nothing in the data excites {', '.join(dead)}"
        )
    return np.asarray(scale)


def check_excitation(r: FloatArray, names: tuple[str, ...], max_condition: float) -> float:
    """Condition number of the scaled columns, from their triangular factor R.

    Raises:
        IdentificationError: When it exceeds `max_condition`. The right singular vector of the smallest singular
            value is the combination of parameters that the data do not see; its largest entry suffers most.
    """
    _, singular, vt = np.linalg.svd(r)
    condition = float(singular[0] / singular[-1]) if singular[-1] > 0 else np.inf
    if condition > max_condition:
        blind = np.abs(vt[-1])
        worst = int(np.argmax(blind))
        others = [names[i] for i in np.argsort(-blind) if i != worst and blind[i] > 0.2]
        mixed = f", which the data cannot tell from {', '.join(others)}" if others else ""
        raise IdentificationError(
            f"excitation too poor: condition number {condition:.3g} (at most {max_condition:.3g}); "
            f"the parameter that suffers is {names[worst]}{mixed}; record richer motion or declare it"
        )
    return condition


def _factor(rows: FloatArray, goal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """R (p, p) and Qᵀ goal (p,) of rows = Q R.

    From the p x p Gram matrix, much faster on long logs, where its squared condition number costs fewer than
    six digits; else by QR of the samples.
    """
    gram = rows.T @ rows
    eigenvalues = np.linalg.eigvalsh(gram)
    if eigenvalues[0] > _GRAM_LIMIT * eigenvalues[-1]:
        lower = np.linalg.cholesky(gram)
        return np.asarray(lower.T), np.asarray(np.linalg.solve(lower, rows.T @ goal))
    q, r = np.linalg.qr(rows)
    return np.asarray(r), np.asarray(q.T @ goal)


def independent_columns(matrix: FloatArray, tolerance: float = 1e-5) -> IntArray:
    """Indices, ascending, of a largest set of columns of A (N, p) that is numerically independent.

    Rank-revealing QR of A with columns scaled to unit length, A P = Q R: the leading columns, as many as there are
    |R_ii| > tolerance |R_00|. The base parameters belong to them; a column left out is a combination of these.

    Source: Gautier, Numerical calculation of the base inertial parameters of robots (1991).
    """
    scale = np.linalg.norm(matrix, axis=0)
    live = np.flatnonzero(scale > 1e-8 * max(float(scale.max(initial=0.0)), 1e-300))
    if live.size == 0:
        return live
    r, order = qr(matrix[:, live] / scale[live], mode="r", pivoting=True)
    size = np.abs(np.diag(r))
    return np.asarray(np.sort(live[order[: int(np.sum(size > tolerance * size[0]))]]))


def base_combinations(matrix: FloatArray, tolerance: float = 1e-5) -> tuple[IntArray, FloatArray]:
    """The base parameters of a regressor A (N, p), as combinations of its parameters: A pi = A_b (M pi).

    Args:
        matrix: A.
        tolerance: As in `independent_columns`.

    Returns:
        Indices (b,) of the independent columns A_b, and M (b, p): the identity in those columns, and in each other one
        the factors with which it is made of them.
    """
    chosen = independent_columns(matrix, tolerance)
    scale = np.linalg.norm(matrix, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    unit = matrix / scale
    mix = np.linalg.lstsq(unit[:, chosen], unit, rcond=None)[0] * (scale / scale[chosen][:, None])
    mix[np.abs(mix) < 1e-6] = 0.0
    return chosen, np.asarray(mix)
