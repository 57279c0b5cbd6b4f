"""Cholesky's factors and triangular systems of small matrices; their inner loops run along rows, without reductions.

`np.linalg` would cost more in its checks than these do in all, for up to some fifty rows.
"""

import numpy as np

from drake_tc.kernels.compiling import helper
from drake_tc.types import FloatArray, IntArray


@helper
def factor_into(factor: FloatArray, matrix: FloatArray) -> bool:
    """U of matrix = U^T U into the upper triangle of `factor` (n, n); False where it is not positive definite.

    Row k is U_kj = (M_kj - sum_{i<k} U_ik U_ij) / U_kk. The sum takes four rows at a time, so that row k is read and
    written once for four products.
    """
    n = matrix.shape[0]
    for k in range(n):
        row, whole = factor[k], k - k % 4
        for j in range(k, n):
            row[j] = matrix[k, j]
        for i in range(0, whole, 4):
            a, b, c, d = factor[i, k], factor[i + 1, k], factor[i + 2, k], factor[i + 3, k]
            first, second, third, fourth = factor[i], factor[i + 1], factor[i + 2], factor[i + 3]
            for j in range(k, n):
                row[j] -= a * first[j] + b * second[j] + c * third[j] + d * fourth[j]
        for i in range(whole, k):
            share = factor[i, k]
            for j in range(k, n):
                row[j] -= share * factor[i, j]
        if not row[k] > 0.0:
            return False
        root = np.sqrt(row[k])
        inverse = 1.0 / root
        row[k] = root
        for j in range(k + 1, n):
            row[j] *= inverse
    return True


@helper
def subtract_rows(
    out: FloatArray, rows: FloatArray, shares: FloatArray, picks: IntArray, count: int, first: int, last: int
) -> None:
    """out[first:last] -= sum_i shares[i] rows[picks[i], first:last], i < count, four rows at a time."""
    whole = count - count % 4
    for i in range(0, whole, 4):
        a, b, c, d = shares[i], shares[i + 1], shares[i + 2], shares[i + 3]
        one, two, three, four = rows[picks[i]], rows[picks[i + 1]], rows[picks[i + 2]], rows[picks[i + 3]]
        for j in range(first, last):
            out[j] -= a * one[j] + b * two[j] + c * three[j] + d * four[j]
    for i in range(whole, count):
        a, one = shares[i], rows[picks[i]]
        for j in range(first, last):
            out[j] -= a * one[j]


@helper
def inverse_factor(matrix: FloatArray) -> FloatArray:
    """W = L^-T of matrix = L^T L, upper triangular, so that W M W^T = 1; all NaN where M is not positive definite.

    Rows are eliminated from the last to the first, k = n - 1, ..., 0:

        L_kj = (M_kj - sum_{i>k} L_ik L_ij) / L_kk,  j <= k,     W_kj = (1_kj - sum_{i>k} L_ik W_ij) / L_kk,  j >= k

    Both sums leave out the i with L_ik = 0. In a mass matrix whose joints stand after their parents these are all i
    but the joints that k carries, since elimination from the leaves fills no entry in (Featherstone, 2008, 6.5).
    """
    n = matrix.shape[0]
    factor, inverse = np.empty((n, n)), np.zeros((n, n))
    shares, picks = np.empty(n), np.empty(n, dtype=np.int64)
    for k in range(n - 1, -1, -1):
        row, count = factor[k], 0
        for i in range(k + 1, n):
            if factor[i, k] != 0.0:
                shares[count], picks[count] = factor[i, k], i
                count += 1
        for j in range(k + 1):
            row[j] = matrix[k, j]
        subtract_rows(row, factor, shares, picks, count, 0, k + 1)
        if not row[k] > 0.0:
            inverse[:] = np.nan
            return inverse
        share = 1.0 / np.sqrt(row[k])
        for j in range(k + 1):
            row[j] *= share
        inverse[k, k] = 1.0
        subtract_rows(inverse[k], inverse, shares, picks, count, k + 1, n)
        for j in range(k, n):
            inverse[k, j] *= share
    return inverse


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
