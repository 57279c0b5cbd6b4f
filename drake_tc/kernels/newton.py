"""Newton's method (SQP) for a convex objective inside linear limits.

Each step solves the quadratic model of f within the rows, so from the first full step on every iterate is feasible; the
objective falls from there on by Armijo's rule with backtracking. The rule on the slope that strong Wolfe adds protects
quasi-Newton updates from steps that are too short; with the exact Hessian of a convex function the full step is tried
first and nothing needs that protection.

`search` stops where a step's held rows cannot be guessed (ASKS), and goes on with the answer of a QP solver.
"""

import math
from typing import NamedTuple

import numpy as np

from drake_tc.kernels.compiling import helper
from drake_tc.kernels.programs import (
    RECTANGLE,
    Point,
    Program,
    gradient_into,
    hessian_into,
    point_of,
    risk_at,
    rows_of,
    times_into,
    value_at,
)
from drake_tc.kernels.steps import (
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
from drake_tc.types import FloatArray

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
