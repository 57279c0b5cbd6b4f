"""The ways of all signals, the tracks they take in channels and corridors, and the polylines that are drawn.

Puts parallel lines side by side in a channel: an order with few crossings and no two lines on each other.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

from drake_tc.report.block_graph.route import Crossing, Ground, Node, PinNode, route, runs
from drake_tc.report.block_graph.view import View

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


FAR = 1e6
"""Level of a corridor seen from a row."""

Point: TypeAlias = tuple[float, float]


@dataclass(frozen=True)
class Ways:
    """The ways of every net, its track in each channel by (row, channel), and how many tracks each has."""

    ways: Sequence[Sequence[Sequence[Node]]]
    tracks: Mapping[tuple[int, int], Mapping[int, int]]
    counts: Mapping[tuple[int, int], int]


def ways_of(picture: View, ground: Ground) -> Ways:
    """Route every net and give it a track in each channel that it runs along."""
    ways = [route(net, ground) for net in picture.nets]
    lines: dict[tuple[int, int], list[Line]] = {}
    for n, net_ways in enumerate(ways):
        visits: dict[tuple[int, int], set[Node]] = {}
        for way in net_ways:
            for a, b in pairwise(way):
                if not (isinstance(a, Crossing) and isinstance(b, Crossing) and a.corridor == b.corridor):
                    visits.setdefault((a.row, a.channel), set()).update((a, b))
        for channel, nodes in visits.items():
            at = sorted(level_of(node) for node in nodes)
            if at[-1] - at[0] > 0.5:
                branches = sorted((node.height, node.hand) for node in nodes if isinstance(node, PinNode))
                lines.setdefault(channel, []).append(Line(n, at[0], at[-1], tuple(branches)))
    solved = {channel: tracks(found) for channel, found in sorted(lines.items())}
    return Ways(ways, {c: t for c, (t, _) in solved.items()}, {c: n for c, (_, n) in solved.items()})


def level_of(node: Node) -> float:
    """Height of a node in its row [px]; far above or below for a corridor."""
    if isinstance(node, PinNode):
        return node.height
    return -FAR if node.corridor == node.row else FAR


def corridor_tracks(
    found: Ways, track_x: Mapping[tuple[tuple[int, int], int], float], rows: int
) -> dict[int, tuple[dict[int, int], int]]:
    """Track of every net in each corridor, and how many tracks each corridor has."""
    branches: dict[int, dict[int, set[tuple[float, int]]]] = {k: {} for k in range(rows + 1)}
    for n, net_ways in enumerate(found.ways):
        for way in net_ways:
            parts = runs(way)
            for a, b in pairwise(parts):
                (_, row, channel), (_, k, _) = (a, b) if a[0] == "v" else (b, a)
                side = -1 if row < k else 1
                branches[k].setdefault(n, set()).add((track_x[(row, channel), n], side))
    solved = {}
    for k, nets in branches.items():
        lines = [Line(n, min(b)[0], max(b)[0], tuple(sorted(b))) for n, b in sorted(nets.items())]
        solved[k] = tracks(lines)
    return solved


def polyline(
    way: Sequence[Node],
    ends: tuple[Point, Point],
    track_x: Mapping[tuple[int, int], float],
    track_y: Mapping[int, float],
) -> tuple[Point, ...]:
    """A way as drawn.

    Args:
        way: From pin to pin.
        ends: Where the two pins stand [px].
        track_x: Of the net's track in each channel (row, channel) [px]; none where it runs straight through.
        track_y: Of the net's track in each corridor [px].
    """
    first, last = ends
    points = [first]
    parts = runs(way)
    for i, (kind, row, channel) in enumerate(parts):
        if kind == "h" or (row, channel) not in track_x:
            continue
        x = track_x[row, channel]
        before = track_y[parts[i - 1][1]] if i > 0 else first[1]
        after = track_y[parts[i + 1][1]] if i + 1 < len(parts) else last[1]
        points += [(x, before), (x, after)]
    return _simple([*points, last])


def _simple(points: Sequence[Point]) -> tuple[Point, ...]:
    """Without repeated points and without points in the middle of a straight line."""
    kept: list[Point] = []
    for x, y in points:
        point = (round(x, 2), round(y, 2))
        if kept and point == kept[-1]:
            continue
        if len(kept) > 1 and (kept[-2][0] == kept[-1][0] == point[0] or kept[-2][1] == kept[-1][1] == point[1]):
            kept.pop()
        kept.append(point)
    return tuple(kept)
