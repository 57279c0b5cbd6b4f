"""Which contacts carry load, and which of those are left out because they slip."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from drake_tc.estimation.base.spec import BaseEstimatorSpec
from drake_tc.types import FloatArray

_LEAST_SHARE = 0.05
"""Of all load, that contacts which count must bear together."""


class Slip(NamedTuple):
    """What slipping contacts leave behind; k contacts.

    Attributes:
        drift: (k, 3) averaged velocity against the reference [m/s].
        dropped: k ticks until a dropped contact counts again; 0 while it counts.
    """

    drift: FloatArray
    dropped: list[float]


def carries(
    load: Sequence[float], was: Sequence[float], limits: Sequence[tuple[float, float]], switch: Sequence[float]
) -> list[bool]:
    """Whether each of k contacts carries load: hysteresis between break and make [N], or as `switch` says.

    Args:
        load: k loads [N].
        was: 1 where it carried load before.
        limits: (make, break) of each [N].
        switch: 0 by the load, above held on, below held off.
    """
    return [
        (s > 0.0) if s else f > (break_ if before else make)
        for f, before, (make, break_), s in zip(load, was, limits, switch, strict=True)
    ]


def slipping(
    on: list[bool], new: list[bool], load: Sequence[float], against: FloatArray, before: Slip, spec: BaseEstimatorSpec
) -> Slip:
    """Drop the contact whose velocity is furthest from the others', and let it back when it has stood still.

    m[n+1] = m[n] + (d - m[n]) dt/slip_time with d (k, 3) the base velocity that a contact says, less the one that the
    last tick and the accelerometer say. At most one contact a tick is dropped, the one with the largest |m| above
    `slip_speed`, and never the last one: against the IMU alone it is more likely right. A dropped contact counts again
    after |m| < slip_speed/2 for `slip_hold`, or, as the most loaded one, when the others bear next to nothing: a foot
    in the air says nothing about a foot that stands.

    Args:
        on: Which of k carry load.
        new: Which do so since this tick.
        load: Loads [N].
        against: (k, 3) d [m/s].
        before: After the last tick.
        spec: Tuning.
    """
    fresh = [touches and not first for touches, first in zip(on, new, strict=True)]
    drift = before.drift + min(1.0, spec.period / spec.slip_time) * (against - before.drift)
    if not all(fresh):
        drift *= np.array(fresh, dtype=float)[:, None]
    speed = [math.sqrt(x * x + y * y + z * z) for x, y, z in drift.tolist()]
    hold = math.ceil(spec.slip_hold / spec.period)
    dropped = [0.0] * len(on)
    for i, left in enumerate(before.dropped):
        if left > 0.0 and fresh[i]:
            dropped[i] = left - 1.0 if speed[i] < 0.5 * spec.slip_speed else float(hold)
    bearing = [i for i, touches in enumerate(on) if touches]
    counts = [i for i in bearing if not dropped[i]]
    if len(counts) > 1:
        worst = max(counts, key=speed.__getitem__)
        if speed[worst] > spec.slip_speed:
            dropped[worst] = float(hold)
            counts.remove(worst)
    if bearing and sum(load[i] for i in counts) < _LEAST_SHARE * sum(load[i] for i in bearing):
        heaviest = max(bearing, key=load.__getitem__)
        dropped[heaviest] = 0.0
    return Slip(drift, dropped)
