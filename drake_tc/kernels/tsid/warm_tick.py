"""A whole tick of robust TSID in one call, from where the last tick ended.

    problem -> minimum of J + w R, or of J - w s, from the last torque and the rows that held it -> status, vdot, f

The entry calls those of the single stages (`problem`, `newton`, `scaling`, `terms`), so that its numbers are
theirs. It solves the trade-offs by one program each; that of a rectangle goes on from the last rectangle. Where it does
not end with a torque it says which stage gave none, and `drake_tc.tsid.tick` goes through the stages one by one.
"""

from typing import Any

import numpy as np

from drake_tc.kernels.compiling import OUT_VECTOR, VECTOR, inlined, kernel
from drake_tc.kernels.linear_algebra import times_vector
from drake_tc.kernels.tsid.active_set import KNOWN, ROWS, pack, unpack
from drake_tc.kernels.tsid.newton import DONE, FEASIBLE, FRESH, RISK, SOLVED, STEPS, minimum
from drake_tc.kernels.tsid.problem import FOUND, LAW, VELOCITIES, Answer, Tables, problem
from drake_tc.kernels.tsid.programs import RECTANGLE
from drake_tc.kernels.tsid.scaling import box_program, box_risk, box_size, evaluated
from drake_tc.kernels.tsid.terms import response
from drake_tc.types import FloatArray

OPEN = 3
"""Code beside those of `problem`: there is a problem, and the stages are to solve it."""
STATUS = 11
"""Numbers of a status, see `drake_tc.tsid.law.Status`."""
KIND, WEIGHT, SIZE_WEIGHT, DAMPING, WIDTH, ACCURACY, EXACT, MOST, LARGEST, FORCES = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9
"""Places in the form: PLAIN or RECTANGLE, w of R_ind or R_rect and w of the box's size (both 0 for "classic"), damping,
least width of a rectangle along each axis, accuracy of the minimum and what it may be of ||d||^2 beside that, steps at
most, largest R, numbers K of the forces of all contacts."""


@inlined
def erring_sides(found: Answer) -> tuple[FloatArray, FloatArray]:
    """The sides of the rows that err; infinite where a row does not."""
    lower, upper = found.lower, found.upper
    if found.sure:
        lower, upper = lower.copy(), upper.copy()
        for i in range(lower.size):
            if found.certain[i]:
                lower[i], upper[i] = -np.inf, np.inf
    return lower, upper


@inlined
def misses(found: Answer, x: FloatArray) -> bool:
    """Whether x (n,) misses a side of the problem."""
    value, missed = np.empty(found.lower.size), False
    times_vector(value, found.rows, x)
    for i in range(value.size):
        missed = missed or value[i] > found.upper[i] + FEASIBLE or value[i] < found.lower[i] - FEASIBLE
    return missed


@kernel(VECTOR, LAW, VECTOR, VECTOR, OUT_VECTOR)
def warm_tick(given: FloatArray, law: tuple[Any, ...], form: FloatArray, before: FloatArray, after: FloatArray) -> int:
    """See the module.

    Args:
        given: (nq + nv + references,) q, v and the references of all tasks.
        law: As `problem.problem` takes it.
        form: (10,) see `KIND` and what follows it.
        before: (S,) [tau; vdot; f; status; start] of the last tick; its rows count where this problem has as many.
        after: (S,) the same of this tick, written where the code is FOUND.

    Returns:
        FOUND, or the code of what stands in the way.
    """
    tables = Tables(*law[1])
    scale, options = tables.scale, tables.options
    none, nothing, n = np.zeros((0, 0)), np.zeros(0), scale.size
    moving = n + int(options[VELOCITIES])
    pushing = moving + int(form[FORCES])
    last, start, status = before[pushing + STATUS :], after[pushing + STATUS :], after[pushing : pushing + STATUS]
    if not last[KNOWN] > 0.0:
        return OPEN
    found = problem(given, law)
    if found.code != FOUND:
        return int(found.code)
    m, kind, boxed = found.lower.size, int(form[KIND]), form[SIZE_WEIGHT] > 0.0
    torque, rows, sides, multipliers, inner = unpack(last, n)
    known, axes = last[ROWS] == m, 2 * found.noise.shape[1] if kind == RECTANGLE else 0
    if kind == RECTANGLE and not (known and inner.size == axes + m):
        return OPEN
    begin, linear = np.zeros(n + axes + int(boxed)), np.zeros(n + 1 if boxed else 0)
    for j in range(n):
        begin[j] = torque[j] / scale[j]
    matrix, lower, upper, cost = found.rows, found.lower, found.upper, found.cost
    low, high, noise, kept, least = nothing, nothing, none, nothing, 1.0
    if kind == RECTANGLE:
        noise, kept, begin[n:] = found.noise, inner[axes:].copy(), inner[:axes]
        for j in range(n, n + axes // 2):
            least = min(least, begin[j] + begin[j + axes // 2])
    elif form[WEIGHT] > 0.0:
        low, high = erring_sides(found)
    elif boxed:
        begin[n] = inner[0] if known and inner.size == 1 else 0.0
        linear[n] = -form[SIZE_WEIGHT]
        matrix, lower, upper, cost = box_program(matrix, lower, upper, found.noise, cost)
    search = np.zeros(6)
    search[0], search[1], search[2] = form[WEIGHT], form[DAMPING], form[WIDTH] * least
    search[3], search[4], search[5] = form[ACCURACY], form[MOST], FRESH
    for value in found.target:
        search[3] += form[EXACT] * value * value
    if not known:
        rows, sides, multipliers = rows[:0], sides[:0], multipliers[:0]
    program = kind, matrix, noise, kept, cost, found.target, linear, low, high, search
    outcome, x, holding, _, _, memory = minimum(
        program, (lower, upper), begin, (rows, sides, multipliers), (none, nothing, nothing, nothing)
    )
    if outcome != SOLVED or not np.isfinite(x.sum()):
        return OPEN
    answer, risk = x[:n].copy(), memory[RISK]
    limits = found.rows, found.lower, found.upper, found.certain
    if kind == RECTANGLE and misses(found, answer):
        return OPEN
    if boxed:
        half = box_size(answer, limits, found.noise)
        risk = box_risk(half, found.noise.shape[1])
    applied, _, chance, _ = evaluated(answer, scale, limits, (found.cost, found.target))
    vdot, force = response(applied, found.motion, found.push, tables.entries, pushing - moving)
    after[:n], after[n:moving], after[moving:pushing], status[:] = applied, vdot, force, 0.0
    status[2], status[3], status[4], status[5] = memory[STEPS], min(risk, form[LARGEST]), chance, -1.0
    status[7], status[8] = found.relaxed, 1.0 if memory[DONE] > 0.0 else 0.0
    left = np.empty(x.size - n + kept.size)
    left[: x.size - n], left[x.size - n :] = x[n:], kept
    pack(applied, (m, 0.0), holding, left, start)
    return FOUND
