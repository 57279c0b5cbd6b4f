"""What a linear least-squares fit returns: estimates, and how far they can be trusted."""

from dataclasses import dataclass

import numpy as np

from drake_tc.types import BoolArray, FloatArray


@dataclass(frozen=True)
class LinearFit:
    """Estimates of x in A x ≈ b, with intervals that account for autocorrelated residuals.

    Attributes:
        names: The p parameters.
        coefficients: (p,) [unit of b / unit of the column].
        residual: (T,) b − A x [unit of b].
        rms: Root mean square of the residual, weighted where weights were given [unit of b].
        covariance: (p, p) σ²(AᵀA)⁻¹, valid for white residuals only.
        hac_covariance: (p, p) Newey–West covariance; zero rows for parameters that rest on a bound.
        ci95: (p, 2) 95 % confidence interval from `hac_covariance` and a critical value that knows its bandwidth.
        bandwidth: Bartlett lags used.
        effective_samples: T over the residual's integrated autocorrelation time.
        correlation: (p, p) correlation matrix of the estimates.
        condition_number: Of A with its columns scaled to unit length.
        at_bound: (p,) whether the estimate rests on a bound.
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
    at_bound: BoolArray

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
