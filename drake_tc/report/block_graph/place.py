"""Where the blocks of a picture stand, and how large they are.

The loop runs to the right in the first row and returns to the left in the second; logs stand below. Each stage takes as
many columns as its own chain of blocks is long. Boxes fit their texts in Helvetica, and stand so that signals between
neighbours run straight where they can; channels have room for the widths of signals and for parallel lines.
"""

import unicodedata
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil

from drake_tc.report.block_graph.view import INPUTS, OUTPUTS, Net, Pin, Shape, View

ROWS: tuple[tuple[int, tuple[str, ...]], ...] = (
    (1, (INPUTS, "reference", "control", "actuation", "plant", OUTPUTS)),
    (-1, ("sensing", "filtering", "estimation", "supervision")),
    (1, ("logging",)),
)
"""Direction of the signals (1: to the right) and stages of each row, in the order in which signals pass."""
MOST_LOG_COLUMNS = 8
"""Logs do not depend on each other: they stand side by side, below each other only where there are more."""
ORDERING_SWEEPS = 6


@dataclass(frozen=True)
class Row:
    """One row: direction of its signals, blocks by column from left to right and top to bottom, stage by column."""

    flow: int
    columns: tuple[tuple[int, ...], ...]
    stages: tuple[str, ...]


def arrange(picture: View) -> tuple[Row, ...]:
    """The rows that have blocks, from top to bottom."""
    links = [(net.source[0], target) for net in picture.nets for target, _ in net.targets if net.source[0] != target]
    rows = []
    for flow, stages in ROWS:
        columns: list[list[int]] = []
        names: list[str] = []
        for stage in stages:
            layers = _layers([s for s in picture.shapes if s.stage == stage], links)
            columns += layers
            names += [stage] * len(layers)
        if columns:
            _order(columns, links)
            rows.append(Row(flow, tuple(map(tuple, columns[::flow])), tuple(names[::flow])))
    return tuple(rows)


def _layers(shapes: Sequence[Shape], links: Sequence[tuple[int, int]]) -> list[list[int]]:
    """Blocks of one stage by the longest chain that each begins, ends last; feedback inside it is left out."""
    keys = [shape.key for shape in shapes]
    if shapes and shapes[0].stage == "logging":
        high = -(-len(keys) // MOST_LOG_COLUMNS)
        return [keys[i : i + high] for i in range(0, len(keys), high)]
    after: dict[int, list[int]] = defaultdict(list)
    for source, target in links:
        if source in keys and target in keys and target not in after[source]:
            after[source].append(target)
    chain = _without_cycles(keys, after)
    left: dict[int, int] = {}

    def longest(key: int) -> int:
        if key not in left:
            left[key] = max((longest(other) + 1 for other in chain[key]), default=0)
        return left[key]

    layers: list[list[int]] = [[] for _ in range(max(map(longest, keys), default=-1) + 1)]
    for key in keys:
        layers[-1 - left[key]].append(key)
    return layers


def _without_cycles(keys: Sequence[int], after: dict[int, list[int]]) -> dict[int, list[int]]:
    """Successors of each block, without the links that close a cycle on a walk from the sources on."""
    fed = {target for targets in after.values() for target in targets}
    chain: dict[int, list[int]] = {key: [] for key in keys}
    done: set[int] = set()
    walking: set[int] = set()

    def walk(key: int) -> None:
        walking.add(key)
        for target in after[key]:
            if target in walking:
                continue
            chain[key].append(target)
            if target not in done:
                walk(target)
        walking.discard(key)
        done.add(key)

    for key in sorted(keys, key=lambda k: (k in fed, k)):
        if key not in done:
            walk(key)
    return chain


def _order(columns: list[list[int]], links: Sequence[tuple[int, int]]) -> None:
    """Sort each column in place by the mean place of its neighbours in the row (barycentres, in sweeps)."""
    near: dict[int, list[int]] = defaultdict(list)
    for source, target in links:
        near[source].append(target)
        near[target].append(source)
    place: dict[int, float] = {}

    def settle(column: list[int]) -> None:
        for i, key in enumerate(column):
            place[key] = (i + 0.5) / len(column)

    for column in columns:
        settle(column)
    for sweep in range(ORDERING_SWEEPS):
        for column in columns if sweep % 2 == 0 else columns[::-1]:
            centre: dict[int, float] = {}
            for key in column:
                around = [place[other] for other in near[key] if other in place and other not in column]
                centre[key] = sum(around) / len(around) if around else place[key]
            column.sort(key=lambda key: (centre[key], place[key]))
            settle(column)


_GROUPS: Mapping[int, str] = {
    191: "'",
    222: "ijl",
    260: "|",
    278: " !,./:;I[\\]ft",
    333: "()-`r",
    334: "{}",
    355: '"',
    389: "*",
    469: "^",
    500: "Jckszvxy",
    556: "#$0123456789?L_abdeghnopqu",
    584: "+<=>~",
    611: "FTZ",
    667: "&ABEKPSVXY",
    722: "CDHNRUw",
    778: "GOQ",
    833: "Mm",
    889: "%",
    944: "W",
    1015: "@",
}
"""Advance widths of Helvetica [1/1000 em]."""
_WIDTHS = {character: width for width, group in _GROUPS.items() for character in group}
_BOLD = 1.08


def text_width(text: str, size: float, *, bold: bool = False) -> float:
    """Width of one line of text of a font size, in the same unit; an upper bound for letters beyond ASCII."""
    return size * (_BOLD if bold else 1.0) * sum(_width(c) for c in text) / 1000.0


def _width(character: str) -> int:
    if unicodedata.combining(character):
        return 0
    wide = unicodedata.east_asian_width(character) in ("W", "F")
    return _WIDTHS.get(character, 1000 if wide else 722)


def shortened(text: str, size: float, limit: float, *, bold: bool = False) -> str:
    """The text, its middle replaced by an ellipsis where it is wider than the limit."""
    if text_width(text, size, bold=bold) <= limit:
        return text
    keep = len(text)
    while keep > 2:
        keep -= 1
        short = f"{text[: (keep + 1) // 2]}…{text[len(text) - keep // 2 :]}"
        if text_width(short, size, bold=bold) <= limit:
            return short
    return text[:1] + "…"


TITLE, NOTE, PIN = 11.0, 9.0, 9.5
"""Font sizes [px]."""
PITCH = 17.0
"""From pin to pin [px]."""
EDGE = 9.0
"""From a block's edge to its text [px]."""
BETWEEN = 14.0
"""From the left pins' names to the right pins' [px]."""
LONGEST = 190.0
"""Longer names lose their middle [px]."""
STACK = 20.0
"""From block to block in a column [px]."""
SWEEPS = 8


@dataclass(frozen=True)
class Box:
    """A block's text and size [px], and its pins from top to bottom with their heights in the block by index."""

    shape: Shape
    title: str
    notes: tuple[str, ...]
    left: tuple[Pin, ...]
    right: tuple[Pin, ...]
    width: float
    height: float
    heights: Mapping[tuple[str, int], float]


def measure(shape: Shape, inputs: Sequence[Pin], outputs: Sequence[Pin], flow: int) -> Box:
    """The box of a shape, its pins in the order given; where signals run to the left, inputs are on the right."""
    title = shortened(shape.title, TITLE, LONGEST, bold=True)
    notes = tuple(shortened(note, NOTE, LONGEST) for note in shape.notes)
    inputs, outputs = (
        [replace(pin, name=shortened(pin.name, PIN, 0.75 * LONGEST)) for pin in pins] for pins in (inputs, outputs)
    )
    head = 12.0 + TITLE + (NOTE + 3.0) * len(notes)
    rows = max(len(inputs), len(outputs)) if any(p.name for p in (*inputs, *outputs)) else 0
    height = head + rows * PITCH + 5.0
    heights = {}
    for side, pins in (("i", inputs), ("o", outputs)):
        spare = (rows - len(pins)) * PITCH // 2.0
        for k, pin in enumerate(pins):
            heights[side, pin.index] = head + spare + (k + 0.5) * PITCH if rows else height // 2.0 + 0.5
    names = [max((text_width(p.name, PIN) for p in pins), default=0.0) for pins in (inputs, outputs)]
    heading = [text_width(title, TITLE, bold=True), *(text_width(note, NOTE) for note in notes)]
    width = 2.0 * EDGE + max(sum(names) + BETWEEN, max(heading) + 4.0, 64.0)
    sides = (inputs, outputs) if flow > 0 else (outputs, inputs)
    return Box(shape, title, notes, tuple(sides[0]), tuple(sides[1]), width, height, heights)


def heights_in_row(row: Row, boxes: Mapping[int, Box], picture: View) -> dict[int, float]:
    """Top of each block [px] below the row's; neighbours' pins level where that is possible, order kept."""
    tops: dict[int, float] = {}
    for column in row.columns:
        below = 0.0
        for key in column:
            tops[key] = below
            below += boxes[key].height + STACK
    stacked = dict(tops)
    wishes = _neighbours(row, boxes, picture.nets)
    for sweep in range(SWEEPS):
        for column in row.columns[::1] if (sweep % 2 == 0) == (row.flow > 0) else row.columns[::-1]:
            requested = []
            for key in column:
                levels = sorted(tops[other] + shift for other, shift in wishes.get(key, ()))
                requested.append((levels[(len(levels) - 1) // 2], 1.0) if levels else (stacked[key], 0.01))
            tops.update(zip(column, _stacked(requested, [boxes[key].height for key in column]), strict=True))
    for column in row.columns:
        _close_up(column, tops, boxes, wishes)
    highest = min(tops.values())
    return {key: top - highest for key, top in tops.items()}


def _close_up(
    column: Sequence[int], tops: dict[int, float], boxes: Mapping[int, Box], wishes: Mapping[int, object]
) -> None:
    """Move blocks that no signal from a neighbour holds in place next to those that one holds."""
    for above, key in pairwise(column):
        if key not in wishes:
            tops[key] = tops[above] + boxes[above].height + STACK
    for below, key in pairwise(column[::-1]):
        if key not in wishes:
            tops[key] = max(tops[key], tops[below] - boxes[key].height - STACK)


def _neighbours(row: Row, boxes: Mapping[int, Box], nets: Sequence[Net]) -> dict[int, list[tuple[int, float]]]:
    """Of each block the neighbours in the next columns, and how far below theirs its top is with level pins."""
    at = {key: i for i, column in enumerate(row.columns) for key in column}
    near: dict[int, list[tuple[int, float]]] = {}
    for net in nets:
        source, output = net.source
        for target, entry in net.targets:
            if source in at and target in at and at[target] - at[source] == row.flow:
                shift = boxes[source].heights["o", output] - boxes[target].heights["i", entry]
                near.setdefault(target, []).append((source, shift))
                near.setdefault(source, []).append((target, -shift))
    return near


def _stacked(requested: Sequence[tuple[float, float]], sizes: Sequence[float]) -> list[float]:
    """Tops nearest to the requested (top, weight) in least squares that keep order and distance: pooled violators."""
    offsets = [sum(sizes[:i]) + STACK * i for i in range(len(sizes))]
    pools: list[list[float]] = []
    for (top, weight), offset in zip(requested, offsets, strict=True):
        pools.append([(top - offset) * weight, weight, 1.0])
        while len(pools) > 1 and pools[-2][0] / pools[-2][1] >= pools[-1][0] / pools[-1][1]:
            last = pools.pop()
            pools[-1] = [a + b for a, b in zip(pools[-1], last, strict=True)]
    levels = [pool[0] / pool[1] for pool in pools for _ in range(int(pool[2]))]
    return [float(round(level + offset)) for level, offset in zip(levels, offsets, strict=True)]


GAP = 9.0
"""Between parallel lines [px]."""
ENTRY = 20.0
"""Clear of lines before a block's inputs, and at least so much behind its outputs [px]."""
LABEL = 8.5
"""Font size of a signal's width [px]."""
STRETCH = 110.0
"""At most so much wider may a gap of a short row become, to stand below the long one [px]."""


@dataclass(frozen=True)
class Frame:
    """Columns' left edges and widths and channels' first tracks [px] of every row."""

    lefts: Mapping[tuple[int, int], float]
    widths: Mapping[tuple[int, int], float]
    tracks: Mapping[tuple[int, int], float]
    width: float


def frame_of(
    picture: View, rows: Sequence[Row], boxes: Mapping[int, Box], counts: Mapping[tuple[int, int], int]
) -> Frame:
    """Where columns and channels stand from left to right; short rows are stretched and set to where they begin.

    Lines of one row stand on a grid half a gap beside the next row's, so that they never meet in the corridor between.
    """
    labels: dict[int, float] = {}
    for net in picture.nets:
        labels[net.source[0]] = max(labels.get(net.source[0], 0.0), text_width(net.label, LABEL))
    widths: dict[tuple[int, int], float] = {}
    gaps: dict[tuple[int, int], tuple[float, float]] = {}
    for r, row in enumerate(rows):
        for c, column in enumerate(row.columns):
            widths[r, c] = max(boxes[key].width for key in column)
        for c in range(len(row.columns) + 1):
            left = _clear(row, c - 1, row.flow > 0, labels)
            right = _clear(row, c, row.flow < 0, labels)
            gaps[r, c] = left, right + GAP  # one more for the grid
    natural = [
        sum(widths[r, c] for c in range(len(row.columns)))
        + sum(sum(gaps[r, c]) + GAP * counts.get((r, c), 0) for c in range(len(row.columns) + 1))
        for r, row in enumerate(rows)
    ]
    total = max(natural, default=0.0)
    lefts: dict[tuple[int, int], float] = {}
    starts: dict[tuple[int, int], float] = {}
    for r, row in enumerate(rows):
        inner = len(row.columns) - 1
        extra = min((total - natural[r]) / inner, STRETCH) if inner else 0.0
        x = 0.0 if row.flow > 0 else total - natural[r] - extra * inner
        for c in range(len(row.columns) + 1):
            slack = extra if 0 < c <= inner else 0.0
            phase = GAP * (r % 2) / 2.0
            starts[r, c] = phase + GAP * ceil((x + gaps[r, c][0] + slack / 2.0 - phase) / GAP)
            x += sum(gaps[r, c]) + GAP * counts.get((r, c), 0) + slack
            if c < len(row.columns):
                lefts[r, c] = x
                x += widths[r, c]
    return Frame(lefts, widths, starts, total)


def _clear(row: Row, column: int, is_exit: bool, labels: Mapping[int, float]) -> float:
    """What a channel keeps free of lines beside a column: for arrows, or for the widths of signals."""
    if not 0 <= column < len(row.columns):
        return 0.0
    return max(ENTRY, max(labels.get(key, 0.0) for key in row.columns[column]) + 14.0) if is_exit else ENTRY
