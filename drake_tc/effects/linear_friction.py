"""Friction that grows or falls in proportion to the angle."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Context, JointNumbers, Parameter, Plausible, Signature
from drake_tc.effects.equation_effect import EquationEffect
from drake_tc.effects.position_dependent_friction import WAVE_RANGE, PositionDependentFriction
from drake_tc.kernels.torque_equations import FRICTION_LINE

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
