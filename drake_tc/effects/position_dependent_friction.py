"""Friction whose level repeats with the angle."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Context, EquationEffect, JointNumbers, Parameter, Plausible, Signature
from drake_tc.effects.torque_ripple import MOST_CYCLES, SLIDING_WAVE_RANGE, waves
from drake_tc.kernels.torque_equations import FRICTION_LINE, FRICTION_WAVE

WAVE_RANGE = Plausible(
    -1.0,
    1.0,
    "friction dissipates energy at every position",
    "coulomb",
)
CYCLES_PER_TURN_RANGE = Plausible(
    0.3,
    400.0,
    "seals, bearings and gear teeth repeat with a turn of a shaft of the gear",
    sliding=SLIDING_WAVE_RANGE,
)

LEAST_PERIODS = 0.5
"""Periods that the positions span. With less, amplitude and mean friction cannot be separated: it is a line."""


class PositionDependentFriction(EquationEffect):
    """(F_1 cos(n q) + F_2 sin(n q)) sign(qdot) [N m], n cycles a turn."""

    id = "position_dependent_friction"
    torque_kind = FRICTION_WAVE
    title = "position-dependent friction"
    equation = (
        "tau_add = (friction_cosine * cos(cycles_per_turn * q) + friction_sine * sin(cycles_per_turn * q)) * sign(qdot)"
    )
    kind = "friction"
    depends_on_position = True
    coefficients = (
        Parameter(
            "friction_cosine", "N*m", description="cosine part of the friction over the angle", plausible=WAVE_RANGE
        ),
        Parameter("friction_sine", "N*m", description="sine part of the friction over the angle", plausible=WAVE_RANGE),
    )
    size = ("amplitude", "N*m")
    shapes = (
        Parameter(
            "cycles_per_turn",
            "1/turn",
            0.3,
            MOST_CYCLES,
            1.0,
            description="periods of the friction in one turn of the joint",
            plausible=CYCLES_PER_TURN_RANGE,
        ),
    )
    signature = Signature(
        x="position", split="direction", look_for="a wave over the position, mirrored between the two directions"
    )

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Starting points that cover what the logs excite."""
        return waves(context, 0.4, 60.0, least=0.5, most=60.0)

    def inconsistency(self, parameters: Mapping[str, float], context: Context) -> str:
        """The positions span half a period, and friction is positive everywhere: no wave is larger than the mean."""
        cycles = parameters["cycles_per_turn"]
        periods = cycles * context.turns
        if periods < LEAST_PERIODS:
            return (
                f"The positions span {periods:.3g} of a period of friction with {cycles:.3g} cycles a turn: at least "
                f"{LEAST_PERIODS:g} is expected, as less of a wave determines neither its amplitude nor its period."
            )
        amplitude = float(np.hypot(parameters["friction_cosine"], parameters["friction_sine"]))
        mean = context.scale("coulomb")
        if amplitude <= mean:
            return ""
        return f"The wave of {amplitude:.3g} N*m exceeds the Coulomb friction of {mean:.3g} N*m: {WAVE_RANGE.source}."

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return n.friction


SLOPE_RANGE = Plausible(
    -2.0,
    2.0,
    WAVE_RANGE.source,
    "torque/span",
)
TRAVEL_RANGE = Plausible(-np.inf, np.inf, "middle and half travel are those of the recorded positions")


class LinearPositionFriction(EquationEffect):
    """k (q - q_m) sign(qdot) [N m], with q - q_m kept within [-h, h].

    q_m is the middle and h half of the travel of the recorded positions; beyond, the friction keeps its last value, as
    nothing was measured there. The Coulomb friction beside it is that in the middle.

    A linkage whose ratio changes with the angle, or a cable or seal that is pressed harder towards one end, acts like
    this; so does friction whose period is much longer than the travel, as the log shows only a straight part of it.
    """

    id = PositionDependentFriction.id
    form = "linear"
    torque_kind = FRICTION_LINE
    title = "friction that changes linearly with the position"
    equation = "tau_add = friction_slope * max(-half_travel, min(half_travel, q - middle)) * sign(qdot)"
    kind = "friction"
    depends_on_position = True
    coefficients = (
        Parameter(
            "friction_slope", "N*m/rad", description="change of the friction with the angle", plausible=SLOPE_RANGE
        ),
    )
    given_shapes = (
        Parameter("middle", "rad", description="middle q_m of the recorded positions", plausible=TRAVEL_RANGE),
        Parameter("half_travel", "rad", default=1.0, description="half of their range, h > 0", plausible=TRAVEL_RANGE),
    )
    signature = Signature(
        x="position",
        split="direction",
        look_for="a straight line over the position, mirrored between the two directions",
    )

    def unexcited(self, context: Context) -> str:
        """Needs positions to span."""
        if context.position_span[1] - context.position_span[0] < 1e-3:
            return "the joint does not move far enough to show friction over the position"
        return ""

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """The recorded positions."""
        low, high = context.position_span
        return [{"middle": 0.5 * (low + high), "half_travel": 0.5 * (high - low)}]

    def inconsistency(self, parameters: Mapping[str, float], context: Context) -> str:
        """Friction stays positive at both ends: the line changes it by no more than its value in the middle."""
        change = abs(parameters["friction_slope"]) * parameters["half_travel"]
        middle = context.scale("coulomb")
        if change <= middle:
            return ""
        return (
            f"The change of {change:.3g} N*m towards one end exceeds the Coulomb friction of {middle:.3g} N*m in the "
            f"middle: {WAVE_RANGE.source}."
        )

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 2.0 * n.friction / max(n.span, 1e-9)
