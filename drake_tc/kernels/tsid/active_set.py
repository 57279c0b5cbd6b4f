"""One step of Newton's method inside linear limits: min 1/2 d^T H d + g^T d, lower <= A (x + d) <= upper.

A set of held rows that satisfies all conditions of optimality is the answer, so guesses from the last step come first:
each drops what pulls the wrong way and takes in the row that is missed most.

What one tick of robust TSID tells the next, as numbers of a fixed size.

    [known, rows, weight, held rows, inner size; torque (n); held rows: index, side, multiplier (r each); inner (i)]

There is room for r = 2 n + 2 rows that hold a solution and for i = 8 n numbers of an interior-point method's state.
What is more than that is left out, which costs the next tick time but not its answer.
"""

from typing import Any, NamedTuple

import numpy as np

from drake_tc.kernels.compiling import INDEX, OUT_VECTOR, REAL, VECTOR, WHOLE, helper, kernel, together
from drake_tc.kernels.linear_algebra import (
    colour_vector,
    factor_into,
    whiten_columns,
    whiten_vector,
)
from drake_tc.kernels.tsid.programs import RECTANGLE, Program, row_into, times_into
from drake_tc.types import FloatArray, IntArray

GUESSES = 6
"""How many working sets are tried before a QP solver is asked; each costs a fifth of it or less."""
INSIDE = 1e-8
"""In units of a row: what counts as met."""
HELD = 1e-13
"""In units of a row: what a held row may miss its end by. What it misses, times its multiplier, is cost."""
CORRECTIONS = 2
"""Solves at most for the multipliers of held rows. Where a Hessian has next to no curvature, the step without limits is
so long that its rounding shows after the first one."""


class Factor(NamedTuple):
    """U of H = U^T U; of a rectangle its block for x and [first, mixed, second] (r, 3) of each axis, [1 m; 0 2]."""

    upper: FloatArray
    axes: FloatArray


class Held(NamedTuple):
    """Rows held at one of their sides (1 the upper, -1 the lower), and their multipliers; the first used[0] of each.

    Multipliers are >= 0 at the upper, <= 0 at the lower side.
    """

    rows: IntArray
    sides: IntArray
    multipliers: FloatArray
    used: IntArray


class Step(NamedTuple):
    """What a step is: d (N,) and A d (m,)."""

    d: FloatArray
    along: FloatArray


class Model(NamedTuple):
    """The quadratic model of a step: its minimum without limits (N,), A times that (m,), and the sides (m,) of A d."""

    newton: FloatArray
    free: FloatArray
    lower: FloatArray
    upper: FloatArray


@helper
def held_rows(size: int) -> Held:
    """Memory for `size` rows."""
    return Held(
        np.zeros(size, dtype=np.int64), np.zeros(size, dtype=np.int64), np.zeros(size), np.zeros(1, dtype=np.int64)
    )


@helper
def copy_held(to: Held, source: Held) -> None:
    """One over the other."""
    count = source.used[0]
    to.used[0] = count
    for k in range(count):
        to.rows[k], to.sides[k], to.multipliers[k] = source.rows[k], source.sides[k], source.multipliers[k]


@helper
def factor_of(program: Program, hessian: FloatArray, factor: Factor) -> bool:
    """Factor H; False where it is not positive definite or not a number."""
    if program.kind != RECTANGLE:
        return factor_into(factor.upper, hessian)
    n, r = program.quadratic.shape[0], factor.axes.shape[0]
    if not factor_into(factor.upper, hessian[:n, :n]):
        return False
    for j in range(r):
        first = np.sqrt(hessian[n + j, n + j])
        mixed = hessian[n + j, n + r + j] / first
        second = np.sqrt(hessian[n + r + j, n + r + j] - mixed * mixed)
        factor.axes[j, 0], factor.axes[j, 1], factor.axes[j, 2] = first, mixed, second
        if not first + second < np.inf:
            return False
    return True


@helper
def whiten(factor: Factor, vector: FloatArray) -> None:
    """U^-T b in place."""
    n, r = factor.upper.shape[0], factor.axes.shape[0]
    whiten_vector(factor.upper, vector[:n])
    for j in range(r):
        vector[n + j] /= factor.axes[j, 0]
        vector[n + r + j] = (vector[n + r + j] - factor.axes[j, 1] * vector[n + j]) / factor.axes[j, 2]


@helper
def colour(factor: Factor, vector: FloatArray) -> None:
    """U^-1 b in place."""
    n, r = factor.upper.shape[0], factor.axes.shape[0]
    colour_vector(factor.upper, vector[:n])
    for j in range(r):
        vector[n + r + j] /= factor.axes[j, 2]
        vector[n + j] = (vector[n + j] - factor.axes[j, 1] * vector[n + r + j]) / factor.axes[j, 0]


@helper
def solve_with(factor: Factor, vector: FloatArray) -> None:
    """H^-1 b in place."""
    whiten(factor, vector)
    colour(factor, vector)


@helper
def whitened_rows(program: Program, factor: Factor, held: Held, columns: FloatArray) -> None:
    """U^-T of the held rows, each a column of (N, a)."""
    n, r = factor.upper.shape[0], factor.axes.shape[0]
    row = np.empty(columns.shape[0])
    for k in range(columns.shape[1]):
        row_into(program, held.rows[k], row)
        for j in range(row.size):
            columns[j, k] = row[j]
    whiten_columns(factor.upper, columns[:n])
    for j in range(r):
        first, mixed, second = factor.axes[j, 0], factor.axes[j, 1], factor.axes[j, 2]
        for k in range(columns.shape[1]):
            columns[n + j, k] /= first
            columns[n + r + j, k] = (columns[n + r + j, k] - mixed * columns[n + j, k]) / second


@helper
def promise(program: Program, factor: Factor, gradient: FloatArray, held: Held) -> float:
    """Descent that the gradient r that the rows' forces do not balance promises, without limits: r^T H^-1 r / 2."""
    rest, row = gradient.copy(), np.empty(gradient.size)
    for k in range(held.used[0]):
        row_into(program, held.rows[k], row)
        for j in range(row.size):
            rest[j] += held.multipliers[k] * row[j]
    whiten(factor, rest)
    total = 0.0
    for j in range(rest.size):
        total += rest[j] * rest[j]
    return 0.5 * total


@helper
def guess(program: Program, factor: Factor, model: Model, held: Held, step: Step) -> bool:
    """The step that rows near `held` end on, which `held` becomes; False where some guesses do not find it.

    Args:
        program: Whose rows.
        factor: Of its Hessian.
        model: Of the step.
        held: First guess; where none succeeds, it is whatever was tried last.
        step: The answer.
    """
    lower, upper = model.lower, model.upper
    for _ in range(GUESSES):
        step.d[:] = model.newton
        step.along[:] = model.free
        count = held.used[0]
        if count and not _held_step(program, factor, model, held, step):
            return False
        worst, miss, above = -1, -np.inf, True
        for i in range(upper.size):
            over, under = step.along[i] - upper[i], lower[i] - step.along[i]
            if not (over <= miss and under <= miss):
                worst, miss, above = i, max(over, under), over >= under
            if over != over or under != under:
                worst, miss = i, np.nan
                break
        met = worst < 0 or miss <= INSIDE
        kept, known = 0, False
        for k in range(count):
            if held.multipliers[k] * held.sides[k] < 0.0:
                continue
            held.rows[kept], held.sides[kept], held.multipliers[kept] = (
                held.rows[k],
                held.sides[k],
                held.multipliers[k],
            )
            known = known or held.rows[k] == worst
            kept += 1
        held.used[0] = kept
        if kept == count and met:
            return True
        if not met:
            if known or kept >= held.rows.size:
                return False
            held.rows[kept], held.sides[kept], held.multipliers[kept] = worst, 1 if above else -1, 0.0
            held.used[0] = kept + 1
    return False


@helper
def _held_step(program: Program, factor: Factor, model: Model, held: Held, step: Step) -> bool:
    """The step with all `held` rows at their ends, and their multipliers; False where they depend on each other."""
    count = held.used[0]
    columns = np.empty((step.d.size, count))
    whitened_rows(program, factor, held, columns)
    small, force = np.empty((count, count)), np.empty(count)
    if not factor_into(small, np.dot(columns.T, columns)):
        return False
    held.multipliers[:count] = 0.0
    step.along[:] = model.free
    for _ in range(CORRECTIONS):
        for k in range(count):
            row = held.rows[k]
            force[k] = step.along[row] - (model.upper[row] if held.sides[k] > 0 else model.lower[row])
        miss = np.abs(force).max()
        if miss <= HELD:
            break
        if not miss < np.inf:
            return False
        whiten_vector(small, force)
        colour_vector(small, force)
        pulled = np.dot(columns, force)
        colour(factor, pulled)
        for j in range(step.d.size):
            step.d[j] -= pulled[j]
        held.multipliers[:count] += force
        times_into(program, step.d, step.along)
    return True


KNOWN, ROWS, WEIGHT, HELD_COUNT, INNER, HEAD = 0, 1, 2, 3, 4, 5
"""Places of the first numbers, and how many there are."""


@helper
def held_room(joints: int) -> int:
    """Most rows that hold a solution."""
    return 2 * joints + 2


@helper
def inner_room(joints: int) -> int:
    """Most numbers of an interior-point method."""
    return 8 * joints


@kernel(WHOLE)
def size(joints: int) -> int:
    """How many numbers there are for n joints."""
    return HEAD + joints + 3 * held_room(joints) + inner_room(joints)


HELD_ROWS = together(INDEX, INDEX, VECTOR)
"""(a,) rows that hold a solution, their sides and their multipliers."""


@kernel(VECTOR, together(WHOLE, REAL), HELD_ROWS, VECTOR, OUT_VECTOR)
def pack(
    torque: FloatArray, known: tuple[int, float], holding: tuple[Any, ...], inner: FloatArray, out: FloatArray
) -> None:
    """A start into its numbers.

    Args:
        torque: (n,) [N m].
        known: How many rows the problem had, weight of the robustness.
        holding: See `HELD_ROWS`.
        inner: (.,) of an interior-point method; empty where there is none.
        out: (size,) written.
    """
    held, sides, multipliers = holding
    n, room = torque.size, held_room(torque.size)
    out[:] = 0.0
    out[KNOWN], out[ROWS], out[WEIGHT] = 1.0, known[0], known[1]
    out[HEAD : HEAD + n] = torque
    if held.size <= room:
        out[HELD_COUNT] = held.size
        for i in range(held.size):
            at = HEAD + n + i
            out[at], out[at + room], out[at + 2 * room] = held[i], sides[i], multipliers[i]
    if inner.size <= inner_room(n):
        out[INNER] = inner.size
        first = HEAD + n + 3 * room
        out[first : first + inner.size] = inner


@kernel(VECTOR, WHOLE)
def unpack(packed: FloatArray, joints: int) -> tuple[FloatArray, IntArray, IntArray, FloatArray, FloatArray]:
    """Torque (n,), held rows, their sides and multipliers (a,), and what an interior-point method left.

    Args:
        packed: (size,) as `pack` writes them.
        joints: n.
    """
    count, room, first = int(packed[HELD_COUNT]), held_room(joints), HEAD + joints
    held, sides = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    for i in range(count):
        held[i], sides[i] = int(packed[first + i]), int(packed[first + room + i])
    multipliers = packed[first + 2 * room : first + 2 * room + count].copy()
    inner = packed[first + 3 * room : first + 3 * room + int(packed[INNER])].copy()
    return packed[HEAD:first].copy(), held, sides, multipliers, inner
