"""A drive that delivers no more than so much."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Context, DriveEffect, Parameter, Plausible, Shape, Signals, Signature
from drake_tc.effects.kernel import DriveKernel, memoryless
from drake_tc.kernels.equations import saturated
from drake_tc.kernels.joint_layout import SATURATION
from drake_tc.types import FloatArray

LIMIT_RANGE = Plausible(
    0.02,
    1.0,
    "a limit beyond the recorded efforts never acted, and one far below them would have let no motion happen",
    "effort",
)


class Saturation(DriveEffect):
    """y* = clip(y, -L, L)."""

    id = "saturation"
    title = "saturation of the drive"
    equation = "y_eff = min(max(y, -limit), limit)"
    kind = "drive"
    shapes = (Parameter("limit", "effort", 0.0, default=np.inf, description="largest effort L", plausible=LIMIT_RANGE),)
    signature = Signature(x="effort", split="", look_for="a line that bends at the same effort on both sides")

    def obstacle(self, context: Context) -> str:
        """Not where links are fitted: in a joint with little load, friction explains an effort cut down to its sign."""
        if context.load == "links":
            return "the links are fitted from the recorded efforts, and a fitted limit could cut off a part of these"
        return super().obstacle(context)

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Limits from a fifth of the largest effort up to it."""
        largest = max(abs(context.effort_span[0]), abs(context.effort_span[1]))
        return [{"limit": float(x * largest)} for x in np.linspace(0.2, 0.98, 14)]

    def transform(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """Clip."""
        return np.asarray(saturated(effort, shape["limit"]))

    def kernel(self, parameters: Mapping[str, float], period: float) -> DriveKernel:
        """No memory."""
        limit = parameters["limit"]
        return memoryless(lambda value, effort, direction: float(saturated(value, limit)), SATURATION, (limit,))
