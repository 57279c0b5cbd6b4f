"""Newton's method (SQP) for a convex objective inside linear limits.

Each step solves the quadratic model of f within the rows, so from the first full step on every iterate is feasible; the
objective falls from there on by Armijo's rule with backtracking. The rule on the slope that strong Wolfe adds protects
quasi-Newton updates from steps that are too short; with the exact Hessian of a convex function the full step is tried
first and nothing needs that protection.

`search` stops where a step's held rows cannot be guessed (ASKS), and goes on with the answer of a QP solver.

The entries take a program as one tuple, `Data`, so that what they share is compiled once.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from drake_tc.kernels.compiling import MATRIX, VECTOR, WHOLE, helper, kernel, together
from drake_tc.kernels.tsid.active_set import (
    HELD_ROWS,
    Factor,
    Held,
    Model,
    Step,
    copy_held,
    factor_of,
    guess,
    held_rows,
    promise,
    solve_with,
)
from drake_tc.kernels.tsid.programs import (
    CEILING,
    PLAIN,
    RECTANGLE,
    RISK_DAMPING,
    SIDE_DAMPING,
    Point,
    Program,
    curvature_of,
    gradient_into,
    hessian_into,
    point_of,
    quadratic_of,
    risk_at,
    row_into,
    rows_of,
    times_into,
    value_at,
)
from drake_tc.types import FloatArray, IntArray

SOLVED, FAILED, ASKS, PAUSED = 0, 2, 10, 11
"""How a search ends: as `qp.problem.Outcome` has them, and where it is to be continued."""
FRESH, ANSWERED, RESUMED = 0, 1, 2
"""How it begins: anew, with a solver's answer to the step it asked for, or where it paused."""

FEASIBLE = 1e-6
"""In units of a row (one sigma): what a point may miss and still count as feasible."""
SUFFICIENT = 1e-4
SHORTEST, LONGEST = 0.1, 0.5
"""Armijo's share of the predicted descent, and by how much one backtracking shortens the step."""
KEEP_HESSIAN, KEEP_WHILE = 0.25, 0.1
"""A step along which no row moves by more sigmas keeps its Hessian for the next one, as long as the descent that is
still promised falls by this factor or more each time."""

BEFORE, LAST, INSIDE, SLOPE, STEPS, DONE, RISK, VALUE = 0, 1, 2, 3, 4, 5, 6, 7
MEMORY = 8
"""Places in what a search remembers: the promises of the last two steps, whether its point is feasible, ...; on return
also how many steps it took, whether it reached its accuracy, R, and f."""


class Search(NamedTuple):
    """A search and its answer.

    Attributes:
        x: (N,) its point.
        held: Rows that hold it.
        hessian: (N, N) of its last step.
        gradient: (N,) at x.
        step: (N + m,) a solver's d and A d, or nothing.
        memory: (MEMORY,).
    """

    x: FloatArray
    held: Held
    hessian: FloatArray
    gradient: FloatArray
    step: FloatArray
    memory: FloatArray


class Stop(NamedTuple):
    """When a search ends.

    Attributes:
        accuracy: Stop when the conditions of optimality are missed by what promises less descent of f; or by rounding.
        rounding: About the error of f.
        most: Steps until it pauses; the first one is always taken.
        how: FRESH, ANSWERED or RESUMED: how it begins.
    """

    accuracy: float
    rounding: float
    most: int
    how: int


@helper
def search(program: Program, sides: tuple[FloatArray, ...], stop: Stop, found: Search) -> int:
    """Minimise from found.x on.

    Args:
        program: f and the rows.
        sides: (m,) lower and upper ones of the rows.
        stop: When it ends.
        found: Where to begin, and where it ended.

    Returns:
        SOLVED (the point is feasible), FAILED, ASKS or PAUSED.
    """
    how = stop.how
    size, m, memory = found.x.size, rows_of(program), found.memory
    point, other = point_of(program, size), point_of(program, size)
    model, step = Model(np.empty(size), np.empty(m), np.empty(m), np.empty(m)), Step(np.zeros(size), np.empty(m))
    newton, free, lower, upper = model
    n = program.quadratic.shape[0]
    factor = Factor(np.empty((n, n)), np.empty((_axes(program), 3)))
    trial = held_rows(found.held.rows.size)
    bends = program.kind == RECTANGLE or program.weight > 0.0
    point.x[:] = found.x
    value_at(program, point)
    times_into(program, point.x, free)
    inside = True
    for i in range(m):
        lower[i], upper[i] = sides[0][i] - free[i], sides[1][i] - free[i]
        inside = inside and lower[i] <= FEASIBLE and upper[i] >= -FEASIBLE
    memory[STEPS] = memory[DONE] = 0.0
    if how == FRESH:
        memory[BEFORE] = memory[LAST] = np.inf
        memory[INSIDE] = 1.0 if inside else 0.0
        gradient_into(program, point, found.gradient)
    renews, sound = how == FRESH, True
    factors = True
    while True:
        memory[STEPS] += 1.0
        if renews:
            hessian_into(program, point, found.hessian)
        if factors or renews:
            sound = factor_of(program, found.hessian, factor)
        factors = renews = False
        if not (sound and math.isfinite(point.value[0])):
            return _ended(program, point, found, FAILED)
        newton[:] = found.gradient
        solve_with(factor, newton)
        for j in range(size):
            newton[j] = -newton[j]
        times_into(program, newton, free)
        copy_held(trial, found.held)
        if guess(program, factor, model, trial, step):
            copy_held(found.held, trial)
        elif how == ANSWERED:
            step.d[:] = found.step[:size]
            step.along[:] = found.step[size:]
        else:
            memory[STEPS] -= 1.0
            return _ended(program, point, found, ASKS)
        how = RESUMED
        length = _length(program, (point, other), step.d, stop.rounding, found)
        if length <= 0.0:
            return _ended(program, point, found, FAILED if length < 0.0 else SOLVED)
        point, other = other, point
        gradient_into(program, point, found.gradient)
        rest = promise(program, factor, found.gradient, found.held) if length == 1.0 else np.inf
        if rest <= stop.accuracy or (memory[DONE] > 0.0 and rest >= KEEP_WHILE * memory[LAST]):
            memory[DONE] = 1.0
            return _ended(program, point, found, SOLVED)
        farthest = 0.0
        for i in range(m):
            moved = length * step.along[i]
            upper[i] -= moved
            lower[i] -= moved
            farthest = max(farthest, abs(moved))
        memory[DONE], memory[LAST] = 0.0, rest
        renews = bends and (farthest > KEEP_HESSIAN or rest > KEEP_WHILE * memory[BEFORE])
        memory[BEFORE] = np.inf if renews else rest
        if memory[STEPS] >= stop.most:
            if renews:
                hessian_into(program, point, found.hessian)
            return _ended(program, point, found, PAUSED)


@helper
def _length(program: Program, points: tuple[Point, Point], d: FloatArray, rounding: float, found: Search) -> float:
    """How much of the step d to go from the first point, and the second one there.

    It is the longest of 1, t1, t1 t2, ... that gives enough descent.

    Each t is the minimiser of a parabola, kept in bounds. A first point that is not feasible takes the whole step.

    Returns:
        0 where nothing is gained, -1 where the objective is no number. found.memory[DONE] is 1 where the promised
        descent was lost in rounding, before or after the step.
    """
    (point, other), memory, slope = points, found.memory, np.dot(found.gradient, d)
    here, noise = point.value[0], rounding + 1e-15 * abs(point.value[0])
    length, first = 1.0, memory[INSIDE] <= 0.0
    small = not first and -slope <= noise
    while True:
        for j in range(d.size):
            other.x[j] = point.x[j] + length * d[j]
        value_at(program, other)
        if first:
            memory[INSIDE] = 1.0
            return 1.0 if math.isfinite(other.value[0]) else -1.0
        gained = other.value[0] - here
        if small:
            memory[DONE] = 1.0
            return 0.0 if gained > noise else 1.0
        if not gained > SUFFICIENT * length * slope:
            return length
        if -slope * length <= noise:
            memory[DONE] = 1.0 if -slope <= 10.0 * noise else 0.0
            return 0.0
        best = -0.5 * slope * length / (gained - length * slope)
        length *= min(max(best, SHORTEST), LONGEST)


@helper
def _axes(program: Program) -> int:
    return program.noise.shape[1] if program.kind == RECTANGLE else 0


@helper
def _ended(program: Program, point: Point, found: Search, outcome: int) -> int:
    found.x[:] = point.x
    found.memory[VALUE] = point.value[0]
    found.memory[RISK] = risk_at(program, point) if program.weight > 0.0 else 0.0
    return outcome


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
