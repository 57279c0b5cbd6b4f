"""Entries of Newton's method and of the programs that it solves, see `programs`.

All of them take a program as the same eleven arguments, so that what they share is compiled once: kind, A, K, the sides
(m,) that a rectangle's x itself keeps (1 the upper, -1 the lower, 0 none), D, d, c, risk_lower, risk_upper, and
`numbers` = [w, damping, least width of a rectangle, accuracy, steps until a search pauses, how it begins].
"""

import numpy as np

from drake_tc.kernels.compiling import INDEX, MATRIX, VECTOR, WHOLE, helper, kernel
from drake_tc.kernels.gaussian import CEILING, curvature_of
from drake_tc.kernels.newton import FRESH, MEMORY, Search, search
from drake_tc.kernels.programs import (
    PLAIN,
    RECTANGLE,
    RISK_DAMPING,
    SIDE_DAMPING,
    Program,
    gradient_into,
    hessian_into,
    point_of,
    quadratic_of,
    risk_at,
    row_into,
    rows_of,
    value_at,
)
from drake_tc.kernels.steps import held_rows
from drake_tc.types import FloatArray, IntArray

_PROGRAM = (WHOLE, MATRIX, MATRIX, VECTOR, MATRIX, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR)
_WEIGHT, _DAMPING, _WIDTH, _ACCURACY, _MOST, _HOW = 0, 1, 2, 3, 4, 5


@helper
def program_of(
    kind: int,
    matrix: FloatArray,
    noise: FloatArray,
    held: FloatArray,
    cost: FloatArray,
    target: FloatArray,
    linear: FloatArray,
    risk_lower: FloatArray,
    risk_upper: FloatArray,
    numbers: FloatArray,
) -> Program:
    """The program of an entry's arguments."""
    weight, count = numbers[_WEIGHT], 0
    for i in range(held.size):
        count += held[i] != 0.0
    rows, signs, count = np.empty(count, dtype=np.int64), np.empty(count), 0
    for i in range(held.size):
        if held[i] != 0.0:
            rows[count], signs[count] = i, held[i]
            count += 1
    damping, least = numbers[_DAMPING] + RISK_DAMPING * weight, 1.0
    if kind == RECTANGLE:
        damping, least = SIDE_DAMPING * weight, 0.0
    quadratic = quadratic_of(cost, damping, least)
    reach = np.empty(noise.shape)
    for i in range(noise.shape[0]):
        for j in range(noise.shape[1]):
            reach[i, j] = abs(noise[i, j])
    return Program(
        kind, matrix, noise, reach, rows, signs, cost, target, linear, risk_lower, risk_upper, weight, quadratic
    )


@helper
def sides_of(program: Program, lower: FloatArray, upper: FloatArray, width: float) -> tuple[FloatArray, FloatArray]:
    """Lower and upper sides of all rows; a rectangle's have no lower ones."""
    m, r = program.matrix.shape[0], program.noise.shape[1]
    low, high = np.empty(rows_of(program)), np.empty(rows_of(program))
    if program.kind == PLAIN:
        low[:] = lower
        high[:] = upper
        return low, high
    low[:] = -np.inf
    for i in range(m):
        high[i], high[m + i] = upper[i], -lower[i]
    high[2 * m : 2 * m + r] = -width
    for i in range(program.kept.size):
        row = program.kept[i]
        high[2 * m + r + i] = upper[row] if program.signs[i] > 0.0 else -lower[row]
    return low, high


@kernel(*_PROGRAM, VECTOR, VECTOR, VECTOR, INDEX, INDEX, VECTOR, MATRIX, VECTOR, VECTOR, VECTOR)
def minimum(
    kind: int,
    matrix: FloatArray,
    noise: FloatArray,
    held: FloatArray,
    cost: FloatArray,
    target: FloatArray,
    linear: FloatArray,
    risk_lower: FloatArray,
    risk_upper: FloatArray,
    numbers: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    x: FloatArray,
    rows: IntArray,
    sides: IntArray,
    multipliers: FloatArray,
    hessian: FloatArray,
    gradient: FloatArray,
    step: FloatArray,
    memory: FloatArray,
) -> tuple[int, FloatArray, IntArray, IntArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """A search within lower <= A x <= upper, (m,) each, or within a rectangle's rows of the same sides.

    Args:
        kind: PLAIN or RECTANGLE; this and what follows up to `numbers` see above.
        matrix: (m, n) A.
        noise: (m, r) K.
        held: (m,) sides that x itself keeps.
        cost: (c, n) D.
        target: (c,) d.
        linear: (N,) c.
        risk_lower: (m,).
        risk_upper: (m,).
        numbers: (6,).
        lower: (m,).
        upper: (m,).
        x: (N,) where to begin.
        rows: (a,) first guess of the rows that hold the answer.
        sides: (a,).
        multipliers: (a,).
        hessian: (N, N) that the search before left; empty for a fresh one, as the next three are.
        gradient: (N,) the same.
        step: (N + m,) a solver's d and A d.
        memory: Of the search before.

    Returns:
        How it ended (`newton`), x, rows, sides, multipliers, Hessian, gradient, memory.
    """
    program = program_of(kind, matrix, noise, held, cost, target, linear, risk_lower, risk_upper, numbers)
    low, high = sides_of(program, lower, upper, numbers[_WIDTH])
    size, room, how = x.size, rows_of(program) + 1, int(numbers[_HOW])
    kept = held_rows(room)
    if rows.size and rows.max() < room - 1:
        kept.used[0] = rows.size
        kept.rows[: rows.size] = rows
        kept.sides[: rows.size] = sides
        kept.multipliers[: rows.size] = multipliers
    found = Search(x.copy(), kept, np.empty((size, size)), np.empty(size), step, np.empty(MEMORY))
    if how != FRESH:
        found.hessian[:] = hessian
        found.gradient[:] = gradient
        found.memory[:] = memory
    squared = 0.0
    for i in range(target.size):
        squared += target[i] * target[i]
    rounding = 1e-15 * squared + 1e-12 * program.weight
    outcome = search(program, low, high, numbers[_ACCURACY], rounding, int(numbers[_MOST]), how, found)
    a = kept.used[0]
    at, ends, forces = kept.rows[:a].copy(), kept.sides[:a].copy(), kept.multipliers[:a].copy()
    return outcome, found.x, at, ends, forces, found.hessian, found.gradient, found.memory


@kernel(*_PROGRAM, VECTOR)
def described(
    kind: int,
    matrix: FloatArray,
    noise: FloatArray,
    held: FloatArray,
    cost: FloatArray,
    target: FloatArray,
    linear: FloatArray,
    risk_lower: FloatArray,
    risk_upper: FloatArray,
    numbers: FloatArray,
    x: FloatArray,
) -> tuple[float, float, FloatArray, FloatArray, FloatArray, FloatArray]:
    """f, R, gradient and damped Hessian at x (N,), and slope and bend (m,) of R by each row's A_i x (PLAIN alone)."""
    program = program_of(kind, matrix, noise, held, cost, target, linear, risk_lower, risk_upper, numbers)
    point, gradient, hessian = point_of(program, x.size), np.empty(x.size), np.empty((x.size, x.size))
    point.x[:] = x
    value_at(program, point)
    gradient_into(program, point, gradient)
    hessian_into(program, point, hessian)
    m = matrix.shape[0]
    slope, bend = np.zeros(m), np.zeros(m)
    for k in range(int(point.value[1])):
        side = point.sides[k]
        row, sign = (side, -1.0) if side < m else (side - m, 1.0)
        slope[row] += sign * point.rates[k]
        bend[row] += curvature_of(min(point.margins[k], CEILING), point.rates[k])
    risk = risk_at(program, point) if program.weight > 0.0 else 0.0
    return point.value[0], risk, gradient, hessian, slope, bend


@kernel(*_PROGRAM, VECTOR, VECTOR)
def written_out(
    kind: int,
    matrix: FloatArray,
    noise: FloatArray,
    held: FloatArray,
    cost: FloatArray,
    target: FloatArray,
    linear: FloatArray,
    risk_lower: FloatArray,
    risk_upper: FloatArray,
    numbers: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """All rows of a program over its N variables, and their lower and upper sides."""
    program = program_of(kind, matrix, noise, held, cost, target, linear, risk_lower, risk_upper, numbers)
    low, high = sides_of(program, lower, upper, numbers[_WIDTH])
    size = matrix.shape[1] + (2 * noise.shape[1] if kind == RECTANGLE else 0)
    whole = np.empty((rows_of(program), size))
    for i in range(whole.shape[0]):
        row_into(program, i, whole[i])
    return whole, low, high
