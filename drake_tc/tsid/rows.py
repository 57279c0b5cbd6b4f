"""Named rows over y = (vdot, f, tau): what tasks and limits hand to the program.

The reduced problem over the joint torques alone: a least-squares cost on a polytope.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from drake_tc.types import FloatArray, IntArray


@cache
def identity(n: int) -> FloatArray:
    """(n, n), read-only and the same object each time, so that rows which are bounds are known at no cost."""
    matrix = np.eye(n)
    matrix.setflags(write=False)
    return matrix


def _keep_plain(rows: Any, *names: str) -> None:
    """Arrays as compiled functions take them: C-contiguous, of doubles."""
    for name in names:
        values = getattr(rows, name)
        if isinstance(values, np.ndarray) and not (values.flags.c_contiguous and values.dtype == np.float64):
            object.__setattr__(rows, name, np.ascontiguousarray(values, dtype=np.float64))


@dataclass(frozen=True, eq=False)
class Parts:
    """A matrix over y by its parts; a part that is None is zero. Each is kept C-contiguous, of doubles.

    Attributes:
        vdot: (r, nv).
        force: (r, k), k over all contacts that are active.
        torque: (r, n), joints in the robot's order.
        picks: (r,) where vdot is rows of the identity, which, so that a product with it is a lookup.
    """

    vdot: FloatArray | None = None
    force: FloatArray | None = None
    torque: FloatArray | None = None
    picks: IntArray | None = None

    def __post_init__(self) -> None:
        _keep_plain(self, "vdot", "force", "torque")


def selection(index: IntArray, velocities: int) -> Parts:
    """Rows of the identity over vdot: the accelerations at `index`, and nothing else."""
    matrix = np.zeros((index.size, velocities))
    matrix[np.arange(index.size), index] = 1.0
    matrix.setflags(write=False)
    return Parts(vdot=matrix, picks=index)


@dataclass(frozen=True, eq=False)
class TaskRows:
    """sum over rows of (weight (A y - a))^2.

    Attributes:
        name: Of the task.
        matrix: A.
        target: (r,) a.
        weight: (r,) multiplies the rows, so it is squared in the cost (the paper's w_post, w_f).
    """

    name: str
    matrix: Parts
    target: FloatArray
    weight: FloatArray

    def __post_init__(self) -> None:
        _keep_plain(self, "target", "weight")


@dataclass(frozen=True, eq=False)
class LimitRows:
    """lower <= B y <= upper; infinite where a side has no limit.

    Attributes:
        name: Of the limit; the binding of the program has it too.
        group: One of "force", "torque", "acceleration", "capture_point": probabilities are given by group.
        matrix: B.
        lower, upper: (r,).
        labels: (r,) of each row, for people: "r_knee", "left_foot friction +x".
        relaxed: For how many rows a limit had to give way, as limits contradict each other at this state.
    """

    name: str
    group: str
    matrix: Parts
    lower: FloatArray
    upper: FloatArray
    labels: tuple[str, ...]
    relaxed: int = 0

    def __post_init__(self) -> None:
        _keep_plain(self, "lower", "upper")


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
