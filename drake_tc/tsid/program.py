"""The problem as a Drake MathematicalProgram over y = (vdot, f, tau), every binding named.

`program_solver` solves it, with the robustness added, where a controller file says `solver: program`. The fast path has
the same problem reduced to the torques (`reduction`), as the matrices of `reduced_qp`.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.solvers import MathematicalProgram

from drake_tc.tsid.assembly import Reduced, check_names, is_bounds, ordered
from drake_tc.tsid.qp.problem import QuadraticProgram
from drake_tc.tsid.rows import LeastSquares, LimitRows, Parts, Polytope, TaskRows, Terms
from drake_tc.types import FloatArray

DYNAMICS, CONTACTS = "dynamics", "contacts"
"""Names of the program's equalities."""


def build_full(
    terms: Terms,
    tasks: Sequence[TaskRows],
    limits: Sequence[LimitRows],
    contact_acceleration: FloatArray | None = None,
) -> MathematicalProgram:
    """Over y: variables `vdot` (nv), `f` (k), `tau` (n); equalities DYNAMICS and CONTACTS, then tasks and limits.

    Args:
        terms: At the state of all rows.
        tasks: Rows over y.
        limits: Rows over y.
        contact_acceleration: (k,) of the contacts, zero where None.

    Raises:
        ParamsError: two of the names are equal.
    """
    check_names([DYNAMICS, CONTACTS, *(rows.name for rows in tasks), *(rows.name for rows in limits)])
    built = MathematicalProgram()
    program: Any = built
    sizes = sizes_of(terms)
    parts = [program.NewContinuousVariables(size, name) for size, name in zip(sizes, ("vdot", "f", "tau"), strict=True)]
    y = np.concatenate(parts)
    dynamics, contacts, right, drift = equalities(terms, contact_acceleration)
    name_binding(program.AddLinearEqualityConstraint(dynamics, right, y), DYNAMICS)
    if drift.size:
        name_binding(program.AddLinearEqualityConstraint(contacts, drift, y), CONTACTS)
    for task in tasks:
        if task.target.size:
            _add_cost(program, task.name, weighted(task, sizes), y)
    for limit in ordered(limits):
        if not limit.lower.size:
            continue
        if is_bounds(limit):
            name_binding(program.AddBoundingBoxConstraint(limit.lower, limit.upper, parts[2]), limit.name)
        else:
            rows = over_y(limit.matrix, sizes)
            name_binding(program.AddLinearConstraint(rows, limit.lower, limit.upper, y), limit.name)
    return built


def least_squares_qp(cost: LeastSquares, polytope: Polytope) -> QuadraticProgram:
    """||D x - d||^2 on a polytope as 1/2 x^T H x + c^T x: H = 2 D^T D, c = -2 D^T d; the constant d^T d is left out."""
    double, sides = 2.0 * cost.matrix.T, (polytope.lower, polytope.upper)
    return QuadraticProgram(double.dot(cost.matrix), -double.dot(cost.target), polytope.matrix, *sides, polytope.bounds)


def reduced_qp(reduced: Reduced) -> QuadraticProgram:
    """The reduced problem's matrices."""
    return least_squares_qp(reduced.cost, reduced.polytope)


def name_binding(binding: Any, name: str) -> None:
    """Give a cost or constraint its name."""
    binding.evaluator().set_description(name)


def _add_cost(program: Any, name: str, cost: LeastSquares, variables: Any) -> None:
    name_binding(program.Add2NormSquaredCost(cost.matrix, cost.target, variables), name)


def sizes_of(terms: Terms) -> tuple[int, int, int]:
    """(nv, k, n): of the parts of y."""
    return terms.bias.size, terms.contact_bias.size, terms.actuated.size


def over_y(parts: Parts, sizes: tuple[int, int, int]) -> FloatArray:
    """(r, nv + k + n) rows written out over y."""
    pieces = (parts.vdot, parts.force, parts.torque)
    rows = next(piece.shape[0] for piece in pieces if piece is not None)
    return np.concatenate(
        [np.zeros((rows, size)) if piece is None else piece for piece, size in zip(pieces, sizes, strict=True)], axis=1
    )


def weighted(task: TaskRows, sizes: tuple[int, int, int]) -> LeastSquares:
    """A task's rows over y, times their weights."""
    return LeastSquares(task.weight[:, None] * over_y(task.matrix, sizes), task.weight * task.target)


def equalities(
    terms: Terms, contact_acceleration: FloatArray | None
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Rows over y of the dynamics (nv) and of the contacts (k), and their right sides."""
    nv, k, n = sizes_of(terms)
    dynamics = np.zeros((nv, nv + k + n))
    dynamics[:, :nv] = terms.mass_matrix
    dynamics[:, nv : nv + k] = -terms.contact_jacobian.T
    dynamics[terms.actuated, nv + k + np.arange(n)] = -1.0
    contacts = np.zeros((k, nv + k + n))
    contacts[:, :nv] = terms.contact_jacobian
    drift = -terms.contact_bias if contact_acceleration is None else contact_acceleration - terms.contact_bias
    return dynamics, contacts, -terms.bias, drift
