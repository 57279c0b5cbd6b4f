"""A constant error of the recorded current or voltage."""

from collections.abc import Mapping
from typing import Any

from drake_tc.effects.base import Context, EquationEffect, JointNumbers, Parameter, Plausible, Signature
from drake_tc.kernels.torque_equations import CONSTANT

EFFORT_BIAS_RANGE = Plausible(
    -0.5,
    0.5,
    "a current sensor whose zero is off by more than half of what it recorded at most is defective (data "
    "sheets: 1 to 3 % of full scale)",
    "torque",
)


class EffortBias(EquationEffect):
    """y_meas = y + K b with the drive gain K [effort/(N m)]: the effort makes b [N m] less torque than it says.

    While the joint slides this is one constant, as a Coulomb asymmetry or a torque sensor's bias is. At rest it differs
    from friction: it acts there too.
    """

    id = "effort_bias"
    torque_kind = CONSTANT
    title = "offset of the recorded effort"
    equation = "tau_add = bias_torque"
    kind = "sensor"
    linear = True
    coefficients = (
        Parameter(
            "bias_torque", "N*m", description="offset of the recorded effort, as a torque", plausible=EFFORT_BIAS_RANGE
        ),
    )
    signature = Signature(x="effort", split="", look_for="everything shifted by one constant, at rest too")

    def obstacle(self, context: Context) -> str:
        """A position servo's effort is computed from the position, and an unknown load has a constant of its own."""
        if context.drive == "position_servo":
            return "the effort is the position error, so that an offset of it is the same as an offset of the encoder"
        return context.taken_up or super().obstacle(context)

    def numbers(self, parameters: Mapping[str, Any]) -> tuple[Any, ...]:
        """Rest b."""
        return 0.0, 0.0, parameters["bias_torque"]

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return n.friction
