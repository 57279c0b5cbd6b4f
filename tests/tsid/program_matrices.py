"""The full program as matrices, read back from Drake and written by hand, and the reduced one's."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.solvers import MathematicalProgram

from drake_tc.tsid.assembly import is_bounds, ordered
from drake_tc.tsid.program_solver import equalities, over_y, sizes_of, weighted
from drake_tc.tsid.qp import QuadraticProgram
from drake_tc.tsid.rows import LimitRows, TaskRows, Terms
from drake_tc.types import FloatArray


def full_qp(
    terms: Terms, tasks: Sequence[TaskRows], limits: Sequence[LimitRows], contact_acceleration: FloatArray | None = None
) -> QuadraticProgram:
    """The full problem's matrices, those of `build_full`: rows of bounds, then of equalities, then all others."""
    sizes = sizes_of(terms)
    dynamics, contacts, right, drift = equalities(terms, contact_acceleration)
    pieces = [weighted(task, sizes) for task in tasks]
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
    written = ([over_y(rows.matrix, sizes) for rows in some] for some in (boxes, more))
    rows = np.concatenate([*next(written), dynamics, contacts, *next(written)])
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
    bindings = (*source.bounding_box_constraints(), *source.linear_equality_constraints(), *source.linear_constraints())
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


def reduced_qp(reduced):
    """||D x - d||^2 on a polytope as 1/2 x^T H x + c^T x: H = 2 D^T D, c = -2 D^T d; the constant d^T d is left out."""
    cost, polytope = reduced.cost, reduced.polytope
    double, sides = 2.0 * cost.matrix.T, (polytope.lower, polytope.upper)
    return QuadraticProgram(double.dot(cost.matrix), -double.dot(cost.target), polytope.matrix, *sides, polytope.bounds)
