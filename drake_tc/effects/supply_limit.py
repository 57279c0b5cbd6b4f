"""A drive that delivers no more than its supply allows."""

from collections.abc import Mapping
from math import inf, isfinite

import numpy as np

from drake_tc.effects.base import Context, DriveEffect, JointNumbers, Parameter, Plausible, Shape, Signals, Signature
from drake_tc.effects.kernel import DriveKernel
from drake_tc.types import FloatArray

LIMIT_RANGE = Plausible(
    0.0,
    2.0,
    "a limit beyond the recorded efforts never acted, also when the supply was at half of its median",
    "effort/supply",
)


class SupplyLimit(DriveEffect):
    """y* = clip(y, -m V, m V), V the recorded supply voltage: full duty of the bridge.

    m is 1 where the effort is the motor's voltage; of a position servo it holds the gain from rad to volts.
    """

    id = "saturation"
    title = "saturation of the drive at its supply voltage"
    equation = "y_eff = min(max(y, -(limit_per_volt * V)), limit_per_volt * V)"
    kind = "drive"
    form = "supply"
    needs = frozenset({"supply_voltage"})
    shapes = (
        Parameter(
            "limit_per_volt",
            "effort/V",
            0.0,
            default=inf,
            description="largest effort m for 1 V",
            plausible=LIMIT_RANGE,
        ),
    )
    signature = Signature(
        x="effort", split="", look_for="a line that bends at an effort which moves with the supply voltage"
    )

    def obstacle(self, context: Context) -> str:
        """Needs a recorded supply."""
        if context.imposes_current:
            return "a current drive has a limit of the current, which `saturation` describes"
        return super().obstacle(context)

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Limits at the median supply from a fifth of the largest effort up to it."""
        largest = context.scale("effort/supply")
        return [{"limit_per_volt": float(x * largest)} for x in np.linspace(0.2, 0.98, 14)]

    def transform(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """Clip where the supply is known (neither NaN nor 0)."""
        supply = signals.supply_voltage
        known = np.isfinite(supply) & (supply > 0.0)
        limit = np.where(known, shape["limit_per_volt"] * np.where(known, supply, 1.0), inf)
        return np.clip(effort, -limit, limit)

    def kernel(self, parameters: Mapping[str, float], period: float) -> DriveKernel:
        """Memory is [the limit now]."""
        share = parameters["limit_per_volt"]

        def observe(
            position: float, velocity: float, celsius: float, supply: float, memory: list[float], at: int
        ) -> None:
            memory[at] = share * supply if isfinite(supply) and supply > 0.0 else inf

        def step(value: float, effort: float, direction: float, memory: list[float], at: int) -> float:
            limit = memory[at]
            return max(-limit, min(limit, value))

        return DriveKernel(1, lambda value, effort: [inf], step, observe)

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 0.8 * n.effort / max(context.supply_voltage, 1.0) if context.supply_voltage > 0.0 else 0.0
