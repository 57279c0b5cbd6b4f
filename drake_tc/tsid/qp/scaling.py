"""Quadratic programs freed from units: a Hessian with a unit diagonal, a gradient and rows of length one."""

from dataclasses import dataclass, replace

import numpy as np

from drake_tc.tsid.qp.problem import Outcome, QpSolution, QuadraticProgram
from drake_tc.types import FloatArray


@dataclass(frozen=True, eq=False)
class Scaled:
    """The same problem over z, x = unit z.

    Attributes:
        problem: Over z.
        unit: (n,) of the variables.
        row_unit: (m,) of the rows.
        cost_unit: Of the cost.
    """

    problem: QuadraticProgram
    unit: FloatArray
    row_unit: FloatArray
    cost_unit: float

    def there(self, start: QpSolution | None) -> QpSolution | None:
        """A start, over z; None where its numbers are none there."""
        if start is None:
            return None
        x, multipliers = start.x / self.unit, start.multipliers * (self.row_unit / self.cost_unit)
        if not (np.isfinite(x).all() and np.isfinite(multipliers).all()):
            return None
        return replace(start, x=x, multipliers=multipliers)

    def back(self, found: QpSolution) -> QpSolution:
        """A solution, over x; what a method that iterates leaves as push from a side that is not there is taken off."""
        if found.outcome is not Outcome.SOLVED:
            return found
        multipliers = found.multipliers * (self.cost_unit / self.row_unit)
        over = self.problem
        multipliers[(multipliers > 0.0) & (over.upper == np.inf) | (multipliers < 0.0) & (over.lower == -np.inf)] = 0.0
        return replace(found, x=found.x * self.unit, multipliers=multipliers)


def scaled(problem: QuadraticProgram) -> Scaled:
    """Scale a problem: unit_i = size / sqrt(H_ii), size = max |c_i| / sqrt(H_ii); the cost over size^2."""
    diagonal = problem.hessian.diagonal()
    root = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    size = float(np.abs(problem.gradient * root).max(initial=0.0)) or 1.0
    unit = size * root
    matrix = problem.matrix * unit
    row_unit = np.sqrt(np.einsum("ij,ij->i", matrix, matrix))
    row_unit[row_unit == 0.0] = 1.0
    row_unit[: problem.bounds] = unit[: problem.bounds]
    over = QuadraticProgram(
        problem.hessian * root * root[:, None],
        problem.gradient * (root / size),
        matrix / row_unit[:, None],
        problem.lower / row_unit,
        problem.upper / row_unit,
        problem.bounds,
    )
    return Scaled(over, unit, row_unit, size * size)
