"""Where columns and channels stand from left to right, with room for the widths of signals and for parallel lines."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil

from drake_tc.report.block_graph.columns import Row
from drake_tc.report.block_graph.place import Box
from drake_tc.report.block_graph.text import text_width
from drake_tc.report.block_graph.view import Net, View

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


def label_width(net: Net) -> float:
    """Of the text at the source of a net [px]."""
    return text_width(net.label, LABEL)


def frame_of(
    picture: View, rows: Sequence[Row], boxes: Mapping[int, Box], counts: Mapping[tuple[int, int], int]
) -> Frame:
    """Where columns and channels stand from left to right; short rows are stretched and set to where they begin.

    Lines of one row stand on a grid half a gap beside the next row's, so that they never meet in the corridor between.
    """
    labels: dict[int, float] = {}
    for net in picture.nets:
        labels[net.source[0]] = max(labels.get(net.source[0], 0.0), label_width(net))
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
