"""p_box: the largest box tau +- s sigma inside the polytope, by a quadratic program.

Source: Del Prete and Mansard, 2015, eq. 17.
"""

import math

import numpy as np
from scipy.special import erfcinv

from drake_tc.tsid.polytope import LeastSquares, Polytope
from drake_tc.tsid.robust.objective import nothing
from drake_tc.tsid.robust.scaled import FEASIBLE, Rows, ScaledProblem, scaled
from drake_tc.tsid.robust.torque_error import TorqueError
from drake_tc.types import FloatArray, IntArray

_HALF = math.sqrt(0.5)


class BoxRows:
    """Rows over (x, s): A x + |G L| 1 s <= upper, -A x + |G L| 1 s <= -lower, -s <= 0: 2 m + 1, upper sides only.

    For a diagonal Sigma |G L| 1 = |G| sigma, over sigma_G; s >= 0 keeps tau itself inside. Where no side errs every box
    fits, so there is no largest: the rows -s <= -1, s <= 1 hold s then, 2 m + 2 in all, and the cost alone chooses x.

    Attributes:
        lower: None.
        upper: (2 m + 1,) or (2 m + 2,).
    """

    lower = None

    def __init__(self, limits: Rows, noise: FloatArray) -> None:
        m, n = limits.matrix.shape
        reach = np.abs(noise).dot(np.ones(noise.shape[1]))
        ends = (0.0,) if _some_side_errs(limits, reach) else (-1.0, 1.0)
        self._sides = 2 * m
        self._matrix = matrix = np.empty((2 * m + len(ends), n + 1))
        matrix[:m, :n] = limits.matrix
        np.negative(limits.matrix, out=matrix[m : 2 * m, :n])
        matrix[:m, n] = matrix[m : 2 * m, n] = reach
        matrix[2 * m :, :n] = 0.0
        matrix[2 * m :, n] = (-1.0, 1.0)[: len(ends)]
        self.upper: FloatArray = np.concatenate((limits.upper, -limits.lower, ends))

    def times(self, x: FloatArray) -> FloatArray:
        """See `RowProduct`."""
        value: FloatArray = self._matrix.dot(x)
        return value

    def take(self, rows: IntArray) -> FloatArray:
        """See `RowProduct`."""
        return self._matrix[rows]

    def dense(self) -> Rows:
        """See `RowProduct`."""
        return Rows(self._matrix, np.full(len(self.upper), -np.inf), self.upper)

    def size(self, x: FloatArray) -> float:
        """The largest s for x (n,) inside, where every row errs."""
        sides = self._matrix[: self._sides]
        room = self.upper[: self._sides] - sides[:, :-1] @ x
        return float((room / sides[:, -1]).min(initial=math.inf))


def _some_side_errs(limits: Rows, reach: FloatArray) -> bool:
    """Whether a row that errs has a side; the first row tells as a rule."""
    if len(reach) and reach[0] > 0.0 and limits.upper[0] < math.inf:
        return True
    return bool(((reach > 0.0) & ((limits.upper < math.inf) | (limits.lower > -math.inf))).any())


def box_size(problem: ScaledProblem, x: FloatArray) -> float:
    """Largest s with x +- s inside; negative where x is outside, -inf where a row that does not err is missed."""
    limits, reach = problem.limits, np.abs(problem.noise).sum(axis=1)
    value = limits.matrix @ x
    slack = np.minimum(limits.upper - value, value - limits.lower)
    if problem.certain is not None:
        if slack[problem.certain].min() < -FEASIBLE:
            return -math.inf
        slack, reach = slack[~problem.certain], reach[~problem.certain]
    return float((slack / reach).min(initial=math.inf))


def box_risk(size: float, axes: int) -> float:
    """R_box = -log p_box of a box of half width `size` sigmas in `axes` independent directions; inf for none."""
    if axes == 0:
        return 0.0 if size > -math.inf else math.inf
    if size <= 0.0:
        return math.inf
    return -axes * (math.log(math.erf(_HALF * size)) if size < 1.0 else math.log1p(-math.erfc(_HALF * size)))


def size_of_risk(risk: float, axes: int) -> float:
    """The half width whose R_box is `risk`; inverse of `box_risk`."""
    return math.sqrt(2.0) * float(erfcinv(-math.expm1(-risk / max(axes, 1))))


def p_box(polytope: Polytope, torque: FloatArray, error: TorqueError) -> float:
    """Probability that the error stays in the largest box |zeta_i| <= s around the torque: a lower bound of p.

    e = L zeta as in `TorqueError`; with a diagonal Sigma the box is |e_i| <= s sigma_i. 0 outside the polytope.
    """
    problem = scaled(nothing(error.joints), polytope, error)
    return math.exp(-box_risk(box_size(problem, torque / problem.scale), error.root.shape[1]))


def with_size(cost: LeastSquares) -> LeastSquares:
    """The cost over (x, s), which s does not enter."""
    rows, n = cost.matrix.shape
    matrix = np.zeros((rows, n + 1))
    matrix[:, :n] = cost.matrix
    return LeastSquares(matrix, cost.target)
