"""One step of Newton's method inside linear limits: min 1/2 d^T H d + g^T d, lower <= A (x + d) <= upper."""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dposv

from drake_tc.tsid.qp.problem import Outcome, QpSolution, QpSolver, QuadraticProgram
from drake_tc.tsid.robust.factor import Factor
from drake_tc.tsid.robust.scaled import RowProduct
from drake_tc.types import FloatArray, IntArray

GUESSES = 6
"""How many working sets are tried before the QP solver is asked; each costs a fifth of it or less."""

INSIDE = 1e-8
"""In units of a row: what counts as met."""

ANSWERED = 1e-5
"""What an answer of the QP solver may miss; some answer contradictory limits with anything."""

EMPTY: IntArray = np.zeros(0, dtype=np.int64)


class Working(NamedTuple):
    """Rows held at one of their sides.

    Attributes:
        rows: (a,) indices.
        sides: (a,) 1 at the upper, -1 at the lower side.
        multipliers: (a,) >= 0 at the upper, <= 0 at the lower side.
    """

    rows: IntArray
    sides: IntArray
    multipliers: FloatArray


FREE = Working(EMPTY, EMPTY, np.zeros(0))


class Step(NamedTuple):
    """What a step is: d (n,), A d (m,), the rows it ends on, and how it was found."""

    d: FloatArray
    along: FloatArray
    working: Working
    outcome: Outcome
    qp: bool


class Stepper:
    """Steps with one Hessian: factored once, as long as it is used."""

    def __init__(self, factor: Factor, rows: RowProduct, qp: QpSolver) -> None:
        self._factor, self._rows, self._qp = factor, rows, qp
        self.failed = factor.failed
        self._held: tuple[IntArray, FloatArray] | None = None

    def step(self, gradient: FloatArray, lower: FloatArray | None, upper: FloatArray, working: Working) -> Step:
        """The step within lower <= A d <= upper.

        A working set that satisfies all conditions of optimality IS the answer, so guesses from the last step come
        first: each drops what pulls the wrong way and takes in the row that is missed most; the solver gets what
        remains.
        """
        newton = -self._factor.solve(gradient)
        free = self._rows.times(newton)
        step = self._guess(newton, free, lower, upper, working)
        return step if step is not None else self._solve(gradient, newton, free, lower, upper, working)

    def promise(self, gradient: FloatArray, working: Working) -> float:
        """Descent that the gradient r that the rows' forces do not balance promises, without limits: r^T H^-1 r / 2."""
        if len(working.rows):
            gradient = gradient + working.multipliers.dot(self._take(working.rows))
        return 0.5 * float(gradient.dot(self._factor.solve(gradient)))

    def _take(self, rows: IntArray) -> FloatArray:
        if self._held is None or self._held[0] is not rows:
            self._held = rows, self._rows.take(rows)
        return self._held[1]

    def _guess(
        self, newton: FloatArray, free: FloatArray, lower: FloatArray | None, upper: FloatArray, working: Working
    ) -> Step | None:
        rows, sides = working.rows, working.sides
        for _ in range(GUESSES):
            d, along, multipliers = newton, free, FREE.multipliers
            if len(rows):
                ends = upper[rows] if lower is None else np.where(sides > 0, upper[rows], lower[rows])
                whitened = self._factor.whiten(self._take(rows).T)
                _, multipliers, failed = dposv(whitened.T.dot(whitened), free[rows] - ends)
                if failed or not math.isfinite(float(ends.sum())):
                    return None
                d = newton - self._factor.colour(whitened.dot(multipliers))
                along = self._rows.times(d)
            miss = along - upper
            if lower is not None:
                np.maximum(miss, lower - along, out=miss)
            worst = int(miss.argmax()) if len(miss) else -1
            met = worst < 0 or miss[worst] <= INSIDE
            if len(rows) and (pulls := multipliers * sides < 0.0).any():
                rows, sides = rows[~pulls], sides[~pulls]
            elif met:
                held = Working(rows, sides, multipliers) if len(rows) else FREE
                return Step(d, along, held, Outcome.SOLVED, qp=False)
            if not met:
                if worst in rows:
                    return None
                rows = np.append(rows, worst)
                sides = np.append(sides, 1 if along[worst] > upper[worst] else -1)
        return None

    def _solve(
        self,
        gradient: FloatArray,
        newton: FloatArray,
        free: FloatArray,
        lower: FloatArray | None,
        upper: FloatArray,
        working: Working,
    ) -> Step:
        rows = self._rows.dense()
        floor = np.full(len(upper), -np.inf) if lower is None else lower
        start: QpSolution | None = None
        if len(working.rows):
            force = np.zeros(len(upper))
            force[working.rows] = working.sides
            start = QpSolution(newton, force, Outcome.SOLVED, 0)
        program = QuadraticProgram(self._factor.hessian(), gradient, rows.matrix, floor, upper, rows.bounds)
        solution = self._answer(program, start)
        if solution.outcome is not Outcome.SOLVED:
            return Step(np.zeros_like(gradient), np.zeros_like(upper), FREE, solution.outcome, qp=True)
        along = rows.matrix @ solution.x
        force = solution.multipliers
        held = np.flatnonzero(np.abs(force) > 1e-9 * np.abs(force).max(initial=0.0))
        found = Working(held, np.where(force[held] > 0.0, 1, -1), force[held])
        exact = self._guess(newton, free, lower, upper, found)
        if exact is not None:
            return Step(exact.d, exact.along, exact.working, Outcome.SOLVED, qp=True)
        return Step(solution.x, along, found, Outcome.SOLVED, qp=True)

    def _answer(self, program: QuadraticProgram, start: QpSolution | None) -> QpSolution:
        """The solver's answer if it keeps the limits, else that to the shortest step which does: only where even that
        misses them, or is called infeasible, they are contradictory.
        """
        solution = self._qp.solve(program, start)
        if _keeps(program, solution):
            return solution
        if not math.isfinite(float(program.gradient.sum() + program.hessian.sum() + program.matrix.sum())):
            return replace(solution, outcome=Outcome.FAILED)
        shortest = replace(program, hessian=np.eye(len(program.gradient)), gradient=np.zeros_like(program.gradient))
        solution = self._qp.solve(shortest)
        return solution if _keeps(program, solution) else replace(solution, outcome=Outcome.INFEASIBLE)


def _keeps(program: QuadraticProgram, solution: QpSolution) -> bool:
    if solution.outcome is not Outcome.SOLVED:
        return False
    along = program.matrix @ solution.x
    return bool((np.maximum(program.lower - along, along - program.upper) <= ANSWERED).all())
