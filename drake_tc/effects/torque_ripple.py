"""Torque that varies with the angle: cogging, gear meshing, ripple."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Context, EquationEffect, JointNumbers, Parameter, Plausible, Signature
from drake_tc.kernels.torque_equations import WAVE

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
    """Starting points of n of a wave over the position, from `least_periods` over the travel on.

    With n in cos(n q), a wave of the length l of a joint that slides has n = 2 pi/l [rad/m].

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


WAVE_RANGE = Plausible(
    -1.0,
    1.0,
    "a ripple cannot exceed the largest torques of drive and load together",
    "torque",
)
CYCLES_PER_TURN_RANGE = Plausible(
    3.0,
    2000.0,
    "shafts behind a gear, pole pairs and gear teeth repeat three times or more in a turn of the output; "
    "less often it is a load curve over the position",
    sliding=SLIDING_WAVE_RANGE,
)
LEAST_PERIODS = 1.0
"""Periods of a ripple that the positions must span."""


class TorqueRipple(EquationEffect):
    """R_1 cos(n q) + R_2 sin(n q) [N m], n cycles a turn."""

    id = "torque_ripple"
    torque_kind = WAVE
    title = "torque ripple"
    equation = "tau_add = ripple_cosine * cos(cycles_per_turn * q) + ripple_sine * sin(cycles_per_turn * q)"
    kind = "load"
    depends_on_position = True
    coefficients = (
        Parameter("ripple_cosine", "N*m", description="cosine part of the torque over the angle", plausible=WAVE_RANGE),
        Parameter("ripple_sine", "N*m", description="sine part of the torque over the angle", plausible=WAVE_RANGE),
    )
    size = ("amplitude", "N*m")
    shapes = (
        Parameter(
            "cycles_per_turn",
            "1/turn",
            1.5,
            MOST_CYCLES,
            20.0,
            description="periods of the torque in one turn of the joint",
            plausible=CYCLES_PER_TURN_RANGE,
        ),
    )
    signature = Signature(
        x="position modulo period",
        split="direction",
        look_for="a wave over one period, the same in both directions",
    )

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Starting points that cover what the logs excite."""
        return waves(context, 1.2, 200.0, least=2.0, most=420.0)

    def inconsistency(self, parameters: Mapping[str, float], context: Context) -> str:
        """The positions span at least one period: less of a wave is a curve."""
        cycles = parameters["cycles_per_turn"]
        periods = cycles * context.turns
        if periods >= LEAST_PERIODS:
            return ""
        return (
            f"The positions span {periods:.3g} of a period of a ripple of {cycles:.3g} cycles a turn: that is a load "
            "curve over the position."
        )

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return n.friction
