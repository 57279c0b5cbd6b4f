"""Puts parallel lines side by side in a channel: an order with few crossings and no two lines on each other."""

from collections.abc import Sequence
from dataclasses import dataclass

NEAR = 4.0
"""Two branches closer than this would be read as one line [px]."""
CONFLICT = 30
PASSES = 6


@dataclass(frozen=True)
class Line:
    """What runs along a channel: an extent and its branches (where, and to which side: -1 lower tracks, 1 higher)."""

    key: int
    low: float
    high: float
    branches: tuple[tuple[float, int], ...]


def tracks(lines: Sequence[Line]) -> tuple[dict[int, int], int]:
    """A track from 0 for every line, by its key, and how many tracks there are.

    Branches run straight to their side of the channel, so a line that stands between is crossed. Lines are ordered by
    sifting each to its best place; those that do not meet share tracks where the order of the others allows.
    """
    count = len(lines)
    cost = [[_cost(lines[i], lines[j]) if i != j else 0 for j in range(count)] for i in range(count)]
    order = sorted(range(count), key=lambda i: (_lean(lines[i]), lines[i].low, lines[i].key))
    for _ in range(PASSES):
        before = list(order)
        for i in before:
            order.remove(i)
            order.insert(_best_place(i, order, cost), i)
        if order == before:
            break
    found: dict[int, int] = {}
    for place, i in enumerate(order):
        apart = [found[lines[j].key] + 1 for j in order[:place] if _meet(lines[i], lines[j])]
        found[lines[i].key] = max(apart, default=0)
    return found, max(found.values(), default=-1) + 1


def _lean(line: Line) -> float:
    return sum(side for _, side in line.branches) / max(len(line.branches), 1)


def _best_place(i: int, order: Sequence[int], cost: Sequence[Sequence[int]]) -> int:
    total = sum(cost[i][j] for j in order)
    best, where = total, 0
    for place, j in enumerate(order, start=1):
        total += cost[j][i] - cost[i][j]
        if total < best:
            best, where = total, place
    return where


def _meet(a: Line, b: Line) -> bool:
    return a.low - NEAR <= b.high and b.low - NEAR <= a.high


def _cost(first: Line, second: Line) -> int:
    """Crossings, and conflicts, if `first` has the lower track."""
    crossings = sum(side > 0 and second.low <= at <= second.high for at, side in first.branches)
    crossings += sum(side < 0 and first.low <= at <= first.high for at, side in second.branches)
    up = [at for at, side in first.branches if side > 0]
    down = [at for at, side in second.branches if side < 0]
    return crossings + CONFLICT * sum(abs(a - b) < NEAR for a in up for b in down)
