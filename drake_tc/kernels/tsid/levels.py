"""A level of strict priorities that no limit holds back: least squares within what the levels above leave free.

    z = argmin ||D (x + T Q_1 z) - d||,  x <- x + T Q_1 z,  T <- T Q_2

Q = [Q_1 Q_2] are the Householder reflections, with pivoting, that leave of the rows of D T their first columns.
"""

import numpy as np

from drake_tc.kernels.compiling import MATRIX, VECTOR, helper, kernel, together
from drake_tc.types import FloatArray

RANK = 1e-10
"""As `drake_tc.tsid.robust.scaled` has it."""


@helper
def _reflect(row: FloatArray, v: FloatArray, first: int, last: int) -> None:
    """row[first:last] less twice its part along the unit vector v."""
    share = 0.0
    for j in range(first, last):
        share += row[j] * v[j]
    share *= 2.0
    for j in range(first, last):
        row[j] -= share * v[j]


@helper
def _mirror(row: FloatArray, v: FloatArray, first: int, last: int) -> bool:
    """The unit vector v whose reflection leaves of row[first:last] its first element; False for a row of zeros."""
    length = 0.0
    for j in range(first, last):
        v[j] = row[j]
        length += row[j] * row[j]
    if length == 0.0:
        return False
    root = np.sqrt(length)
    v[first] += root if row[first] >= 0.0 else -root
    length = 0.0
    for j in range(first, last):
        length += v[j] * v[j]
    inverse = 1.0 / np.sqrt(length)
    for j in range(first, last):
        v[j] *= inverse
    return True


@helper
def _triangular(rows: FloatArray, free: FloatArray, f: int) -> int:
    """Reflect rows (m, f) and T (n, f) until the rows have zeros behind their first k columns; k, their rank."""
    m, n, most = rows.shape[0], free.shape[0], int(min(rows.shape[0], f))
    used = np.zeros(m, dtype=np.bool_)
    v = np.empty(rows.shape[1])
    longest = 0.0
    for step in range(most):
        pivot, best = -1, 0.0
        for i in range(m):
            if used[i]:
                continue
            length = 0.0
            for j in range(step, f):
                length += rows[i, j] * rows[i, j]
            if length > best:
                pivot, best = i, length
        size = np.sqrt(best)
        if step == 0:
            longest = size
        if pivot < 0 or size <= RANK * longest or not _mirror(rows[pivot], v, step, f):
            return step
        used[pivot] = True
        for i in range(m):
            if not used[i] or i == pivot:
                _reflect(rows[i], v, step, f)
        for i in range(n):
            _reflect(free[i], v, step, f)
    return most


@helper
def _least_squares(rows: FloatArray, k: int, right: FloatArray) -> FloatArray:
    """Return z (k,) of least ||rows[:, :k] z - right||, of full column rank; right is overwritten."""
    m = rows.shape[0]
    columns = np.ascontiguousarray(rows[:, :k].T)
    v = np.empty(m)
    for step in range(k):
        if _mirror(columns[step], v, step, m):
            for j in range(step, k):
                _reflect(columns[j], v, step, m)
            _reflect(right, v, step, m)
    z = np.zeros(k)
    for step in range(k - 1, -1, -1):
        total = right[step]
        for j in range(step + 1, k):
            total -= columns[j, step] * z[j]
        z[step] = total / columns[step, step]
    return z


@kernel(together(MATRIX, VECTOR), together(MATRIX, VECTOR, VECTOR), VECTOR, MATRIX)
def solve_level(
    level: tuple[FloatArray, FloatArray], sides: tuple[FloatArray, ...], begin: FloatArray, basis: FloatArray
) -> tuple[bool, FloatArray, FloatArray]:
    """Whether the minimum is a number inside the limits, the minimum x (n,), and T (n, f - k) of what it leaves free.

    Args:
        level: (r, n) D, (r,) d.
        sides: (m, n) A, (m,) lower and upper sides of A x.
        begin: (n,) x where the levels above have ended.
        basis: (n, f) T, orthonormal, of what they leave free.
    """
    (cost, target), (limits, lower, upper) = level, sides
    x, free = begin.copy(), basis.copy()
    right, rows = target - np.dot(cost, x), np.dot(cost, free)
    inside = bool(np.isfinite(rows.sum() + right.sum()))
    for i in range(rows.shape[0]):
        if np.dot(rows[i], rows[i]) <= RANK * RANK * np.dot(cost[i], cost[i]):
            rows[i] = 0.0
    k = _triangular(rows, free, free.shape[1])
    z = _least_squares(rows, k, right)
    for i in range(x.size):
        x[i] += np.dot(free[i, :k], z)
    value = np.dot(limits, x)
    for i in range(value.size):
        inside = inside and lower[i] <= value[i] <= upper[i]
    return inside, x, free[:, k:].copy()
