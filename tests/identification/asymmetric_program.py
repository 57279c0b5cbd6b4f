"""The asymmetric fit as the quadratic program of Del Prete et al. (2016), eq. 9: the oracle of the Newton method."""

from typing import Any

import numpy as np
from pydrake.solvers import ClarabelSolver, MathematicalProgram

from drake_tc.errors import IdentificationError
from drake_tc.identification.regression import checked, column_scale
from drake_tc.types import FloatArray

_BLOCK = 100


def asymmetric_by_program(columns: FloatArray, target: FloatArray, weight: float = 100.0) -> FloatArray:
    """The same minimum as a quadratic program, for up to some thousand samples: x (p,).

        min_{x, y_p, y_n} w ‖y_p‖² + ‖y_n‖²   s.t.  S (A x − b) = y_p − y_n,  y_p >= 0,  y_n >= 0

    Solved by Clarabel through MathematicalProgram, columns and target scaled to size one.

    Raises:
        IdentificationError: As `asymmetric_least_squares`, or a solver that does not succeed.

    Source: Del Prete et al., 2016, eq. 9; the paper's formulation, whose solvers failed beyond 10⁴ samples.
    """
    a, b, labels = checked(columns, target, None)
    moving = b != 0
    a, b = a[moving], b[moving]
    samples, p = a.shape
    unit = float(np.sqrt(np.mean(b**2))) if samples else 1.0
    scale = column_scale(a, labels) / np.sqrt(max(samples, 1))
    sign = np.sign(b)
    program = MathematicalProgram()
    x = program.NewContinuousVariables(p, "x")
    over = program.NewContinuousVariables(samples, "y_p")
    under = program.NewContinuousVariables(samples, "y_n")
    equality = np.hstack([sign[:, None] * a / scale, -np.eye(samples), np.eye(samples)])
    program.AddLinearEqualityConstraint(equality, sign * b / unit, np.concatenate([x, over, under]))
    for slack, cost in ((over, weight), (under, 1.0)):
        program.AddBoundingBoxConstraint(0.0, np.inf, slack)
        for first in range(0, samples, _BLOCK):
            block = slack[first : first + _BLOCK]
            # AddQuadraticCost takes 1/2 vᵀ Q v; the mean keeps the cost near one
            hessian: Any = 2 * cost / samples * np.eye(block.size)
            nothing: Any = np.zeros(block.size)
            program.AddQuadraticCost(hessian, nothing, block)
    result = ClarabelSolver().Solve(program)
    if not result.is_success():
        raise IdentificationError(
            f"asymmetric QP of {samples} samples: solver stopped with {result.get_solution_result()}"
        )
    return np.asarray(np.asarray(result.GetSolution(x), dtype=np.float64) * unit / scale)
