"""R_ind = -log p_ind: every side of every row by itself; see `drake_tc.kernels.programs`.

Source: Del Prete and Mansard, 2015, eq. 7 and 13.
"""

from drake_tc.kernels.lazy import Kernel
from drake_tc.tsid.polytope import Polytope
from drake_tc.tsid.robust.scaled import FEASIBLE, Rows, nothing, scaled
from drake_tc.tsid.robust.torque_error import TorqueError
from drake_tc.types import FloatArray, IntArray

_EVALUATED = Kernel("scaling", "evaluated")


def p_ind(polytope: Polytope, torque: FloatArray, error: TorqueError) -> float:
    """Product of the probabilities of the single sides (eq. 7); 0 where a row that does not err is violated.

    Exact where no row has two sides and the rows are orthogonal in the metric of Sigma.
    """
    problem = scaled(nothing(error.joints), polytope, error)
    limits, cost = problem.limits, problem.cost
    rows = limits.matrix, limits.lower, limits.upper, problem.certain
    return float(_EVALUATED(torque / problem.scale, problem.scale, *rows, cost.matrix, cost.target)[2])


def certain_miss(rows: Rows, certain: IntArray, x: FloatArray, tolerance: float = FEASIBLE) -> bool:
    """Whether a row that does not err (1 in certain) is missed at x."""
    if not certain.any():
        return False
    sure = certain > 0
    return Rows(rows.matrix[sure], rows.lower[sure], rows.upper[sure]).miss(x) > tolerance
