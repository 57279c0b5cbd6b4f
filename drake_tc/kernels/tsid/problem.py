"""The problem over the torques of one tick of robust TSID in one call.

    terms -> rows of tasks and limits -> causes of tau -> cost and polytope over tau -> scaled

The entry calls those of the single stages, which `drake_tc.tsid` calls one by one where it wants what is between them.
"""

from typing import Any, NamedTuple

import numpy as np

from drake_tc.kernels.compiling import INDEX, MATRIX, TABLE, VECTOR, inlined, kernel, together
from drake_tc.kernels.linear_algebra import inverse_factor
from drake_tc.kernels.tsid.rows import Body, Given, reduced_limits, reduced_tasks
from drake_tc.kernels.tsid.scaling import scaled
from drake_tc.kernels.tsid.terms import ROBOT, causes, terms
from drake_tc.types import FloatArray, IntArray

FOUND, NO_POSE, LOST = 0, 1, 2
"""Whether there is a problem, a floating base's quaternion says nothing, or an input is not finite or too large."""
LARGEST, SHORTEST, DAMPING, MASS, POSITIONS, VELOCITIES, PLAIN = 0, 1, 2, 3, 4, 5, 6
"""Places in the options."""
FULL_RANK = 1e-7
"""Least relative length of a triangular factor's inverse that shows a cost to have one minimiser."""


class Tables(NamedTuple):
    """What else a tick knows beforehand.

    Attributes:
        active: Contacts that carry.
        actuated, positions: (n,) index in v and in q of each joint.
        tasks, limits: (., 5) see `rows`; of limits torque bounds first and group by group.
        integers, numbers: What both point into.
        dense: (., nv + k + n + 2) rows that the library does not know.
        scale, root: (n,) and (n, r) of the torque error.
        options: See `LARGEST` and what follows it.
        entries: (k,) places of the forces among those of all contacts.
    """

    active: IntArray
    actuated: IntArray
    positions: IntArray
    tasks: IntArray
    limits: IntArray
    integers: IntArray
    numbers: FloatArray
    dense: FloatArray
    scale: FloatArray
    root: FloatArray
    options: FloatArray
    entries: IntArray


LAW = together(ROBOT, together(INDEX, INDEX, INDEX, TABLE, TABLE, INDEX, VECTOR, MATRIX, VECTOR, MATRIX, VECTOR, INDEX))
"""`Robot` and `Tables`."""


class Answer(NamedTuple):
    """What the entry returns."""

    code: int
    relaxed: int
    motion: FloatArray
    push: FloatArray
    cost: FloatArray
    target: FloatArray
    rows: FloatArray
    lower: FloatArray
    upper: FloatArray
    noise: FloatArray
    certain: IntArray
    divisor: FloatArray
    sure: int


@inlined
def state_code(given: FloatArray, floating: IntArray, largest: float, shortest: float) -> int:
    """One of the codes."""
    sound, first, turn = True, floating[0], 0.0
    for i in range(given.size):
        sound = sound and -largest < given[i] < largest
    if not sound:
        return LOST
    for i in range(4):
        turn += given[first + i] * given[first + i] if first >= 0 else 1.0
    return FOUND if turn > shortest else NO_POSE


@kernel(VECTOR, LAW)
def problem(given: FloatArray, law: tuple[Any, ...]) -> Answer:
    """See the module.

    Args:
        given: (nq + nv + references,) q, v and the references of all tasks.
        law: See `LAW`.

    Returns:
        One of the codes, for how many rows a limit gave way, [C_v, c_v] and [C_f, c_f], and what `scaling.scaled` gives
        with d after D; empty arrays where there is no problem.
    """
    robot, tables, options = law[0], Tables(*law[1]), law[1][10]
    none, nothing = np.zeros((0, 0)), np.zeros(0)
    code = state_code(given, robot[1], options[LARGEST], options[SHORTEST])
    if code != FOUND:
        empty = np.zeros(0, dtype=np.int64)
        return Answer(code, 0, none, none, none, nothing, none, nothing, nothing, none, empty, nothing, 0)
    nq, nv = int(options[POSITIONS]), int(options[VELOCITIES])
    q, v = given[:nq], given[nq : nq + nv]
    bodies, mass, bias, jacobian, drift, slip, place, speed, momentum, rate = terms(q, v, robot, tables.active)
    for i in range(drift.size):
        drift[i] += options[DAMPING] * slip[i]
    motion, push = causes(mass, bias, tables.actuated, jacobian, drift)
    state = Given(q, v, tables.positions, given[nq + nv :], tables.integers, tables.numbers, tables.dense)
    body = Body(robot, bodies, options[MASS], place, speed, momentum, rate)
    cost, target = reduced_tasks(state, body, tables.tasks, motion, push)
    rows, low, high, relaxed = reduced_limits(state, tables.limits, motion, push)
    cost, rows, low, high, noise, certain, divisor, sure = scaled(
        cost, (rows, low, high), tables.scale, tables.root, options[PLAIN] > 0.0
    )
    return Answer(code, relaxed, motion, push, cost, target, rows, low, high, noise, certain, divisor, sure)


@kernel(MATRIX)
def has_one_minimiser(cost: FloatArray) -> bool:
    """Whether D has full column rank by far: ||L^-1|| bounds its least singular value, D^T D = L^T L."""
    if cost.shape[0] < cost.shape[1]:
        return False
    inverse = inverse_factor(np.dot(cost.T, cost))
    total, largest = 0.0, 0.0
    for i in range(inverse.shape[0]):
        largest = max(largest, 1.0 / inverse[i, i])
        for j in range(i, inverse.shape[0]):
            total += inverse[i, j] * inverse[i, j]
    return bool(FULL_RANK * largest * np.sqrt(total) < 1.0)
