"""Tasks and limits of a law as tables for `drake_tc.kernels.tsid.problem`, one set for each set of active contacts."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from drake_tc.tsid.contacts import ActiveContacts
from drake_tc.types import FloatArray, IntArray

WRITTEN_OUT = 0
TASK_KINDS = ("", "com", "posture", "frame", "orientation", "force", "torque", "momentum", "pressure")
LIMIT_KINDS = ("", "bounds", "forces", "viable")
"""In the order of the constants of `drake_tc.kernels.tsid.rows`."""
_COLUMNS, KIND, ROWS = 5, 0, 1


class Entry(NamedTuple):
    """A task or limit as numbers.

    Attributes:
        kind: One of the kinds.
        rows: How many.
        integers: As `drake_tc.kernels.tsid.rows` reads them.
        numbers: The same.
    """

    kind: str
    rows: int
    integers: tuple[Any, ...]
    numbers: tuple[Any, ...]


class Tables(NamedTuple):
    """Of one set of active contacts.

    Attributes:
        tasks: (., 5).
        limits: (., 5), in the order of the rows.
        integers: What both point into.
        numbers: The same.
        free_tasks: Places of tasks that give no numbers of their own, and are asked for rows each tick.
        free_limits: The same of limits, as places in their table.
    """

    tasks: IntArray
    limits: IntArray
    integers: IntArray
    numbers: FloatArray
    free_tasks: tuple[int, ...]
    free_limits: tuple[int, ...]


def entry_of(item: Any, contacts: ActiveContacts) -> Entry | None:
    """Numbers of a task or limit; None where it has none, or where a subclass gives other rows than they say."""
    mine, theirs = _definer(item, "compiled_entry"), _definer(item, "rows")
    if mine is None or theirs is None or "rows" in getattr(item, "__dict__", {}) or not issubclass(mine, theirs):
        return None
    entry: Entry = item.compiled_entry(contacts)
    return entry


def _definer(item: Any, name: str) -> Any:
    return next((each for each in type(item).__mro__ if name in vars(each)), None)


def tables_of(tasks: Sequence[Any], limits: Sequence[Any], contacts: ActiveContacts) -> Tables:
    """Numbers of all tasks and limits.

    Args:
        tasks: Of the law.
        limits: In the order of their rows.
        contacts: That carry.
    """
    integers: list[IntArray] = []
    numbers: list[FloatArray] = []
    free_tasks, free_limits = [], []
    reference, task_table, limit_table = 0, [], []
    for place, task in enumerate(tasks):
        entry = entry_of(task, contacts)
        task_table.append(_row(entry, TASK_KINDS, integers, numbers, reference))
        reference += task.reference_size
        if entry is None:
            free_tasks.append(place)
    for place, limit in enumerate(limits):
        entry = entry_of(limit, contacts)
        limit_table.append(_row(entry, LIMIT_KINDS, integers, numbers, 0))
        if entry is None:
            free_limits.append(place)
    return Tables(
        np.array(task_table, dtype=np.int64).reshape(-1, _COLUMNS),
        np.array(limit_table, dtype=np.int64).reshape(-1, _COLUMNS),
        np.concatenate([np.zeros(0, dtype=np.int64), *integers]),
        np.concatenate([np.zeros(0), *numbers]),
        tuple(free_tasks),
        tuple(free_limits),
    )


def _row(
    entry: Entry | None, kinds: tuple[str, ...], integers: list[IntArray], numbers: list[FloatArray], reference: int
) -> list[int]:
    if entry is None:
        return [WRITTEN_OUT, 0, 0, 0, reference]
    row = [kinds.index(entry.kind), entry.rows, _size(integers), _size(numbers), reference]
    integers += [np.atleast_1d(np.asarray(part, dtype=np.int64)).ravel() for part in entry.integers]
    numbers += [np.atleast_1d(np.asarray(part, dtype=np.float64)).ravel() for part in entry.numbers]
    return row


def _size(parts: Sequence[Any]) -> int:
    return sum(part.size for part in parts)
