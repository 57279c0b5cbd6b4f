"""A held joint that is pulled left and right: where it rests before, under and after each pull."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.errors import IdentificationError
from drake_tc.logs.record import Run
from drake_tc.types import BoolArray, FloatArray

STRETCHED = 0.9
SLACK = 0.03
LEAST_SAMPLES = 2
SETTLED_SAMPLES = 5


@dataclass(frozen=True)
class Pull:
    """One pull and what the held joint did; positions are q - q_d [rad], efforts in the drive's unit.

    Attributes:
        puller: The joint that pulled. start: when it began [s].
        before, loaded, after: Displacement of the held joint at rest before the pull, while pulled, and relaxed again.
        loaded_effort, after_effort: The drive's effort in the last two.
        arrival: +1 or -1 when the joint had come to `before` by a motion of its own in that direction, 0 when an
            earlier pull had left it there.
    """

    puller: str
    start: float
    before: float
    loaded: float
    after: float
    loaded_effort: float
    after_effort: float
    arrival: int


def most_common(values: FloatArray) -> float:
    """The most frequent of the values (T,); NaN do not count."""
    found, counts = np.unique(values[np.isfinite(values)], return_counts=True)
    return float(found[np.argmax(counts)])


def _stretch(run: Run, puller: str) -> tuple[FloatArray, BoolArray]:
    """How far the puller is out, 0 at rest to 1 (T,), and where it is told to be out (T,)."""
    position, command = run.columns[f"{puller}/position"], run.columns[f"{puller}/position_command"]
    rest = most_common(command)
    far = float(np.nanmax(np.abs(command - rest)))
    if not far > 0.0:
        raise IdentificationError(
            f"{run.name}: {puller} never pulls: its command is constant; name the joints that pull"
        )
    sign = np.sign(command[np.nanargmax(np.abs(command - rest))] - rest)
    reach = float(np.nanmax(sign * (position - rest)))
    return np.asarray(sign * (position - rest) / reach), np.abs(command - rest) > 0.25 * far


def find_pulls(run: Run, held: str, pullers: Sequence[str]) -> tuple[Pull, ...]:
    """All pulls during which the held joint was told to stay where it was.

    Args:
        run: Has `<joint>/position` and `/position_command` [rad] of all of them, and `<held>/voltage` [V].
        held: The joint that holds.
        pullers: Those that load it.

    Raises:
        IdentificationError: a puller never pulls, or no pull is complete.
    """
    command = run.columns[f"{held}/position_command"]
    hold = most_common(command)
    displacement = run.columns[f"{held}/position"] - hold
    effort = run.columns[f"{held}/voltage"]
    holding = command == hold
    stretches, ordered = zip(*(_stretch(run, p) for p in pullers), strict=True)
    slack = np.all([s < SLACK for s in stretches], axis=0) & ~np.any(ordered, axis=0)
    pulls = []
    for puller, stretch, told in zip(pullers, stretches, ordered, strict=True):
        starts = np.flatnonzero(np.diff(told.astype(int)) > 0) + 1
        for first in starts:
            end = _next(slack, int(first))
            if end is None or not holding[first:end].all():
                continue
            stop = _next(~(slack & holding), end) or len(run)
            begin = _last(~(slack & holding), int(first) - 1)
            under = int(first) + np.flatnonzero(stretch[first:end] > STRETCHED)
            before = np.arange(max(begin + 1, int(first) - 3), int(first))
            after = np.arange(max(end + 1, stop - SETTLED_SAMPLES), stop)
            groups = [group[np.isfinite(displacement[group])] for group in (before, under, after)]
            if min(g.size for g in groups) < LEAST_SAMPLES:
                continue
            x = [float(np.median(displacement[g])) for g in groups]
            moved = _last(holding, begin) < begin  # the rest before it ended a motion of the joint's own
            pulls.append(
                Pull(
                    puller=puller,
                    start=float(run.time[first]),
                    before=x[0],
                    loaded=x[1],
                    after=x[2],
                    loaded_effort=float(np.median(effort[groups[1]])),
                    after_effort=float(np.median(effort[groups[2]])),
                    arrival=-int(np.sign(displacement[begin])) if moved and begin >= 0 else 0,
                )
            )
    if not pulls:
        raise IdentificationError(
            f"{run.name}: no complete pull on {held} by {', '.join(pullers)}; expected rest, pull, rest"
        )
    return tuple(sorted(pulls, key=lambda p: p.start))


def _next(mask: BoolArray, start: int) -> int | None:
    """First index >= start where the mask holds."""
    found = np.flatnonzero(mask[start:])
    return int(start + found[0]) if found.size else None


def _last(mask: BoolArray, start: int) -> int:
    """Last index <= start where the mask holds, or -1."""
    found = np.flatnonzero(mask[: start + 1])
    return int(found[-1]) if found.size else -1
