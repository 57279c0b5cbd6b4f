"""Robust programs in units of their own uncertainty: torques over sigma, rows over sigma_G; and what is read there."""

import math
from typing import Any

import numpy as np

from drake_tc.kernels.compiling import FLAG, INDEX, MATRIX, REAL, VECTOR, WHOLE, kernel, together
from drake_tc.kernels.linear_algebra import times_vector
from drake_tc.kernels.tsid.newton import FEASIBLE
from drake_tc.kernels.tsid.programs import SAFE, log_cdf
from drake_tc.types import FloatArray, IntArray

CERTAIN = 1e-12
"""Relative to the largest standard deviation: what is less counts as exactly known."""
_HALF = math.sqrt(0.5)


POLYTOPE = together(MATRIX, VECTOR, VECTOR)
"""(m, n) A, (m,) lower and upper sides of A x."""
ROWS = together(MATRIX, VECTOR, VECTOR, INDEX)
"""The same, and 1 for each row (m,) that does not err."""


@kernel(MATRIX, POLYTOPE, VECTOR, MATRIX, FLAG)
def scaled(
    cost: FloatArray, polytope: tuple[FloatArray, ...], scale: FloatArray, root: FloatArray, plain: bool
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, IntArray, FloatArray, int]:
    """D diag(scale), and the rows of lower <= G tau <= upper over the deviation of G e, e = root zeta.

    Rows that do not err are over their own length instead, and have no noise.

    Args:
        cost: (c, n) D.
        polytope: (m, n) G and its sides.
        scale: (n,) units of the torques [N m].
        root: (n, r).
        plain: Whether root = diag(scale), so that the noise of the rows is the rows.

    Returns:
        D, A, lower, upper, noise (m, r), 1 for each row (m,) that does not err, divisors (m,), how many do not err.
    """
    matrix, lower, upper = polytope
    (m, n), r = matrix.shape, root.shape[1]
    priced, rows = np.empty(cost.shape), np.empty((m, n))
    noise = rows if plain else np.empty((m, r))
    for i in range(cost.shape[0]):
        for j in range(n):
            priced[i, j] = cost[i, j] * scale[j]
    if not plain:
        across = root.T.copy()
        for i in range(m):
            times_vector(noise[i], across, matrix[i])
    low, high, divisor = np.empty(m), np.empty(m), np.empty(m)
    certain, sure = np.zeros(m, dtype=np.int64), 0
    for i in range(m):
        length, deviation = 0.0, 0.0
        for j in range(n):
            rows[i, j] = matrix[i, j] * scale[j]
            length += rows[i, j] * rows[i, j]
        length = math.sqrt(length)
        if plain:
            deviation = length
        else:
            for j in range(r):
                deviation += noise[i, j] * noise[i, j]
            deviation = math.sqrt(deviation)
        if deviation <= CERTAIN * length:
            certain[i], sure = 1, sure + 1
            divisor[i] = length if length > 0.0 else 1.0
        else:
            divisor[i] = deviation
        share = 1.0 / divisor[i]
        for j in range(n):
            rows[i, j] *= share
        if not plain:
            for j in range(r):
                noise[i, j] = 0.0 if certain[i] else noise[i, j] * share
        low[i], high[i] = lower[i] * share, upper[i] * share
    if plain and sure:
        noise = rows.copy()
        for i in range(m):
            for j in range(n):
                noise[i, j] = 0.0 if certain[i] else rows[i, j]
    return priced, rows, low, high, noise, certain, divisor, sure


@kernel(VECTOR, VECTOR, VECTOR, INDEX)
def separate_risk(value: FloatArray, lower: FloatArray, upper: FloatArray, certain: IntArray) -> float:
    """R_ind of rows that have these values (m,); those that do not err take no part."""
    risk = 0.0
    for i in range(value.size):
        if certain[i]:
            continue
        above, below = upper[i] - value[i], value[i] - lower[i]
        if above < SAFE:
            risk -= log_cdf(above)
        if below < SAFE:
            risk -= log_cdf(below)
    return risk


@kernel(VECTOR, VECTOR, ROWS, together(MATRIX, VECTOR))
def evaluated(
    x: FloatArray, scale: FloatArray, rows: tuple[Any, ...], costs: tuple[FloatArray, ...]
) -> tuple[FloatArray, IntArray, float, float]:
    """What a point of a scaled problem means.

    Args:
        x: (n,).
        scale: (n,) [N m].
        rows: See `ROWS`.
        costs: (c, n) D over x, (c,) d.

    Returns:
        Torque (n,), 1 or -1 for each row (m,) at its upper or lower side, the product of the probabilities of all
        sides (0 where a row that does not err is missed), ||D x - d||^2.
    """
    (matrix, lower, upper, certain), (cost, target) = rows, costs
    m = matrix.shape[0]
    value, torque = np.empty(m), np.empty(x.size)
    times_vector(value, matrix, x)
    for j in range(x.size):
        torque[j] = x[j] * scale[j]
    active, missed = np.zeros(m, dtype=np.int64), False
    for i in range(m):
        above, below = upper[i] - value[i], value[i] - lower[i]
        active[i] = (1 if above <= FEASIBLE else 0) - (1 if below <= FEASIBLE else 0)
        missed = missed or (certain[i] > 0 and min(above, below) < -FEASIBLE)
    risk = separate_risk(value, lower, upper, certain)
    residual, price = np.empty(target.size), 0.0
    times_vector(residual, cost, x)
    for i in range(target.size):
        price += (residual[i] - target[i]) ** 2
    return torque, active, 0.0 if missed else math.exp(-risk), price


@kernel(MATRIX, VECTOR, VECTOR, MATRIX, MATRIX)
def box_program(
    matrix: FloatArray, lower: FloatArray, upper: FloatArray, noise: FloatArray, cost: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Rows over (x, s): A x + |K| 1 s <= upper, -A x + |K| 1 s <= -lower, -s <= 0, K the noise of the rows.

    For a diagonal Sigma |K| 1 = |G| sigma, over sigma_G; s >= 0 keeps tau itself inside. Where no side errs every box
    fits, so there is no largest: the rows -s <= -1, s <= 1 hold s then, and the cost alone chooses x.

    Returns:
        Rows (2 m + 1 or 2 m + 2, n + 1), their lower sides (none), upper sides, and D over (x, s).
    """
    (m, n), r = matrix.shape, noise.shape[1]
    errs, reach = False, np.zeros(m)
    for i in range(m):
        for j in range(r):
            reach[i] += abs(noise[i, j])
        errs = errs or (reach[i] > 0.0 and (upper[i] < np.inf or lower[i] > -np.inf))
    count = 2 * m + (1 if errs else 2)
    rows, high = np.zeros((count, n + 1)), np.empty(count)
    for i in range(m):
        for j in range(n):
            rows[i, j], rows[m + i, j] = matrix[i, j], -matrix[i, j]
        rows[i, n] = rows[m + i, n] = reach[i]
        high[i], high[m + i] = upper[i], -lower[i]
    rows[2 * m, n], high[2 * m] = -1.0, 0.0 if errs else -1.0
    if not errs:
        rows[2 * m + 1, n], high[2 * m + 1] = 1.0, 1.0
    priced = np.zeros((cost.shape[0], n + 1))
    priced[:, :n] = cost
    return rows, np.full(count, -np.inf), high, priced


@kernel(VECTOR, ROWS, MATRIX)
def box_size(x: FloatArray, rows: tuple[Any, ...], noise: FloatArray) -> float:
    """Largest s with x +- s inside; negative where x is outside, -inf where a row that does not err is missed."""
    matrix, lower, upper, certain = rows
    value = np.empty(lower.size)
    times_vector(value, matrix, x)
    size = np.inf
    for i in range(lower.size):
        room = min(upper[i] - value[i], value[i] - lower[i])
        if certain[i]:
            if room < -FEASIBLE:
                return -np.inf
            continue
        reach = 0.0
        for j in range(noise.shape[1]):
            reach += abs(noise[i, j])
        size = min(size, room / reach)
    return size


@kernel(REAL, WHOLE)
def box_risk(size: float, axes: int) -> float:
    """R_box = -log p_box of a box of half width `size` sigmas in `axes` independent directions; inf for none."""
    if axes == 0:
        return 0.0 if size > -math.inf else math.inf
    if size <= 0.0:
        return math.inf
    half = _HALF * size
    return -axes * (math.log(math.erf(half)) if size < 1.0 else math.log1p(-math.erfc(half)))


@kernel(MATRIX, VECTOR, VECTOR, REAL)
def shrunk(noise: FloatArray, lower: FloatArray, upper: FloatArray, size: float) -> tuple[FloatArray, FloatArray]:
    """Every side closer by what a box of half width `size` reaches, sum |K| size."""
    low, high = np.empty(lower.size), np.empty(upper.size)
    for i in range(lower.size):
        reach = 0.0
        for j in range(noise.shape[1]):
            reach += abs(noise[i, j])
        low[i], high[i] = lower[i] + size * reach, upper[i] - size * reach
    return low, high
