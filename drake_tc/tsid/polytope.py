"""The reduced problem over the joint torques alone: a least-squares cost on a polytope."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from drake_tc.types import FloatArray


class LeastSquares(NamedTuple):
    """||D tau - d||^2 (Del Prete and Mansard, 2015, eq. 11), row weights multiplied in.

    Attributes:
        matrix: (r, n) D.
        target: (r,) d.
    """

    matrix: FloatArray
    target: FloatArray

    def __call__(self, x: FloatArray) -> float:
        """The cost at x (n,)."""
        error = self.matrix @ x - self.target
        return float(error @ error)


@dataclass(frozen=True, eq=False)
class Polytope:
    """lower <= G tau <= upper; infinite where a side has no limit. Both sides of a row share its sigma.

    Attributes:
        matrix: (m, n) G.
        lower, upper: (m,).
        groups: Rows of each group of limits ("force", "torque", "acceleration", "capture_point").
        labels: (m,) of each row, for people; may be empty.
        bounds: The first `bounds` rows are those of the identity (torque limits), which solvers take for less.
    """

    matrix: FloatArray
    lower: FloatArray
    upper: FloatArray
    groups: Mapping[str, slice] = field(default_factory=dict)
    labels: tuple[str, ...] = ()
    bounds: int = 0

    def violation(self, x: FloatArray) -> float:
        """By how much the worst row is missed at x (n,), in that row's unit; negative inside."""
        value = self.matrix @ x
        return float(np.maximum(self.lower - value, value - self.upper).max(initial=-np.inf))

    def group(self, name: str) -> "Polytope":
        """The rows of one group alone."""
        rows = self.groups[name]
        return Polytope(self.matrix[rows], self.lower[rows], self.upper[rows], {}, self.labels[rows])
