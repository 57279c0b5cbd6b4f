"""What every reader returns: one recorded run on a uniform clock, and what was done to it on the way.

What was done to many logs is told once for each kind of note, with the names of the logs.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

from drake_tc.types import FloatArray, IntArray

MIN_ROWS = 20
"""Usable rows of a log at least."""


@dataclass(frozen=True)
class Run:
    """One run in canonical columns and SI units, on a clock that is uniform inside each segment.

    Attributes:
        name: The file's name without its ending(s); unique within one call.
        source: The file or the name of the table that it was read from; None for a run that was not read.
        time: (T,) [s], strictly increasing.
        period: The sampling period inside every segment [s].
        columns: Canonical column name (`joint/position`, `joint/torque`, ...) to (T,) values, all finite
            where `segment >= 0`.
        segment: (T,) integers: samples that share a number >= 0 are contiguous and uniform; -1 marks samples
            that must not be used (torque off, a gap's filler, missing values).
        notes: One sentence for every repair and every exclusion, for the report.
        hints: Those notes that call for a change of the rig file or the log: a column that may have been forgotten in
            the rig file, a wrong sign, or an encoder that lost its zero.
        steps: Column name to the step of its recorded values, for the columns whose values lie on a grid. It is read
            before the resampling, which hides it.
        slower: Column name to the period of the clock that sampled it [s], for the columns that a slower clock than the
            log's sampled and that were interpolated between its samples.
        speed_only: Joints whose position is the integral of the recorded velocity (`speed_only`).
        acceleration_weights: Weights of the window (an odd number of samples) by which the model of a robot got
            accelerations and loads from positions [1/s^2]; None where there are none, or at another period.

    Example:
        >>> time = np.arange(100) * 0.01
        >>> run = Run("swing", None, time, 0.01, {"knee/position": np.sin(time)}, np.zeros(100, dtype=int))
        >>> len(run), list(run.segments())
        (100, [slice(0, 100, None)])
    """

    name: str
    source: Path | None
    time: FloatArray
    period: float
    columns: Mapping[str, FloatArray]
    segment: IntArray
    notes: tuple[str, ...] = ()
    steps: Mapping[str, float] = field(default_factory=dict)
    hints: tuple[str, ...] = ()
    slower: Mapping[str, float] = field(default_factory=dict)
    speed_only: tuple[str, ...] = ()
    acceleration_weights: FloatArray | None = None

    def __len__(self) -> int:
        return int(self.time.size)

    @property
    def file_name(self) -> str:
        """Name of the log file without its folder; the run's name where it was made in memory."""
        return self.name if self.source is None else self.source.name

    def segments(self) -> Iterator[slice]:
        """Yield the contiguous usable stretches, in time order."""
        edges = np.flatnonzero(np.diff(self.segment)) + 1
        bounds = np.concatenate([[0], edges, [len(self)]])
        for first, last in pairwise(bounds):
            if last > first and self.segment[first] >= 0:
                yield slice(int(first), int(last))


_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(\.\d+)?(e[-+]?\d+)?(?!\w)")
"""A number that is not a part of a name such as `joint_2`."""
NAMED = 3
"""Logs that are named in a sentence; further ones are counted."""


def distinct_notes(notes: Iterable[tuple[str, str]]) -> tuple[str, ...]:
    """One sentence for each kind of note, in the order in which the kinds first appear.

    Notes that differ in their numbers alone are of one kind; the numbers are those of the first log.

    Args:
        notes: (name of the log, sentence).
    """
    kinds: dict[str, list[tuple[str, str]]] = {}
    for log, note in notes:
        kinds.setdefault(_NUMBER.sub("#", note), []).append((log, note))
    return tuple(_sentence(group) for group in kinds.values())


def of_joint(notes: Iterable[tuple[str, str]], joint: str, joints: Sequence[str]) -> list[tuple[str, str]]:
    """The notes without those that concern other joints alone."""
    return [(log, note) for log, note in notes if concerns(note, joint, joints)]


def concerns(note: str, joint: str, joints: Sequence[str]) -> bool:
    """Whether a note names a column of the joint, or of no other joint."""
    return _names(note, [joint]) or not _names(note, [name for name in joints if name != joint])


def _names(note: str, joints: Sequence[str]) -> bool:
    """Whether the sentence names a column of one of the joints."""
    return any(re.search(rf"(?<!\w){re.escape(joint)}/", note) for joint in joints)


def _sentence(group: Sequence[tuple[str, str]]) -> str:
    first, note = group[0]
    logs = list(dict.fromkeys(log for log, _ in group))
    if all(other == note for _, other in group):
        return f"{_listed(logs)}: {note}"
    if len(logs) == 1:
        return f"{first}: {note} The same happened {len(group) - 1} more times, with other numbers."
    return f"{first}: {note} The same, with other numbers, holds for {_listed(logs[1:])}."


def _listed(logs: Sequence[str]) -> str:
    if len(logs) <= NAMED:
        return ", ".join(logs)
    return f"{', '.join(logs[:NAMED])} and {len(logs) - NAMED} more logs"
