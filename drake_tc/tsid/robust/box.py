"""p_box: the largest box tau +- s sigma inside the polytope, by a quadratic program.

Source: Del Prete and Mansard, 2015, eq. 17.
"""

import math

from scipy.special import erfcinv

from drake_tc.kernels.lazy import Kernel
from drake_tc.tsid.polytope import LeastSquares, Polytope
from drake_tc.tsid.robust.scaled import Rows, ScaledProblem, nothing, scaled
from drake_tc.tsid.robust.torque_error import TorqueError
from drake_tc.types import FloatArray

_PROGRAM, _SIZE = Kernel("scaling", "box_program"), Kernel("scaling", "box_size")
_RISK = Kernel("scaling", "box_risk")


def box_rows(problem: ScaledProblem) -> tuple[Rows, LeastSquares]:
    """Rows over (x, s) of a box of half width s sigmas around x, and the cost, which s does not enter.

    See `drake_tc.kernels.scaling.box_program`.
    """
    limits, cost = problem.limits, problem.cost
    rows, lower, upper, priced = _PROGRAM(limits.matrix, limits.lower, limits.upper, problem.noise, cost.matrix)
    return Rows(rows, lower, upper), LeastSquares(priced, cost.target)


def box_size(problem: ScaledProblem, x: FloatArray) -> float:
    """Largest s with x +- s inside; negative where x is outside, -inf where a row that does not err is missed."""
    limits = problem.limits
    size: float = _SIZE(x, limits.matrix, limits.lower, limits.upper, problem.noise, problem.certain)
    return size


def box_risk(size: float, axes: int) -> float:
    """R_box = -log p_box of a box of half width `size` sigmas in `axes` independent directions; inf for none."""
    risk: float = _RISK(float(size), axes)
    return risk


def size_of_risk(risk: float, axes: int) -> float:
    """The half width whose R_box is `risk`; inverse of `box_risk`."""
    return math.sqrt(2.0) * float(erfcinv(-math.expm1(-risk / max(axes, 1))))


def p_box(polytope: Polytope, torque: FloatArray, error: TorqueError) -> float:
    """Probability that the error stays in the largest box |zeta_i| <= s around the torque: a lower bound of p.

    e = L zeta as in `TorqueError`; with a diagonal Sigma the box is |e_i| <= s sigma_i. 0 outside the polytope.
    """
    problem = scaled(nothing(error.joints), polytope, error)
    return math.exp(-box_risk(box_size(problem, torque / problem.scale), error.root.shape[1]))
