"""The problem as a Drake MathematicalProgram, full over y = (vdot, f, tau) or reduced to tau, every binding named.

The same rows give the fast path its matrices: `read_qp` of a program is what `reduced_qp` or `full_qp` hand over.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.solvers import MathematicalProgram

from drake_tc.tsid.assembly import check_names, cost_of, is_bounds, ordered, polytope_of
from drake_tc.tsid.polytope import LeastSquares, Polytope
from drake_tc.tsid.qp.problem import QuadraticProgram
from drake_tc.tsid.reduction import Reduced, causes_of
from drake_tc.tsid.rows import LimitRows, Parts, TaskRows
from drake_tc.tsid.terms import Terms
from drake_tc.types import FloatArray

DYNAMICS, CONTACTS = "dynamics", "contacts"
"""Names of the full program's equalities."""


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
    sizes = _sizes(terms)
    parts = [program.NewContinuousVariables(size, name) for size, name in zip(sizes, ("vdot", "f", "tau"), strict=True)]
    y = np.concatenate(parts)
    dynamics, contacts, right, drift = _equalities(terms, contact_acceleration)
    _name(program.AddLinearEqualityConstraint(dynamics, right, y), DYNAMICS)
    if drift.size:
        _name(program.AddLinearEqualityConstraint(contacts, drift, y), CONTACTS)
    for task in tasks:
        if task.target.size:
            _add_cost(program, task.name, _weighted(task, sizes), y)
    for limit in ordered(limits):
        if not limit.lower.size:
            continue
        if is_bounds(limit):
            _name(program.AddBoundingBoxConstraint(limit.lower, limit.upper, parts[2]), limit.name)
        else:
            _name(program.AddLinearConstraint(_over_y(limit.matrix, sizes), limit.lower, limit.upper, y), limit.name)
    return built


def build_reduced(
    terms: Terms,
    tasks: Sequence[TaskRows],
    limits: Sequence[LimitRows],
    contact_acceleration: FloatArray | None = None,
) -> MathematicalProgram:
    """Over `tau` (n): tasks and limits by `reduction`.

    Args:
        terms: At the state of all rows.
        tasks: Rows over y.
        limits: Rows over y.
        contact_acceleration: (k,) of the contacts, zero where None.

    Raises:
        ParamsError: two of the names are equal.
    """
    check_names([*(rows.name for rows in tasks), *(rows.name for rows in limits)])
    built = MathematicalProgram()
    program: Any = built
    tau = program.NewContinuousVariables(terms.actuated.size, "tau")
    causes = causes_of(terms, contact_acceleration)
    for task in tasks:
        if task.target.size:
            _add_cost(program, task.name, cost_of([task], causes), tau)
    for limit in ordered(limits):
        if not limit.lower.size:
            continue
        piece = polytope_of([limit], causes)
        if piece.bounds:
            _name(program.AddBoundingBoxConstraint(piece.lower, piece.upper, tau), limit.name)
        else:
            _name(program.AddLinearConstraint(piece.matrix, piece.lower, piece.upper, tau), limit.name)
    return built


def least_squares_qp(cost: LeastSquares, polytope: Polytope) -> QuadraticProgram:
    """||D x - d||^2 on a polytope as 1/2 x^T H x + c^T x: H = 2 D^T D, c = -2 D^T d; the constant d^T d is left out."""
    double, sides = 2.0 * cost.matrix.T, (polytope.lower, polytope.upper)
    return QuadraticProgram(double.dot(cost.matrix), -double.dot(cost.target), polytope.matrix, *sides, polytope.bounds)


def reduced_qp(reduced: Reduced) -> QuadraticProgram:
    """The reduced problem's matrices: those of `build_reduced`."""
    return least_squares_qp(reduced.cost, reduced.polytope)


def full_qp(
    terms: Terms,
    tasks: Sequence[TaskRows],
    limits: Sequence[LimitRows],
    contact_acceleration: FloatArray | None = None,
) -> QuadraticProgram:
    """The full problem's matrices, those of `build_full`: rows of bounds, then of equalities, then all others."""
    sizes = _sizes(terms)
    dynamics, contacts, right, drift = _equalities(terms, contact_acceleration)
    pieces = [_weighted(task, sizes) for task in tasks]
    matrix = np.concatenate([np.zeros((0, sum(sizes))), *(piece.matrix for piece in pieces)])
    target = np.concatenate([np.zeros(0), *(piece.target for piece in pieces)])
    limits = ordered(limits)
    boxes, more = ([rows for rows in limits if is_bounds(rows) is wanted] for wanted in (True, False))
    lower, upper = (
        np.concatenate(
            [*(getattr(rows, side) for rows in boxes), right, drift, *(getattr(rows, side) for rows in more)]
        )
        for side in ("lower", "upper")
    )
    over_y = ([_over_y(rows.matrix, sizes) for rows in some] for some in (boxes, more))
    rows = np.concatenate([*next(over_y), dynamics, contacts, *next(over_y)])
    return QuadraticProgram(2.0 * matrix.T @ matrix, -2.0 * matrix.T @ target, rows, lower, upper)


def read_qp(program: MathematicalProgram) -> QuadraticProgram:
    """A program's quadratic costs and linear constraints as matrices over all of its variables, in their order.

    Bounds come first, then linear equalities and inequalities, each kind in the order of the program.
    """
    source: Any = program
    size = source.num_vars()
    hessian, gradient = np.zeros((size, size)), np.zeros(size)
    for binding in source.quadratic_costs():
        places = source.FindDecisionVariableIndices(binding.variables())
        hessian[np.ix_(places, places)] += binding.evaluator().Q()
        gradient[places] += binding.evaluator().b()
    for binding in source.linear_costs():
        gradient[source.FindDecisionVariableIndices(binding.variables())] += binding.evaluator().a()
    bindings = (
        *source.bounding_box_constraints(),
        *source.linear_equality_constraints(),
        *source.linear_constraints(),
    )
    rows, lower, upper = [np.zeros((0, size))], [np.zeros(0)], [np.zeros(0)]
    for binding in bindings:
        places, evaluator = source.FindDecisionVariableIndices(binding.variables()), binding.evaluator()
        matrix = np.zeros((evaluator.num_constraints(), size))
        matrix[:, places] = evaluator.GetDenseA()
        rows.append(matrix)
        lower.append(evaluator.lower_bound())
        upper.append(evaluator.upper_bound())
    whole = np.concatenate(rows)
    boxes = sum(binding.evaluator().num_constraints() for binding in source.bounding_box_constraints())
    leading = boxes if np.array_equal(whole[:boxes], np.eye(boxes, size)) else 0
    return QuadraticProgram(hessian, gradient, whole, np.concatenate(lower), np.concatenate(upper), leading)


def _name(binding: Any, name: str) -> None:
    binding.evaluator().set_description(name)


def _add_cost(program: Any, name: str, cost: LeastSquares, variables: Any) -> None:
    _name(program.Add2NormSquaredCost(cost.matrix, cost.target, variables), name)


def _sizes(terms: Terms) -> tuple[int, int, int]:
    return terms.bias.size, terms.contact_bias.size, terms.actuated.size


def _over_y(parts: Parts, sizes: tuple[int, int, int]) -> FloatArray:
    pieces = (parts.vdot, parts.force, parts.torque)
    rows = next(piece.shape[0] for piece in pieces if piece is not None)
    return np.concatenate(
        [np.zeros((rows, size)) if piece is None else piece for piece, size in zip(pieces, sizes, strict=True)], axis=1
    )


def _weighted(task: TaskRows, sizes: tuple[int, int, int]) -> LeastSquares:
    return LeastSquares(task.weight[:, None] * _over_y(task.matrix, sizes), task.weight * task.target)


def _equalities(
    terms: Terms, contact_acceleration: FloatArray | None
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Rows over y of the dynamics (nv) and of the contacts (k), and their right sides."""
    nv, k, n = _sizes(terms)
    dynamics = np.zeros((nv, nv + k + n))
    dynamics[:, :nv] = terms.mass_matrix
    dynamics[:, nv : nv + k] = -terms.contact_jacobian.T
    dynamics[terms.actuated, nv + k + np.arange(n)] = -1.0
    contacts = np.zeros((k, nv + k + n))
    contacts[:, :nv] = terms.contact_jacobian
    drift = -terms.contact_bias if contact_acceleration is None else contact_acceleration - terms.contact_bias
    return dynamics, contacts, -terms.bias, drift
