"""Entries of Newton's method and of the programs that it solves, see `programs`.

All of them take a program as one tuple, `Data`, so that what they share is compiled once.
"""

from typing import Any, NamedTuple

import numpy as np

from drake_tc.kernels.compiling import MATRIX, VECTOR, WHOLE, helper, kernel, together
from drake_tc.kernels.gaussian import CEILING, curvature_of
from drake_tc.kernels.newton import FRESH, MEMORY, Search, Stop, search
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
from drake_tc.kernels.warm_start import HELD_ROWS
from drake_tc.types import FloatArray, IntArray

PROGRAM = together(WHOLE, MATRIX, MATRIX, VECTOR, MATRIX, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR)
SIDES = together(VECTOR, VECTOR)
"""(m,) lower and upper sides of A x, or of a rectangle's rows."""
_WEIGHT, _DAMPING, _WIDTH, _ACCURACY, _MOST, _HOW = 0, 1, 2, 3, 4, 5


class Data(NamedTuple):
    """A program as the entries take it.

    Attributes:
        kind: PLAIN or RECTANGLE.
        matrix, noise: (m, n) A and (m, r) K.
        held: (m,) sides that a rectangle's x itself keeps: 1 the upper, -1 the lower, 0 none.
        cost, target: (c, n) D and (c,) d.
        linear: (N,) c.
        risk_lower, risk_upper: (m,).
        numbers: (6,) w, damping, least width of a rectangle, accuracy, steps until a search pauses, how it begins.
    """

    kind: int
    matrix: FloatArray
    noise: FloatArray
    held: FloatArray
    cost: FloatArray
    target: FloatArray
    linear: FloatArray
    risk_lower: FloatArray
    risk_upper: FloatArray
    numbers: FloatArray


@helper
def program_of(data: Data) -> Program:
    """The program of an entry's arguments."""
    numbers, held, noise = data.numbers, data.held, data.noise
    weight, count = numbers[_WEIGHT], 0
    for i in range(held.size):
        count += held[i] != 0.0
    rows, signs, count = np.empty(count, dtype=np.int64), np.empty(count), 0
    for i in range(held.size):
        if held[i] != 0.0:
            rows[count], signs[count] = i, held[i]
            count += 1
    damping, least = numbers[_DAMPING] + RISK_DAMPING * weight, 1.0
    if data.kind == RECTANGLE:
        damping, least = SIDE_DAMPING * weight, 0.0
    quadratic = quadratic_of(data.cost, damping, least)
    reach = np.empty(noise.shape)
    for i in range(noise.shape[0]):
        for j in range(noise.shape[1]):
            reach[i, j] = abs(noise[i, j])
    return Program(
        data.kind, data.matrix, noise, reach, rows, signs, data.cost, data.target, data.linear,
        data.risk_lower, data.risk_upper, weight, quadratic,
    )  # fmt: skip


@helper
def sides_of(program: Program, sides: tuple[FloatArray, ...], width: float) -> tuple[FloatArray, FloatArray]:
    """Lower and upper sides of all rows; a rectangle's have no lower ones."""
    lower, upper = sides
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


@kernel(PROGRAM, SIDES, VECTOR, HELD_ROWS, together(MATRIX, VECTOR, VECTOR, VECTOR))
def minimum(
    data: tuple[Any, ...],
    sides: tuple[FloatArray, ...],
    x: FloatArray,
    holding: tuple[Any, ...],
    before: tuple[FloatArray, ...],
) -> tuple[int, FloatArray, tuple[IntArray, IntArray, FloatArray], FloatArray, FloatArray, FloatArray]:
    """A search within lower <= A x <= upper, or within a rectangle's rows of the same sides.

    Args:
        data: See `Data`.
        sides: (m,) each.
        x: (N,) where to begin.
        holding: First guess of the rows that hold the answer, see `HELD_ROWS`.
        before: What the search before left: Hessian (N, N), gradient (N,), a solver's [d; A d] (N + m,) and memory;
            empty for a fresh one.

    Returns:
        How it ended (`newton`), x, the rows that hold it, Hessian, gradient, memory.
    """
    given, (rows, ends, forces), (hessian, gradient, step, memory) = Data(*data), holding, before
    program, numbers = program_of(given), given.numbers
    low, high = sides_of(program, sides, numbers[_WIDTH])
    size, room, how = x.size, rows_of(program) + 1, int(numbers[_HOW])
    kept = held_rows(room)
    if rows.size and rows.max() < room - 1:
        kept.used[0] = rows.size
        kept.rows[: rows.size] = rows
        kept.sides[: rows.size] = ends
        kept.multipliers[: rows.size] = forces
    found = Search(x.copy(), kept, np.empty((size, size)), np.empty(size), step, np.empty(MEMORY))
    if how != FRESH:
        found.hessian[:] = hessian
        found.gradient[:] = gradient
        found.memory[:] = memory
    squared = 0.0
    for value in given.target:
        squared += value * value
    rounding = 1e-15 * squared + 1e-12 * program.weight
    outcome = search(program, (low, high), Stop(numbers[_ACCURACY], rounding, int(numbers[_MOST]), how), found)
    a = kept.used[0]
    held = kept.rows[:a].copy(), kept.sides[:a].copy(), kept.multipliers[:a].copy()
    return outcome, found.x, held, found.hessian, found.gradient, found.memory


@kernel(PROGRAM, VECTOR)
def described(
    data: tuple[Any, ...], x: FloatArray
) -> tuple[float, float, FloatArray, FloatArray, FloatArray, FloatArray]:
    """f, R, gradient and damped Hessian at x (N,), and slope and bend (m,) of R by each row's A_i x (PLAIN alone)."""
    program = program_of(Data(*data))
    point, gradient, hessian = point_of(program, x.size), np.empty(x.size), np.empty((x.size, x.size))
    point.x[:] = x
    value_at(program, point)
    gradient_into(program, point, gradient)
    hessian_into(program, point, hessian)
    m = program.matrix.shape[0]
    slope, bend = np.zeros(m), np.zeros(m)
    for k in range(int(point.value[1])):
        side = point.sides[k]
        row, sign = (side, -1.0) if side < m else (side - m, 1.0)
        slope[row] += sign * point.rates[k]
        bend[row] += curvature_of(min(point.margins[k], CEILING), point.rates[k])
    risk = risk_at(program, point) if program.weight > 0.0 else 0.0
    return point.value[0], risk, gradient, hessian, slope, bend


@kernel(PROGRAM, SIDES)
def written_out(data: tuple[Any, ...], sides: tuple[FloatArray, ...]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """All rows of a program over its N variables, and their lower and upper sides."""
    given = Data(*data)
    program = program_of(given)
    low, high = sides_of(program, sides, given.numbers[_WIDTH])
    size = given.matrix.shape[1] + (2 * given.noise.shape[1] if given.kind == RECTANGLE else 0)
    whole = np.empty((rows_of(program), size))
    for i in range(whole.shape[0]):
        row_into(program, i, whole[i])
    return whole, low, high
