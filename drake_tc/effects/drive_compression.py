"""A drive whose torque grows ever more slowly with its effort."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Context, DriveEffect, Parameter, Plausible, Shape, Signals, Signature, Values
from drake_tc.effects.kernel import DriveKernel, memoryless
from drake_tc.types import FloatArray

HALF_EFFORT_RANGE = Plausible(
    0.3,
    np.inf,
    "a drive that loses more than three quarters of its largest effort is defective",
    "effort",
)


class DriveCompression(DriveEffect):
    """y* = y/(1 + |y|/y_h): half of the effort is lost at y = y_h (supply, bridge and brushes that give way)."""

    id = "drive_compression"
    title = "compression of the drive"
    equation = "y_eff = y / (1 + abs(y) / half_effort)"
    kind = "drive"
    shapes = (
        Parameter(
            "half_effort",
            "effort",
            1e-9,
            default=np.inf,
            description="effort y_h of which half arrives",
            plausible=HALF_EFFORT_RANGE,
        ),
    )
    signature = Signature(x="effort", split="", look_for="an S through zero: the slope falls off on both sides")

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """From half of the largest effort to twenty times it."""
        largest = max(abs(context.effort_span[0]), abs(context.effort_span[1]))
        return [{"half_effort": float(x * largest)} for x in np.geomspace(0.5, 20.0, 10)]

    def transform(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """See the class."""
        return np.asarray(effort / (1.0 + np.abs(effort) / shape["half_effort"]))

    def kernel(self, parameters: Mapping[str, float], period: float) -> DriveKernel:
        """No memory."""
        half = parameters["half_effort"]
        return memoryless(lambda value, effort, direction: value / (1.0 + abs(value) / half))

    def inverse(
        self, effort: FloatArray, position: FloatArray, direction: FloatArray, parameters: Values
    ) -> FloatArray:
        """The effort y = y*/(1 - |y*|/y_h), at most 20 times y*: no effort delivers y_h."""
        return np.asarray(effort / np.maximum(1.0 - np.abs(effort) / parameters["half_effort"], 0.05))
