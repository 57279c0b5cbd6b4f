"""What a worker of a sweep does: points one after another, each with its own seed, on one thread of linear algebra."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

Function = Callable[[Any, int], Any]
"""Of a point and its seed."""
LONGEST_POINT = 120
"""Characters of a point in a message."""


@dataclass(frozen=True)
class FailedPoint:
    """A point that has no result.

    Attributes:
        index: Where it stands among the points.
        point: Itself, as text.
        why: The exception, or that its process died; one line.
    """

    index: int
    point: str
    why: str

    def __str__(self) -> str:
        return f"point {self.index} ({self.point}): {self.why}"


def point_seed(seed: int, index: int) -> int:
    """The point's own seed, below 2^63: of child `index` of numpy's `SeedSequence(seed)`, whoever computes it."""
    child = np.random.SeedSequence(seed, spawn_key=(index,))
    return int(child.generate_state(1, np.uint64)[0] >> np.uint64(1))


def failed(index: int, point: object, why: str) -> FailedPoint:
    """A failed point, its texts cut down to one line."""
    text = " ".join(repr(point).split())
    short = text if len(text) <= LONGEST_POINT else f"{text[: LONGEST_POINT - 3]}..."
    return FailedPoint(index, short, " ".join(why.split()))


def run_points(function: Function, points: Sequence[tuple[int, Any]], seed: int, caller: int) -> list[Any]:
    """The results of some (index, point); a FailedPoint where the function raises.

    Linear algebra on several threads sums in another order: outside the process `caller`, where `sweep` itself sees
    to that, it is held to one from here on.
    """
    if os.getpid() != caller:
        threadpool_limits(1)
    out: list[Any] = []
    for index, point in points:
        try:
            out.append(function(point, point_seed(seed, index)))
        except Exception as error:
            out.append(failed(index, point, f"{type(error).__name__}: {error}"))
    return out
