"""Waves over the position: of shafts, poles and teeth, or of screw, pinion and guide of a joint that slides.

With n in cos(n q), a wave of the length l of a joint that slides has n = 2 pi/l [rad/m].
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


def waves(
    context: Context, least_periods: float, most_periods: float, least: float, most: float
) -> list[dict[str, float]]:
    """Starting points of n, from `least_periods` over the travel on.

    Args:
        context: Of the logs.
        least_periods: Over the travel.
        most_periods: The same, of a joint that turns.
        least: n, cycles a turn of a joint that turns.
        most: The same.
    """
    turns = context.turns
    if turns <= 0.0:
        return []
    if context.units.slides:
        values = np.arange(least_periods / turns, MOST_CYCLES, OVERLAP / turns)[:GRID]
    else:
        values = np.arange(max(least, least_periods / turns), min(most, most_periods / turns), OVERLAP / turns)
    return [{"cycles_per_turn": float(n)} for n in values]
