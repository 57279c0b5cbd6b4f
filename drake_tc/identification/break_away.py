"""Static friction from the torques at which a joint breaks away.

At rest the balance of `drake_tc.effects.base` reads  y/K - tau = friction,  |friction| <= F_s,  and friction meets its
limit at the instant in which the joint starts to move. So every stretch at rest that ends in motion gives one sample of
F_s, signed by the direction in which the joint leaves. Source: Armstrong-Hélouvry, Dupont and Canudas de Wit (1994),
section 2.1.2 (break-away experiments).
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import binom

from drake_tc.types import BoolArray, FloatArray, IntArray

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
