"""Quadratic programs for tests, and what makes an answer to one right."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.optimize import linprog

from drake_tc.tsid.qp import QpSolution, QuadraticProgram

from .problems import Setup, problems
from .program_matrices import reduced_qp

FAMILIES = {
    "standing": Setup(),
    "saturated": Setup(com_step=0.2, velocity=0.5, speed=0.2),
    "free internal forces": Setup(force_weight=0.0),
}
"""Real problems: few rows active, many, and a Hessian that is singular."""


@dataclass(frozen=True)
class Residuals:
    """Of the optimality conditions: of H x + c + A^T mu = 0, of the rows, of mu_i (side - row) = 0, of mu's signs.

    The first and the last over the largest term of the gradient, or 1: numbers of that size are added there.
    """

    dual: float
    primal: float
    complementarity: float

    @classmethod
    def of(cls, problem: QuadraticProgram, solution: QpSolution) -> "Residuals":
        x, mu = solution.x, solution.multipliers
        rows = problem.matrix @ x
        above, below = rows - problem.upper, problem.lower - rows
        pushing = np.where(mu > 0, above, below)
        terms = (problem.hessian @ x, problem.gradient, problem.matrix.T * mu)
        largest = max(1.0, *(float(np.abs(term).max(initial=0.0)) for term in terms))
        return cls(
            float(np.abs(problem.hessian @ x + problem.gradient + problem.matrix.T @ mu).max()) / largest,
            float(max(0.0, np.maximum(above, below).max(initial=0.0))),
            float(np.abs(mu[mu != 0] * pushing[mu != 0]).max(initial=0.0)) / largest,
        )


def cost(problem: QuadraticProgram, x: np.ndarray) -> float:
    return float(0.5 * x @ problem.hessian @ x + problem.gradient @ x)


@cache
def real(family: str, count: int, seed: int = 0) -> list[QuadraticProgram]:
    """The same objects at each call."""
    return [reduced_qp(problem.reduced) for problem in problems(count, seed, FAMILIES[family])]


def random(seed: int, n: int = 12, m: int = 30, *, rank: int | None = None, equalities: int = 0) -> QuadraticProgram:
    """Feasible, with bounds on the first half of x, sides missing here and there."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n if rank is None else rank, n))
    matrix = np.concatenate((np.eye(n // 2, n), rng.normal(size=(m, n))))
    inside = matrix @ rng.normal(size=n)
    lower, upper = inside - rng.uniform(0, 1, inside.size), inside + rng.uniform(0, 1, inside.size)
    lower[rng.random(lower.size) < 0.3] = -np.inf
    upper[rng.random(upper.size) < 0.3] = np.inf
    if equalities:
        lower[-equalities:] = upper[-equalities:] = inside[-equalities:]
    return QuadraticProgram(root.T @ root, 10 * rng.normal(size=n), matrix, lower, upper, n // 2)


def crude(seed: int) -> QuadraticProgram:
    """Small, of whole numbers half of the time: rows that depend on others, touch, are equalities, conflict."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(2, 9)), int(rng.integers(1, 25))
    whole, bounds = rng.random() < 0.5, int(rng.integers(0, n + 1))

    def entries(*shape):
        return rng.integers(-2, 3, shape).astype(float) if whole else rng.normal(size=shape)

    matrix = np.concatenate((np.eye(bounds, n), entries(m, n)))
    centre = matrix @ entries(n) + rng.integers(0, 2) * entries(m + bounds)
    width = np.abs(entries(m + bounds))
    lower, upper = centre - width, centre + width
    lower[rng.random(lower.size) < 0.2] = -np.inf
    upper[rng.random(upper.size) < 0.2] = np.inf
    root = entries(int(rng.integers(1, n + 1)), n)
    return QuadraticProgram(root.T @ root, 5 * root.T @ rng.normal(size=root.shape[0]), matrix, lower, upper, bounds)


def has_a_point(problem: QuadraticProgram) -> bool:
    """By linear programming."""
    up, low = np.isfinite(problem.upper), np.isfinite(problem.lower)
    rows = np.concatenate((problem.matrix[up], -problem.matrix[low]))
    sides = np.concatenate((problem.upper[up], -problem.lower[low]))
    return linprog(np.zeros(rows.shape[1]), rows, sides, bounds=(None, None)).status == 0
