"""Ways of the signals: along channels beside the columns and corridors between the rows, where no block stands.

Row r has the channels (r, 0) … (r, columns); corridor k runs above row k, the last one below the last row. A way is a
list of nodes: a pin, or the crossing of a channel with a corridor. All ways of one signal make a tree.
"""

import heapq
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

from drake_tc.report.block_graph.columns import Row
from drake_tc.report.block_graph.view import Net

TURN = 24.0
"""A turn costs as much as this way [px]."""
PASS_A_ROW = 40.0
OVER_THE_TOP = 160.0
"""Feedback returns below where it can."""


@dataclass(frozen=True, order=True)
class PinNode:
    """A pin at a channel: its height in the row [px], and on which side of the channel its block is (-1: left)."""

    row: int
    channel: int
    block: int
    side: str
    index: int
    height: float
    hand: int


@dataclass(frozen=True, order=True)
class Crossing:
    """Where channel (row, channel) meets a corridor."""

    corridor: int
    row: int
    channel: int


Node: TypeAlias = PinNode | Crossing


@dataclass(frozen=True)
class Ground:
    """Where ways may run: rows, heights and channels' middles by (row, channel) [px], pins by (block, side, index)."""

    rows: Sequence[Row]
    heights: Sequence[float]
    middles: Mapping[tuple[int, int], float]
    pins: Mapping[tuple[int, str, int], PinNode]


def route(net: Net, ground: Ground) -> list[list[Node]]:
    """The way from the net's source pin to each of its targets, in their order."""
    source = ground.pins[(net.source[0], "o", net.source[1])]
    targets = [ground.pins[(key, "i", index)] for key, index in net.targets]
    near = sorted(targets, key=lambda t: (_distance(source, t, ground), t))
    parent: dict[Node, Node | None] = {source: None}
    for target in near:
        found = _shortest(parent, target, ground, [source, *targets])
        for node, before in found:
            parent.setdefault(node, before)
    ways = []
    for target in targets:
        way: list[Node] = [target]
        while (before := parent[way[-1]]) is not None:
            way.append(before)
        ways.append(way[::-1])
    return ways


def _distance(a: PinNode, b: PinNode, ground: Ground) -> float:
    across = abs(ground.middles[a.row, a.channel] - ground.middles[b.row, b.channel])
    return across + 300.0 * abs(a.row - b.row) + abs(a.height - b.height)


def _shortest(
    tree: Mapping[Node, Node | None], target: PinNode, ground: Ground, pins: Sequence[PinNode]
) -> list[tuple[Node, Node | None]]:
    """(node, its predecessor) on the shortest way from the tree to the target (Dijkstra)."""
    best: dict[Node, float] = dict.fromkeys(tree, 0.0)
    before: dict[Node, Node | None] = {}
    count = 0
    queue: list[tuple[float, int, Node]] = []
    for node in tree:
        queue.append((0.0, count, node))
        count += 1
    heapq.heapify(queue)
    while queue:
        length, _, node = heapq.heappop(queue)
        if node == target:
            break
        if length > best[node]:
            continue
        for other, step in _steps(node, ground, pins, target):
            if length + step < best.get(other, float("inf")) - 1e-9:
                best[other] = length + step
                before[other] = node
                heapq.heappush(queue, (length + step, count, other))
                count += 1
    way: list[tuple[Node, Node | None]] = []
    at: Node = target
    while at not in tree:
        previous = before[at]
        way.append((at, previous))
        if previous is None:
            break
        at = previous
    return way[::-1]


def _steps(node: Node, ground: Ground, pins: Sequence[PinNode], target: PinNode) -> Iterator[tuple[Node, float]]:
    if isinstance(node, PinNode):
        height = ground.heights[node.row]
        top = TURN + (OVER_THE_TOP if node.row == 0 else 0.0)
        yield Crossing(node.row, node.row, node.channel), node.height + top
        yield Crossing(node.row + 1, node.row, node.channel), height - node.height + TURN
        if (target.row, target.channel) == (node.row, node.channel):
            yield target, abs(node.height - target.height)
        return
    yield from _along(node, ground)
    height = ground.heights[node.row]
    other = 2 * node.row + 1 - node.corridor
    yield Crossing(other, node.row, node.channel), height + PASS_A_ROW
    if (target.row, target.channel) == (node.row, node.channel):
        yield target, TURN + (target.height if node.corridor == node.row else height - target.height)


def _along(node: Crossing, ground: Ground) -> Iterator[tuple[Node, float]]:
    """The next crossings on both sides in the same corridor."""
    rows = [row for row in (node.corridor - 1, node.corridor) if 0 <= row < len(ground.rows)]
    here = sorted(
        (ground.middles[row, channel], row, channel)
        for row in rows
        for channel in range(len(ground.rows[row].columns) + 1)
    )
    place = next(i for i, (_, row, channel) in enumerate(here) if (row, channel) == (node.row, node.channel))
    for i in (place - 1, place + 1):
        if 0 <= i < len(here):
            x, row, channel = here[i]
            yield Crossing(node.corridor, row, channel), abs(x - here[place][0]) + 0.01


def runs(way: Sequence[Node]) -> list[tuple[str, int, int]]:
    """A way as alternating runs: ("v", row, channel) along a channel and ("h", corridor, 0) along a corridor."""
    found: list[tuple[str, int, int]] = []
    for a, b in pairwise(way):
        if isinstance(a, Crossing) and isinstance(b, Crossing) and a.corridor == b.corridor:
            run = ("h", a.corridor, 0)
        else:
            run = ("v", a.row, a.channel)
        if not found or found[-1] != run:
            found.append(run)
    return found
