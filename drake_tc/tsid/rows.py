"""Named rows over y = (vdot, f, tau): what tasks and limits hand to the program."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from drake_tc.estimation.torque_model import as_slice
from drake_tc.types import FloatArray, IntArray


@cache
def identity(n: int) -> FloatArray:
    """(n, n), read-only and the same object each time, so that rows which are bounds are known at no cost."""
    matrix = np.eye(n)
    matrix.setflags(write=False)
    return matrix


@dataclass(frozen=True, eq=False)
class Parts:
    """A matrix over y by its parts; a part that is None is zero.

    Attributes:
        vdot: (r, nv).
        force: (r, k), k over all contacts that are active.
        torque: (r, n), joints in the robot's order.
        picks: Where vdot is rows of the identity, which: an index or a slice, so that a product with it is a lookup.
    """

    vdot: FloatArray | None = None
    force: FloatArray | None = None
    torque: FloatArray | None = None
    picks: Any = None


def selection(index: IntArray, velocities: int) -> Parts:
    """Rows of the identity over vdot: the accelerations at `index`, and nothing else."""
    matrix = np.zeros((index.size, velocities))
    matrix[np.arange(index.size), index] = 1.0
    matrix.setflags(write=False)
    return Parts(vdot=matrix, picks=as_slice(index))


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
