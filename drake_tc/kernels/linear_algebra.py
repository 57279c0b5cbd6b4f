"""Cholesky's factors and triangular systems of small matrices; their inner loops run along rows, without reductions.

`np.linalg` would cost more in its checks than these do in all, for up to some fifty rows.
Vectors (3,) and rotations (3, 3): each result is a new array.
"""

import math

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


@helper
def times(R: FloatArray, a: FloatArray) -> FloatArray:
    """R a."""
    out = np.empty(3)
    for i in range(3):
        out[i] = R[i, 0] * a[0] + R[i, 1] * a[1] + R[i, 2] * a[2]
    return out


@helper
def times_transposed(R: FloatArray, a: FloatArray) -> FloatArray:
    """R^T a."""
    out = np.empty(3)
    for i in range(3):
        out[i] = R[0, i] * a[0] + R[1, i] * a[1] + R[2, i] * a[2]
    return out


@helper
def product(R: FloatArray, S: FloatArray) -> FloatArray:
    """R S."""
    out = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            out[i, j] = R[i, 0] * S[0, j] + R[i, 1] * S[1, j] + R[i, 2] * S[2, j]
    return out


@helper
def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """A x b."""
    out = np.empty(3)
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
    return out


@helper
def dot(a: FloatArray, b: FloatArray) -> float:
    """A . b of two vectors of any length."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@helper
def turned(yaw: float) -> FloatArray:
    """R_z(yaw)."""
    out = np.zeros((3, 3))
    c, s = math.cos(yaw), math.sin(yaw)
    out[0, 0], out[0, 1], out[1, 0], out[1, 1], out[2, 2] = c, -s, s, c, 1.0
    return out


@helper
def levelled(up: FloatArray) -> FloatArray:
    """R_y(pitch) R_x(roll) of the body in whose axes the world's vertical is `up` (3,), of unit length."""
    roll = math.atan2(up[1], up[2])
    sp = min(1.0, max(-1.0, -up[0]))
    cp = math.sqrt(1.0 - sp * sp)
    sr, cr = math.sin(roll), math.cos(roll)
    out = np.empty((3, 3))
    out[0, 0], out[0, 1], out[0, 2] = cp, sp * sr, sp * cr
    out[1, 0], out[1, 1], out[1, 2] = 0.0, cr, -sr
    out[2, 0], out[2, 1], out[2, 2] = -sp, cp * sr, cp * cr
    return out


@helper
def remainder(angle: float) -> float:
    """The angle less the nearest whole number of turns, in [-pi, pi]."""
    turns: float = np.rint(angle / math.tau)
    return angle - math.tau * turns


@helper
def wxyz_into(out: FloatArray, R: FloatArray) -> None:
    """The quaternion [w x y z] of a rotation into out[:4], of unit length; by its largest part (Shepperd, 1978)."""
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    if trace >= R[0, 0] and trace >= R[1, 1] and trace >= R[2, 2]:
        out[0], out[1], out[2], out[3] = 1.0 + trace, R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    elif R[0, 0] >= R[1, 1] and R[0, 0] >= R[2, 2]:
        out[0], out[1] = R[2, 1] - R[1, 2], 1.0 - (trace - 2.0 * R[0, 0])
        out[2], out[3] = R[0, 1] + R[1, 0], R[0, 2] + R[2, 0]
    elif R[1, 1] >= R[2, 2]:
        out[0], out[1] = R[0, 2] - R[2, 0], R[0, 1] + R[1, 0]
        out[2], out[3] = 1.0 - (trace - 2.0 * R[1, 1]), R[1, 2] + R[2, 1]
    else:
        out[0], out[1] = R[1, 0] - R[0, 1], R[0, 2] + R[2, 0]
        out[2], out[3] = R[1, 2] + R[2, 1], 1.0 - (trace - 2.0 * R[2, 2])
    length = math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2 + out[3] ** 2)
    sign = -1.0 if out[0] < 0.0 else 1.0
    for i in range(4):
        out[i] *= sign / length
