"""A drive that ignores small efforts."""

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
from drake_tc.kernels.equations import dead_zone, dead_zone_inverse
from drake_tc.kernels.joint_layout import DEAD_ZONE
from drake_tc.types import FloatArray

DEADZONE_RANGE = Plausible(
    0.0,
    0.9,
    "a dead zone that covers the recorded efforts would have let no motion happen",
    "effort",
)


class Deadzone(DriveEffect):
    """y* = sign(y) max(|y| - w, 0) (the servo of HRP-2: Del Prete et al., 2016, section 3)."""

    id = "deadzone"
    title = "dead zone of the drive"
    equation = "y_eff = sign(y) * max(abs(y) - deadzone, 0)"
    kind = "drive"
    shapes = (Parameter("deadzone", "effort", 0.0, description="half width w", plausible=DEADZONE_RANGE),)
    signature = Signature(x="effort", split="", look_for="a step at zero effort, flat beyond it")

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Half widths up to half of the largest effort."""
        largest = max(abs(context.effort_span[0]), abs(context.effort_span[1]))
        return [{"deadzone": float(w)} for w in np.geomspace(0.003 * largest, 0.5 * largest, 12)]

    def transform(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """See `drake_tc.kernels.equations.dead_zone`."""
        return np.asarray(dead_zone(effort, shape["deadzone"]))

    def kernel(self, parameters: Mapping[str, float], period: float) -> DriveKernel:
        """No memory."""
        width = parameters["deadzone"]
        return memoryless(lambda value, effort, direction: float(dead_zone(value, width)), DEAD_ZONE, (width,))

    def inverse(
        self, effort: FloatArray, position: FloatArray, direction: FloatArray, parameters: Values
    ) -> FloatArray:
        """The command y + w sign(y) jumps over the dead zone."""
        return np.asarray(dead_zone_inverse(effort, parameters["deadzone"], 0.0))

    def inverse_law(self, parameters: Mapping[str, float], smoothing: float) -> InverseLaw:
        """The same, the jump a straight line within +/- `smoothing`."""
        width = parameters["deadzone"]
        return InverseLaw(
            lambda effort, position, direction: float(dead_zone_inverse(effort, width, smoothing)), DEAD_ZONE, width
        )

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 0.05 * n.effort
