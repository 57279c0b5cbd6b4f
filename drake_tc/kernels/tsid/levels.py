"""Levels of strict priorities whose limits hold nothing back, in one call: least squares within what is left free.

    level k: z = argmin ||D_k (x + T Q_1 z) - d_k||,  x <- x + T Q_1 z,  T <- T Q_2

Q = [Q_1 Q_2] are the Householder reflections, with pivoting, that leave of the rows of D_k T their first columns.
"""

from typing import Any

import numpy as np

from drake_tc.kernels.compiling import INDEX, MATRIX, OUT_VECTOR, VECTOR, helper, kernel, together
from drake_tc.types import FloatArray

FOUND, HELD, LEFT = 0, 1, 2
"""The levels decide everything and keep the limits; a limit is missed by one of them; directions are left."""
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


@kernel(together(MATRIX, VECTOR, INDEX), together(MATRIX, VECTOR, VECTOR), OUT_VECTOR)
def solve_levels(levels: tuple[Any, ...], sides: tuple[FloatArray, ...], x: FloatArray) -> int:
    """FOUND where x is the only minimum of all levels, each of them inside the limits.

    Args:
        levels: (r, n) D of the levels, one below the other, (r,) d, and (levels + 1,) where they begin and end.
        sides: (m, n) A, (m,) lower and upper sides of A x.
        x: (n,) where to begin; the solution.
    """
    (cost, target, ends), (limits, lower, upper) = levels, sides
    n = x.size
    free, f = np.eye(n), n
    for level in range(ends.size - 1):
        if f == 0:
            break
        own = cost[ends[level] : ends[level + 1]]
        right = target[ends[level] : ends[level + 1]] - np.dot(own, x)
        rows = np.dot(own, np.ascontiguousarray(free[:, :f]))
        for i in range(rows.shape[0]):
            if np.dot(rows[i], rows[i]) <= RANK * RANK * np.dot(own[i], own[i]):
                rows[i] = 0.0
        k = _triangular(rows, free, f)
        z = _least_squares(rows, k, right)
        for i in range(n):
            x[i] += np.dot(free[i, :k], z)
        value = np.dot(limits, x)
        for i in range(value.size):
            if not lower[i] <= value[i] <= upper[i]:
                return HELD
        f -= k
        left = free[:, k : k + f].copy()
        free[:, :f] = left
    return FOUND if f == 0 else LEFT
