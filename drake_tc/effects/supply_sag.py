"""A drive that is as strong as the voltage that feeds it."""

from collections.abc import Mapping
from math import isfinite

import numpy as np

from drake_tc.effects.base import Context, DriveEffect, Parameter, Plausible, Shape, Signals, Signature
from drake_tc.effects.kernel import DriveKernel, DriveSurroundings
from drake_tc.types import FloatArray

SENSITIVITY_RANGE = Plausible(
    0.0,
    1.5,
    "the voltage of a bridge is its duty times the supply (sensitivity 1); drives that measure the supply have 0",
)
NOMINAL_RANGE = Plausible(1.0, 1000.0, "servo motors are fed with 3 to 800 V, here with a margin")
LEAST_CHANGE = 0.005
"""Relative change of the supply voltage below which its effect cannot be looked for."""


def supply_change(supply: FloatArray, nominal: float) -> FloatArray:
    """V/V_0 - 1 (T,); 0 where the supply is not known (NaN, or 0)."""
    known = np.isfinite(supply) & (supply > 0.0)
    return np.asarray(np.where(known, np.where(known, supply, nominal) / nominal - 1.0, 0.0))


class SupplySag(DriveEffect):
    """y* = y (1 + s (V/V_0 - 1)), V the recorded supply voltage, V_0 its median in the training runs.

    A drive that sets the duty of a bridge without measuring its supply has s = 1: y* = y V/V_0. One that corrects for
    the supply has s = 0. Linear in s/K, so it is looked for as a column. The compensation takes the supply at V_0.
    """

    id = "supply_sag"
    title = "drive torque that follows the supply voltage"
    equation = "y_eff = y * (1 + supply_sensitivity * (V / nominal_voltage - 1))"
    kind = "drive"
    needs = frozenset({"supply_voltage"})
    coefficients = (Parameter("sag_torque", "N*m/effort", 0.0),)
    given_shapes = (
        Parameter(
            "nominal_voltage",
            "V",
            1e-3,
            default=24.0,
            description="supply voltage V_0 of the drive gain",
            plausible=NOMINAL_RANGE,
        ),
    )
    signature = Signature(
        x="supply_voltage", split="", look_for="a residual that follows the effort, with a slope set by the supply"
    )

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """S and V_0."""
        return (
            Parameter(
                "supply_sensitivity",
                "-",
                0.0,
                10.0,
                description="relative change of the torque over that of the supply voltage",
                plausible=SENSITIVITY_RANGE,
            ),
            *self.given_shapes,
        )

    def obstacle(self, context: Context) -> str:
        """Needs a drive that does not impose its current."""
        if context.imposes_current:
            return "a current drive does not depend on the supply until it saturates"
        return super().obstacle(context)

    def unexcited(self, context: Context) -> str:
        """Needs a supply voltage that changes."""
        if not context.supply_change > LEAST_CHANGE * context.supply_voltage:
            return "the supply voltage hardly changes"
        return ""

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """The recorded median."""
        return [{"nominal_voltage": context.supply_voltage}]

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """-y (V/V_0 - 1) (T, 1)."""
        return -(signals.effort * supply_change(signals.supply_voltage, shape["nominal_voltage"]))[:, None]

    def physical(self, theta: FloatArray, shape: Shape, gain: float) -> dict[str, float]:
        """The sensitivity s = theta K."""
        return {"supply_sensitivity": float(theta[0]) * gain, "nominal_voltage": float(shape["nominal_voltage"])}

    def transform(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """The supply acts through its column."""
        return effort

    def kernel(self, parameters: Mapping[str, float], period: float) -> DriveKernel:
        """Memory is [V/V_0 - 1]; acts on the raw effort, as the column does."""
        sensitivity, nominal = parameters["supply_sensitivity"], parameters["nominal_voltage"]

        def observe(now: DriveSurroundings, memory: list[float], at: int) -> None:
            memory[at] = now.supply / nominal - 1.0 if isfinite(now.supply) and now.supply > 0.0 else 0.0

        def step(value: float, effort: float, direction: float, memory: list[float], at: int) -> float:
            return value + sensitivity * memory[at] * effort

        return DriveKernel(1, lambda value, effort: [0.0], step, observe)
