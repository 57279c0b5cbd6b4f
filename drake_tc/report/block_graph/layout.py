"""The whole layout: blocks in rows and columns, signals in channels and corridors, and where every text stands."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from drake_tc.report.block_graph.columns import Row, arrange
from drake_tc.report.block_graph.place import GAP, Box, Frame, frame_of, heights_in_row, measure
from drake_tc.report.block_graph.route import Ground, PinNode, Ways, corridor_tracks, level_of, polyline, ways_of
from drake_tc.report.block_graph.view import Net, Pin, View

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
    return _draw(picture, ground, boxes, tops, found, frame)


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
    boxes: Mapping[int, Box],
    tops: Mapping[int, float],
    found: Ways,
    frame: Frame,
) -> Drawing:
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
            blocks += [ShaftEffect(boxes[k], spot[0], row_tops[r] + tops[k], spot[1], row.flow) for k in column]
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
