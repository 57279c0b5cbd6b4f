"""Directions in which a cost does not change."""

import numpy as np
from scipy.linalg.lapack import dgeqp3, dorgqr

from drake_tc.kernels.lazy import Kernel
from drake_tc.types import FloatArray

_HAS_ONE_MINIMISER = Kernel("problem", "has_one_minimiser")
RANK = 1e-10
"""Relative to the longest: a row of D, less what the rows before it span, that is shorter adds no direction."""


def null_basis(matrix: FloatArray, tolerance: float = RANK) -> FloatArray:
    """(n, n - rank) orthonormal basis of {x: D x = 0}, by QR of D^T with column pivoting."""
    rows, n = matrix.shape
    if rows == 0:
        return np.eye(n)
    if tolerance <= RANK and _HAS_ONE_MINIMISER(np.ascontiguousarray(matrix)):
        return np.zeros((n, 0))
    factors, _, tau, _, _ = dgeqp3(matrix.T)
    pivots = np.abs(np.diagonal(factors))
    rank = int(np.count_nonzero(pivots > tolerance * pivots.max(initial=0.0)))
    square = np.zeros((n, n), order="F")
    square[:, : len(pivots)] = factors[:, : len(pivots)]
    basis: FloatArray = dorgqr(square, tau)[0][:, rank:]
    return basis
