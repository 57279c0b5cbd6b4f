"""Which row and column each block of a picture stands in, and in which order.

The loop runs to the right in the first row and returns to the left in the second; logs stand below.
Each stage takes as many columns as its own chain of blocks is long.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from drake_tc.report.block_graph.view import INPUTS, OUTPUTS, Shape, View

ROWS: tuple[tuple[int, tuple[str, ...]], ...] = (
    (1, (INPUTS, "reference", "control", "actuation", "plant", OUTPUTS)),
    (-1, ("sensing", "filtering", "estimation", "supervision")),
    (1, ("logging",)),
)
"""Direction of the signals (1: to the right) and stages of each row, in the order in which signals pass."""
MOST_LOG_COLUMNS = 8
"""Logs do not depend on each other: they stand side by side, below each other only where there are more."""
SWEEPS = 6


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
    for sweep in range(SWEEPS):
        for column in columns if sweep % 2 == 0 else columns[::-1]:
            centre: dict[int, float] = {}
            for key in column:
                around = [place[other] for other in near[key] if other in place and other not in column]
                centre[key] = sum(around) / len(around) if around else place[key]
            column.sort(key=lambda key: (centre[key], place[key]))
            settle(column)
