"""Cholesky's factors and triangular systems of small matrices; their inner loops run along rows, without reductions.

`np.linalg` would cost more in its checks than these do in all, for up to some fifty rows.
"""

import numpy as np

from drake_tc.kernels.compiling import helper
from drake_tc.types import FloatArray


@helper
def factor_into(factor: FloatArray, matrix: FloatArray) -> bool:
    """U of matrix = U^T U into the upper triangle of `factor` (n, n); False where it is not positive definite."""
    n = matrix.shape[0]
    for i in range(n):
        for j in range(i, n):
            factor[i, j] = matrix[i, j]
    for k in range(n):
        pivot = factor[k, k]
        if not pivot > 0.0:
            return False
        root = np.sqrt(pivot)
        inverse = 1.0 / root
        factor[k, k] = root
        for j in range(k + 1, n):
            factor[k, j] *= inverse
        for i in range(k + 1, n):
            share = factor[k, i]
            for j in range(i, n):
                factor[i, j] -= share * factor[k, j]
    return True


@helper
def whiten_vector(factor: FloatArray, vector: FloatArray) -> None:
    """U^-T b in place of b (n,)."""
    n = factor.shape[0]
    for k in range(n):
        value = vector[k] / factor[k, k]
        vector[k] = value
        for j in range(k + 1, n):
            vector[j] -= value * factor[k, j]


@helper
def colour_vector(factor: FloatArray, vector: FloatArray) -> None:
    """U^-1 b in place of b (n,)."""
    for k in range(factor.shape[0] - 1, -1, -1):
        value = vector[k]
        for j in range(k + 1, factor.shape[0]):
            value -= factor[k, j] * vector[j]
        vector[k] = value / factor[k, k]


@helper
def whiten_columns(factor: FloatArray, columns: FloatArray) -> None:
    """U^-T B in place of B (n, c)."""
    n, c = factor.shape[0], columns.shape[1]
    for k in range(n):
        inverse = 1.0 / factor[k, k]
        for j in range(c):
            columns[k, j] *= inverse
        for i in range(k + 1, n):
            share = factor[k, i]
            for j in range(c):
                columns[i, j] -= share * columns[k, j]


@helper
def times_vector(out: FloatArray, matrix: FloatArray, vector: FloatArray) -> None:
    """A x into out (m,), also where a size is 0."""
    if matrix.shape[0] and matrix.shape[1]:
        np.dot(matrix, vector, out)
    else:
        out[:] = 0.0
