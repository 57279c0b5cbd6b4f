"""What makes a matrix a covariance."""

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray

ROUNDING = 1e-9
"""Relative to the largest variance: how far from symmetric and positive semidefinite a covariance may be."""


def checked_covariance(covariance: FloatArray) -> FloatArray:
    """(n, n) exactly symmetric, variances >= 0, of a matrix that is so but for rounding.

    Args:
        covariance: (n, n), n >= 1.

    Raises:
        ParamsError: not finite, not symmetric or not positive semidefinite.
    """
    if not np.isfinite(covariance).all():
        raise ParamsError("covariance: expected finite numbers, got NaN or infinity")
    largest = float(np.abs(np.diagonal(covariance)).max())
    skewness = float(np.abs(covariance - covariance.T).max())
    if skewness > ROUNDING * largest:
        raise ParamsError(f"covariance: expected a symmetric matrix; it differs from its transpose by {skewness:.3g}")
    mean: FloatArray = 0.5 * (covariance + covariance.T)
    lowest = float(np.linalg.eigvalsh(mean)[0])
    if lowest < -ROUNDING * largest:
        raise ParamsError(
            f"covariance: expected a positive semidefinite matrix; its smallest eigenvalue is {lowest:.3g}"
        )
    np.fill_diagonal(mean, np.maximum(np.diagonal(mean), 0.0))
    return mean
