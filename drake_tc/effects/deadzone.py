"""A drive that ignores small efforts."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Context, DriveEffect, Parameter, Plausible, Shape, Signals, Signature
from drake_tc.effects.kernel import DriveKernel
from drake_tc.types import FloatArray


def apply_deadzone(effort: FloatArray, width: FloatArray | float) -> FloatArray:
    """sign(y) max(|y| - w, 0): elementwise, in the effort's unit."""
    return np.asarray(np.sign(effort) * np.maximum(np.abs(effort) - width, 0.0))


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
        """See `apply_deadzone`."""
        return apply_deadzone(effort, shape["deadzone"])

    def kernel(self, parameters: Mapping[str, float], period: float) -> DriveKernel:
        """No memory."""
        width = parameters["deadzone"]

        def step(value: float, effort: float, direction: float, memory: list[float], at: int) -> float:
            return value - width if value > width else (value + width if value < -width else 0.0)

        return DriveKernel(size=0, start=lambda value, effort: [], step=step)

    def inverse(
        self, effort: FloatArray, direction: FloatArray, parameters: Mapping[str, FloatArray | float]
    ) -> FloatArray:
        """The command y + w sign(y) jumps over the dead zone."""
        return np.asarray(effort + parameters["deadzone"] * np.sign(effort))
