"""Rows of the built-in tasks and limits at one state, from tables; `drake_tc.tsid.tables` writes them.

A table has a row a task or limit: kind, how many rows, and where its whole numbers, its numbers and its reference
begin. Rows that the library does not know are DENSE: written out over (vdot, f, tau) and two columns more, which are
target and weight of a task, lower and upper side of a limit.
"""

from typing import Any, NamedTuple

import numpy as np

from drake_tc.kernels.compiling import helper
from drake_tc.kernels.linking import inlined
from drake_tc.kernels.reduction import DENSE, NOTHING, PICKED, Over, over_torques
from drake_tc.kernels.rows import com, frame, momentum, posture, pressure, viable
from drake_tc.kernels.terms import frame_terms
from drake_tc.types import FloatArray, IntArray

KIND, ROWS, INTEGERS, NUMBERS, REFERENCE = 0, 1, 2, 3, 4
"""Columns of a table."""
WRITTEN_OUT = 0
COM, POSTURE, FRAME, ORIENTATION, FORCE, TORQUE, MOMENTUM, PRESSURE = 1, 2, 3, 4, 5, 6, 7, 8
BOUNDS, FORCES, VIABLE = 1, 2, 3
"""Kinds of tasks, and of limits; `WRITTEN_OUT` is of both."""


class Given(NamedTuple):
    """Of one tick: the state, the joints' places in q, what the tables point into, and rows that are written out.

    The latter are (., nv + k + n + 2).
    """

    q: FloatArray
    v: FloatArray
    positions: IntArray
    references: FloatArray
    integers: IntArray
    numbers: FloatArray
    dense: FloatArray


class Body(NamedTuple):
    """What rows need of the terms, and of the robot's tables (`terms.Robot`)."""

    robot: tuple[Any, ...]
    bodies: FloatArray
    mass: float
    com: FloatArray
    com_velocity: FloatArray
    momentum: FloatArray
    rate: FloatArray


@helper
def over(kinds: tuple[int, int, int], vdot: FloatArray, picks: IntArray, force: FloatArray, torque: FloatArray) -> Over:
    """Rows by their parts."""
    given = np.empty(3, dtype=np.int64)
    given[0], given[1], given[2] = kinds
    return Over(given, vdot, picks, force, torque)


@inlined
def parts_of_dense(given: Given, first: int, count: int, sizes: tuple[int, int, int]) -> Over:
    """Rows that are written out."""
    nv, k, n = sizes
    whole = given.dense[first : first + count]
    return over(
        (DENSE, DENSE, DENSE),
        whole[:, :nv].copy(),
        np.zeros(0, dtype=np.int64),
        whole[:, nv : nv + k].copy(),
        whole[:, nv + k : nv + k + n].copy(),
    )


@inlined
def frame_rows(given: Given, body: Body, row: IntArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Matrix over vdot and target of a frame's pose or of its orientation alone."""
    first, at, start = row[INTEGERS], row[NUMBERS], row[REFERENCE]
    index, axes = given.integers[first], given.integers[first + 1]
    selected = given.integers[first + 2 : first + 2 + count]
    motion = frame_terms(given.q, body.robot, body.bodies, index, given.v.size)
    reference = np.zeros(19)
    if row[KIND] == FRAME:
        reference[:] = given.references[start : start + 19]
    else:
        reference[:4] = given.references[start : start + 4]
        reference[7:10] = given.references[start + 4 : start + 7]
        reference[13:16] = given.references[start + 7 : start + 10]
    gains = given.numbers[at : at + 6], given.numbers[at + 6 : at + 12]
    found: tuple[FloatArray, FloatArray] = frame(motion, gains, reference, selected, axes)
    return found


@inlined
def task_of(
    given: Given, body: Body, row: IntArray, sizes: tuple[int, int, int]
) -> tuple[Over, FloatArray, FloatArray]:
    """Rows, targets and weights of a task."""
    kind, count, first, at, start = row[KIND], row[ROWS], row[INTEGERS], row[NUMBERS], row[REFERENCE]
    integers, numbers, references = given.integers, given.numbers, given.references
    none, nowhere, target = np.zeros((0, 0)), np.zeros(0, dtype=np.int64), np.zeros(count)
    rows, skip = over((NOTHING, NOTHING, NOTHING), none, nowhere, none, none), 0
    if count == 0:
        return rows, target, target.copy()
    if kind == COM:
        axes, skip = integers[first : first + count], 6
        gains = numbers[at : at + 3], numbers[at + 3 : at + 6]
        goal = references[start : start + 9]
        whole = body.momentum, body.rate, body.mass, body.com, body.com_velocity
        matrix, target = com(whole, gains, goal, axes)
        rows = over((DENSE, NOTHING, NOTHING), matrix, nowhere, none, none)
    elif kind == POSTURE:
        joints, positions = integers[first : first + count], integers[first + count : first + 2 * count]
        picks, skip = integers[first + 2 * count : first + 3 * count], 2 * count
        gains, n = (numbers[at : at + count], numbers[at + count : at + 2 * count]), sizes[2]
        target = posture(given.q, given.v, (joints, positions, picks), gains, references[start : start + 3 * n])
        rows = over((PICKED, NOTHING, NOTHING), none, picks.copy(), none, none)
    elif FRAME <= kind <= ORIENTATION:
        matrix, target = frame_rows(given, body, row, count)
        rows, skip = over((DENSE, NOTHING, NOTHING), matrix, nowhere, none, none), 12
    elif kind == FORCE:
        for i in range(count):
            target[i] = references[start + integers[first + i]]
        rows = over((NOTHING, PICKED, NOTHING), none, nowhere, none, none)
    elif kind == TORQUE:
        target[:] = references[start : start + count]
        rows = over((NOTHING, NOTHING, PICKED), none, nowhere, none, none)
    elif kind == MOMENTUM:
        axes, skip = integers[first : first + count], 3
        goal = references[start : start + 6]
        matrix, target = momentum((body.momentum, body.rate, given.v), numbers[at : at + 3], goal, axes)
        rows = over((DENSE, NOTHING, NOTHING), matrix, nowhere, none, none)
    elif kind == PRESSURE:
        matrix = pressure(references[start : start + 2], integers[first], sizes[1])
        rows = over((NOTHING, DENSE, NOTHING), none, nowhere, matrix, none)
    else:
        rows = parts_of_dense(given, first, count, sizes)
        last = given.dense.shape[1]
        target[:] = given.dense[first : first + count, last - 2]
        return rows, target, given.dense[first : first + count, last - 1].copy()
    return rows, target, numbers[at + skip : at + skip + count].copy()


@inlined
def limit_of(given: Given, row: IntArray, sizes: tuple[int, int, int]) -> tuple[Over, FloatArray, FloatArray, int]:
    """Rows and sides of a limit, and for how many a limit gave way."""
    kind, count, first, at = row[KIND], row[ROWS], row[INTEGERS], row[NUMBERS]
    numbers, k = given.numbers, sizes[1]
    none, nowhere = np.zeros((0, 0)), np.zeros(0, dtype=np.int64)
    if kind == BOUNDS:
        rows = over((NOTHING, NOTHING, PICKED), none, nowhere, none, none)
        return rows, numbers[at : at + count].copy(), numbers[at + count : at + 2 * count].copy(), 0
    if kind == FORCES:
        end = at + count * k
        matrix = numbers[at:end].copy().reshape(count, k)
        rows = over((NOTHING, DENSE, NOTHING), none, nowhere, matrix, none)
        return rows, numbers[end : end + count].copy(), numbers[end + count : end + 2 * count].copy(), 0
    if kind == VIABLE:
        q, picks = np.empty(count), given.integers[first : first + count]
        for i in range(count):
            q[i] = given.q[given.positions[i]]
        parts = numbers[at : at + 7 * count]
        ends = parts[:count], parts[count : 2 * count], parts[2 * count : 3 * count], parts[3 * count : 4 * count]
        braking = parts[4 * count : 5 * count], parts[5 * count :], numbers[at + 7 * count]
        lower, upper, relaxed = viable(q, given.v, picks, ends + braking)
        return over((PICKED, NOTHING, NOTHING), none, picks.copy(), none, none), lower, upper, relaxed
    rows, last = parts_of_dense(given, first, count, sizes), given.dense.shape[1]
    lower = given.dense[first : first + count, last - 2].copy()
    return rows, lower, given.dense[first : first + count, last - 1].copy(), 0


@inlined
def reduced_tasks(
    given: Given, body: Body, table: IntArray, motion: FloatArray, push: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """D and d of ||D tau - d||^2."""
    sizes = given.v.size, push.shape[0], motion.shape[1] - 1
    size = 0
    for i in range(table.shape[0]):
        size += table[i, ROWS]
    matrix, right, start = np.empty((size, sizes[2])), np.empty(size), 0
    for i in range(table.shape[0]):
        rows, target, weight = task_of(given, body, table[i], sizes)
        out = over_torques(rows, target.size, motion, push)
        for k in range(target.size):
            right[start + k] = weight[k] * (target[k] - out[k, sizes[2]])
            for j in range(sizes[2]):
                matrix[start + k, j] = weight[k] * out[k, j]
        start += target.size
    return matrix, right


@inlined
def reduced_limits(
    given: Given, table: IntArray, motion: FloatArray, push: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, int]:
    """G and both sides of lower <= G tau <= upper, and for how many rows a limit gave way."""
    sizes = given.v.size, push.shape[0], motion.shape[1] - 1
    size, relaxed = 0, 0
    for i in range(table.shape[0]):
        size += table[i, ROWS]
    matrix, low, high, start = np.empty((size, sizes[2])), np.empty(size), np.empty(size), 0
    for i in range(table.shape[0]):
        rows, lower, upper, gave = limit_of(given, table[i], sizes)
        out = over_torques(rows, lower.size, motion, push)
        for k in range(lower.size):
            low[start + k], high[start + k] = lower[k] - out[k, sizes[2]], upper[k] - out[k, sizes[2]]
            for j in range(sizes[2]):
                matrix[start + k, j] = out[k, j]
        start += lower.size
        relaxed += gave
    return matrix, low, high, relaxed
