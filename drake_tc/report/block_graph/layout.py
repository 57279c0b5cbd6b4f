"""The whole layout: blocks in rows and columns, signals in channels and corridors, and where every text stands.

Row r has the channels (r, 0) … (r, columns); corridor k runs above row k, the last one below the last row. A way is a
list of nodes: a pin, or the crossing of a channel with a corridor. All ways of one signal make a tree. Parallel lines
lie side by side on tracks of a channel, in an order with few crossings and no two lines on each other.
"""

import heapq
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeAlias

from drake_tc.report.block_graph.place import GAP, Box, Frame, Row, arrange, frame_of, heights_in_row, measure
from drake_tc.report.block_graph.view import Net, Pin, View

TURN = 24.0
"""A turn costs as much as this way [px]."""
PASS_A_ROW = 40.0
OVER_THE_TOP = 160.0
"""Feedback returns below where it can."""
NEAR = 4.0
"""Two branches closer than this would be read as one line [px]."""
CONFLICT = 30
SIFTING_PASSES = 6
FAR = 1e6
"""Level of a corridor seen from a row."""
Point: TypeAlias = tuple[float, float]


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
    lean = [sum(side for _, side in line.branches) / max(len(line.branches), 1) for line in lines]
    order = sorted(range(count), key=lambda i: (lean[i], lines[i].low, lines[i].key))
    for _ in range(SIFTING_PASSES):
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


HEAD, FOOT = 30.0, 14.0
"""Of a row above and below its blocks [px]."""
CORRIDOR = 12.0
"""Of a corridor above and below its lines [px]."""
PASSES = 4


@dataclass(frozen=True)
class Wire:
    """One signal as drawn: a polyline to each target, points where it branches, the pin it starts from."""

    net: Net
    lines: tuple[tuple[tuple[float, float], ...], ...]
    start: tuple[float, float]
    direction: int


@dataclass(frozen=True)
class ShaftEffect:
    """A block as drawn: its box and top left corner [px]."""

    box: Box
    x: float
    y: float
    width: float
    flow: int


@dataclass(frozen=True)
class Region:
    """The ground of one stage: x, y, width, height [px]."""

    stage: str
    x: float
    y: float
    width: float
    height: float


@dataclass(frozen=True)
class Drawing:
    """All that is drawn, in pixels from the top left corner."""

    title: str
    width: float
    height: float
    blocks: tuple[ShaftEffect, ...]
    wires: tuple[Wire, ...]
    regions: tuple[Region, ...]


def layout(picture: View) -> Drawing:
    """Lay a picture out; the same picture gives the same drawing."""
    rows = arrange(picture)
    pins = {s.key: (list(s.inputs), list(s.outputs)) for s in picture.shapes}
    counts: Mapping[tuple[int, int], int] = {}
    for attempt in range(PASSES):
        boxes, tops, ground = _ground(picture, rows, pins, counts)
        found = ways_of(picture, ground)
        counts = found.counts
        if attempt < PASSES - 2:
            pins = _sorted_pins(picture, pins, found)
    frame = frame_of(picture, rows, boxes, counts)
    return _draw(picture, ground, {key: (box, tops[key]) for key, box in boxes.items()}, found, frame)


def _ground(
    picture: View,
    rows: Sequence[Row],
    pins: Mapping[int, tuple[list[Pin], list[Pin]]],
    counts: Mapping[tuple[int, int], int],
) -> tuple[dict[int, Box], dict[int, float], Ground]:
    boxes: dict[int, Box] = {}
    tops: dict[int, float] = {}
    heights: list[float] = []
    nodes: dict[tuple[int, str, int], PinNode] = {}
    for r, row in enumerate(rows):
        keys = [key for column in row.columns for key in column]
        boxes |= {key: measure(picture.shapes[key], *pins[key], row.flow) for key in keys}
        tops |= heights_in_row(row, boxes, picture)
        heights.append(max(tops[key] + boxes[key].height for key in keys))
        for c, column in enumerate(row.columns):
            for key in column:
                for (side, index), height in boxes[key].heights.items():
                    right = (side == "o") == (row.flow > 0)
                    at, hand = (c + 1, -1) if right else (c, 1)
                    nodes[key, side, index] = PinNode(r, at, key, side, index, tops[key] + height, hand)
    frame = frame_of(picture, rows, boxes, counts)
    middles = {key: x + 0.5 * GAP * counts.get(key, 0) for key, x in frame.tracks.items()}
    return boxes, tops, Ground(rows, heights, middles, nodes)


def _sorted_pins(
    picture: View, pins: Mapping[int, tuple[list[Pin], list[Pin]]], found: Ways
) -> dict[int, tuple[list[Pin], list[Pin]]]:
    """Pins from top to bottom as their signals leave: up, level, down."""
    ends: dict[tuple[int, str, int], list[float]] = {}
    for net_ways in found.ways:
        for way in net_ways:
            for pin, other in ((way[0], way[1]), (way[-1], way[-2])):
                if isinstance(pin, PinNode):
                    level = level_of(other) if isinstance(other, PinNode) else pin.height + 0.01 * level_of(other)
                    ends.setdefault((pin.block, pin.side, pin.index), []).append(level)

    def order(key: int, side: str, listed: list[Pin]) -> list[Pin]:
        level = {p.index: sum(e) / len(e) for p in listed if (e := ends.get((key, side, p.index)))}
        return sorted(listed, key=lambda p: (p.index not in level, level.get(p.index, 0.0), p.index))

    return {key: (order(key, "i", sides[0]), order(key, "o", sides[1])) for key, sides in pins.items()}


def _draw(
    picture: View,
    ground: Ground,
    boxes: Mapping[int, tuple[Box, float]],
    found: Ways,
    frame: Frame,
) -> Drawing:
    """Boxes have their tops in the row."""
    track_x = {
        (channel, n): frame.tracks[channel] + GAP * (track + 0.5)
        for channel, by_net in found.tracks.items()
        for n, track in by_net.items()
    }
    corridors = corridor_tracks(found, track_x, len(ground.rows))
    y, row_tops, corridor_tops = 0.0, [], []
    for k in range(len(ground.rows) + 1):
        corridor_tops.append(y + CORRIDOR)
        y += 2.0 * CORRIDOR + GAP * corridors[k][1]
        if k < len(ground.rows):
            row_tops.append(y + HEAD)
            y += HEAD + ground.heights[k] + FOOT
    track_y = {(k, n): corridor_tops[k] + GAP * (t + 0.5) for k, (by, _) in corridors.items() for n, t in by.items()}
    blocks: list[ShaftEffect] = []
    regions: list[Region] = []
    for r, row in enumerate(ground.rows):
        for c, column in enumerate(row.columns):
            spot = frame.lefts[r, c], frame.widths[r, c]
            blocks += [
                ShaftEffect(box, spot[0], row_tops[r] + top, spot[1], row.flow)
                for box, top in (boxes[k] for k in column)
            ]
            top, high = row_tops[r] - HEAD, HEAD + ground.heights[r] + FOOT
            last = regions[-1] if regions else None
            if last is not None and c > 0 and last.stage == row.stages[c]:
                regions[-1] = replace(last, width=sum(spot) + 10.0 - last.x)
            else:
                regions.append(Region(row.stages[c], spot[0] - 10.0, top, spot[1] + 20.0, high))
    edges = {p.box.shape.key: (p.x, p.x + p.width) for p in blocks}

    def at(pin: PinNode) -> tuple[float, float]:
        return edges[pin.block][1 if pin.hand < 0 else 0], row_tops[pin.row] + pin.height

    wires = []
    for n, (net, ways) in enumerate(zip(picture.nets, found.ways, strict=True)):
        xs = {channel: x for (channel, m), x in track_x.items() if m == n}
        ys = {corridor: y for (corridor, m), y in track_y.items() if m == n}
        source = ground.pins[net.source[0], "o", net.source[1]]
        ends = [(at(source), at(ground.pins[key, "i", index])) for key, index in net.targets]
        lines = tuple(polyline(way, pair, xs, ys) for way, pair in zip(ways, ends, strict=True))
        wires.append(Wire(net, lines, at(source), ground.rows[source.row].flow))
    order = sorted(blocks, key=lambda p: p.box.shape.key)
    return Drawing(picture.title, frame.width, y, tuple(order), tuple(wires), tuple(regions))
