"""A winding that warms under load and then passes less current for the same voltage."""

import math
from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Context, DriveEffect, Parameter, Plausible, Shape, Signals, Signature
from drake_tc.effects.kernel import DriveKernel
from drake_tc.types import FloatArray

WARM_EFFORT_RANGE = Plausible(
    0.5,
    np.inf,
    "insulation of class H bears 180 degrees Celsius (IEC 60085), which raises the resistance of copper "
    "by at most 70 % while the largest effort is held",
    "effort",
)
WARM_TIME_RANGE = Plausible(
    0.3,
    300.0,
    "data sheets of servo motors give thermal time constants of the winding of 1 to 100 s",
)


class WindingHeat(DriveEffect):
    """y* = y/(1 + w),  T dw/dt = (y/y_w)^2 - w,  w = 0 at the start of a run.

    w is the relative rise of the winding's resistance (0.0039 for each kelvin of copper), heated by y^2 and cooled to
    the case; y_w is the effort that doubles the resistance when it is held. The case's own slow warming is not in it.
    """

    id = "winding_heat"
    title = "heating of the motor's winding"
    equation = "y_eff = y / (1 + w); warm_time * ddt(w) = (y / warm_effort) ** 2 - w"
    kind = "drive"
    shapes = (
        Parameter(
            "warm_effort",
            "effort",
            1e-9,
            default=np.inf,
            description="effort y_w that doubles the resistance",
            plausible=WARM_EFFORT_RANGE,
        ),
        Parameter("warm_time", "s", 0.05, 1000.0, 1.0, description="time constant T", plausible=WARM_TIME_RANGE),
    )
    signature = Signature(x="time", split="", look_for="torque that fades within seconds under a high effort")

    def obstacle(self, context: Context) -> str:
        """A current drive imposes its current whatever the resistance."""
        return "a current drive compensates the resistance of its winding" if context.imposes_current else ""

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Efforts around the largest, time constants of seconds."""
        largest = max(abs(context.effort_span[0]), abs(context.effort_span[1]))
        return [
            {"warm_effort": float(x * largest), "warm_time": t}
            for x in np.geomspace(0.5, 8.0, 5)
            for t in (0.3, 1.0, 3.0, 10.0)
        ]

    def transform(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """Over one stretch; exact for an effort that is held from sample to sample."""
        from scipy.signal import lfilter

        pole = math.exp(-signals.period / shape["warm_time"])
        warmth = lfilter([0.0, 1.0 - pole], [1.0, -pole], (effort / shape["warm_effort"]) ** 2)
        return np.asarray(effort / (1.0 + warmth))

    def kernel(self, parameters: Mapping[str, float], period: float) -> DriveKernel:
        """Memory is [w]."""
        warm = parameters["warm_effort"]
        share = -math.expm1(-period / parameters["warm_time"])

        def step(value: float, effort: float, direction: float, memory: list[float], at: int) -> float:
            rise = memory[at]
            memory[at] = rise + share * ((value / warm) ** 2 - rise)
            return value / (1.0 + rise)

        return DriveKernel(size=1, start=lambda value, effort: [0.0], step=step)
