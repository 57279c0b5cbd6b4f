"""A drive whose gain depends on the direction of motion."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import (
    Context,
    DriveEffect,
    JointNumbers,
    Parameter,
    Plausible,
    Shape,
    Signals,
    Signature,
    Values,
)
from drake_tc.effects.kernel import DriveKernel, InverseLaw, memoryless
from drake_tc.kernels.equations import switch_inverse, switched
from drake_tc.kernels.joint_layout import SWITCH
from drake_tc.types import FloatArray

SWITCH_RANGE = Plausible(
    -0.5,
    0.5,
    "a drive that is three times as strong in one direction is defective",
)


class VelocitySignSwitch(DriveEffect):
    """y* = (1 + s sign(qdot)) y: two branches, one for each sign of the velocity (Del Prete et al., 2016, section 3).

    Linear in s/K, so it is looked for as a column.
    """

    id = "velocity_sign_switch"
    title = "drive gain that switches with the direction"
    equation = "y_eff = (1 + switch * sign(qdot)) * y"
    kind = "drive"
    coefficients = (Parameter("switch_torque", "N*m/effort"),)
    size = ("switch", "-")
    signature = Signature(
        x="effort", split="direction", look_for="two straight lines of different slope that cross at zero"
    )

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The switch s alone."""
        return (
            Parameter(
                "switch",
                "-",
                -1.0,
                1.0,
                description="half the difference of the gain between forward and backward motion, over its mean",
                plausible=SWITCH_RANGE,
            ),
        )

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """-y sign(qdot) (T, 1)."""
        return -(signals.effort * signals.direction)[:, None]

    def physical(self, theta: FloatArray, shape: Shape, gain: float) -> dict[str, float]:
        """The switch s = theta K."""
        return {"switch": float(theta[0]) * gain}

    def transform(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """The switch acts through its column."""
        return effort

    def kernel(self, parameters: Mapping[str, float], period: float) -> DriveKernel:
        """No memory beyond the direction itself; acts on the raw effort, as the column does."""
        switch = parameters["switch"]
        return memoryless(
            lambda value, effort, direction: switched(value, effort, direction, switch), SWITCH, (switch,)
        )

    def inverse(
        self, effort: FloatArray, position: FloatArray, direction: FloatArray, parameters: Values
    ) -> FloatArray:
        """The command y / (1 + s sign(qdot)); the effort itself where the drive is dead (s = -sign)."""
        return np.asarray(switch_inverse(effort, direction, parameters["switch"]))

    def inverse_law(self, parameters: Mapping[str, float], smoothing: float) -> InverseLaw:
        """The same; nothing of it jumps."""
        switch = parameters["switch"]
        return InverseLaw(
            lambda effort, position, direction: float(switch_inverse(effort, direction, switch)), SWITCH, switch
        )

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 0.05

    def unit_coefficients(self, n: JointNumbers) -> tuple[FloatArray, ...]:
        """See `Effect.unit_coefficients`."""
        return (np.array([1.0 / n.gain]),)
