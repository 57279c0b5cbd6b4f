"""A held joint that is pulled left and right: where it rests before, under and after each pull.

Static friction from the torques at which a joint breaks away.

At rest the balance of `drake_tc.effects.base` reads  y/K - tau = friction,  |friction| <= F_s,  and friction meets its
limit at the instant in which the joint starts to move. So every stretch at rest that ends in motion gives one sample of
F_s, signed by the direction in which the joint leaves. Source: Armstrong-Hélouvry, Dupont and Canudas de Wit (1994),
section 2.1.2 (break-away experiments).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binom

from drake_tc.errors import IdentificationError
from drake_tc.logs.record import Run
from drake_tc.types import BoolArray, FloatArray, IntArray

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


LEAST_EVENTS = 6
"""With fewer events the 95 % interval of a median is not bounded by the samples."""


@dataclass(frozen=True)
class BreakAway:
    """Break-away events of one joint.

    Attributes:
        index: (E,) the last sample at rest of each event.
        direction: (E,) +1 or -1: where the joint leaves to.
        torque: (E,) friction torque at the event, positive against the motion that follows [N m].
    """

    index: IntArray
    direction: FloatArray
    torque: FloatArray

    @property
    def level(self) -> float:
        """F_s: the median over the events [N m]; NaN without events."""
        return float(np.median(self.torque)) if self.torque.size else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the median from order statistics [N m]; infinite with fewer than `LEAST_EVENTS` events."""
        size = self.torque.size
        if size < LEAST_EVENTS:
            return -np.inf, np.inf
        lower = int(binom.ppf(0.025, size, 0.5)) - 1
        ordered = np.sort(self.torque)
        return float(ordered[max(lower, 0)]), float(ordered[min(size - 1 - lower, size - 1)])


def break_away(
    motor_torque: FloatArray, needed_torque: FloatArray, velocity: FloatArray, moving: BoolArray, least_rest: int
) -> BreakAway:
    """The events of one contiguous stretch of log.

    Args:
        motor_torque: (T,) y*/K [N m].
        needed_torque: (T,) tau + J qddot + F_v qdot [N m]: the joint moves a little before its encoder resolves it, and
            what this motion needs is not friction.
        velocity: (T,) [rad/s].
        moving: (T,) whether the joint resolvably moves (`Samples.moving`).
        least_rest: Samples for which the joint must have rested; twice the filters' width or more, so that the
            torque of the last sample at rest is not mixed with that of the motion before.

    Returns:
        The events; of a rest that the joint leaves by creeping below the resolution of the encoder, the torque is that
        of the first resolved motion.
    """
    starts = np.flatnonzero(np.diff(moving.astype(np.int8)) == 1)
    stops = np.flatnonzero(np.diff(moving.astype(np.int8)) == -1)
    index, direction, torque = [], [], []
    for last in starts:
        before = stops[stops < last]
        rested = last - (before[-1] if before.size else -1)
        if rested < least_rest:
            continue
        side = float(np.sign(velocity[last + 1]))
        window = slice(max(last - least_rest // 2, 0), last + 1)
        held = side * (motor_torque[window] - needed_torque[window])
        index.append(int(last))
        direction.append(side)
        torque.append(float(held.max()))
    return BreakAway(np.array(index, dtype=np.int64), np.array(direction), np.array(torque))
