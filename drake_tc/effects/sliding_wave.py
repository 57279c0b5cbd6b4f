"""Waves over the position of a joint that slides: of its screw or pinion, the motor's poles, the balls of the guide.

With n in cos(n q), a wave of the length l has n = 2 pi/l [rad/m].
"""

import numpy as np

from drake_tc.effects.base import Context, Plausible

MOST_CYCLES = 2e4
"""Largest n of a fit: a wave of 0.3 mm."""
SLIDING_WAVE_RANGE = Plausible(
    3.0,
    MOST_CYCLES,
    "leads of screws are 1 to 50 mm, pinions and pulleys turn once in up to 2 m, and poles, teeth and balls repeat "
    "several times in each of these",
)
GRID = 1200
"""Most starting points of n."""
OVERLAP = 0.35
"""Distance of the starting points, in periods over the travel."""


def sliding_waves(context: Context, least_periods: float) -> list[dict[str, float]]:
    """Starting points of n, from `least_periods` over the travel on."""
    turns = context.turns
    if turns <= 0.0:
        return []
    values = np.arange(least_periods / turns, MOST_CYCLES, OVERLAP / turns)[:GRID]
    return [{"cycles_per_turn": float(n)} for n in values]
