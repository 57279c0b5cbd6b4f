"""A winding whose resistance rises with its recorded temperature."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Context, DriveEffect, Parameter, Plausible, Shape, Signals, Signature
from drake_tc.effects.current_lag import BACK_EMF
from drake_tc.effects.kernel import DriveKernel, DriveSurroundings
from drake_tc.kernels.torque_equations import REFERENCE_CELSIUS
from drake_tc.types import FloatArray

COPPER = 0.0039
"""Relative rise of the resistance of copper [1/K] (IEC 60028: 0.00393 at 20 degrees Celsius)."""
COEFFICIENT_RANGE = Plausible(
    0.0,
    0.01,
    "the resistance of copper rises by 0.39 % per kelvin (IEC 60028), magnets lose up to 0.2 % per kelvin more; a "
    "sensor on the case shows half of the winding's rise",
)
LEAST_RISE = 5.0
"""Change of the temperature [K] below which its effect cannot be looked for."""


class WindingTemperature(DriveEffect):
    """R(T) = R_25 r,  r = 1 + a (T - 25 degrees C):  tau_motor = (V/K - F_e qdot)/r for the same voltage.

    The drive acts on y* = y/r, and of the damping by the back-EMF, F_e = k_e/K, which viscous friction holds, the share
    1 - 1/r is missing. K and F_v are those at 25 degrees. Below r = 0.2 the law is not used.
    """

    id = "winding_temperature"
    title = "resistance of the winding that rises with its temperature"
    equation = "y_eff = y / r + back_emf * (1 - 1 / r) * qdot; r = 1 + resistance_per_kelvin * (T - T_25)"
    kind = "drive"
    needs = frozenset({"temperature"})
    coefficients = (Parameter("back_emf_damping", "N*m*s/rad", 0.0, description="F_e"),)
    size = ("back_emf_damping", "N*m*s/rad")
    shapes = (
        Parameter(
            "resistance_per_kelvin",
            "1/K",
            0.0,
            0.02,
            COPPER,
            "relative rise of the resistance for 1 K",
            COEFFICIENT_RANGE,
        ),
    )
    signature = Signature(
        x="temperature", split="", look_for="a residual along the effort that grows as the motor warms"
    )

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """A and k_e."""
        return (*self.shapes, BACK_EMF)

    def obstacle(self, context: Context) -> str:
        """Needs a drive that imposes a voltage."""
        if context.imposes_current:
            return "a current drive compensates the resistance of its winding"
        return super().obstacle(context)

    def unexcited(self, context: Context) -> str:
        """Needs a temperature that changes."""
        low, high = context.temperature_span
        return f"the temperature changes by {high - low:.1f} K only" if high - low < LEAST_RISE else ""

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Around copper's."""
        return [{"resistance_per_kelvin": a} for a in (0.5 * COPPER, COPPER, 2.0 * COPPER)]

    def _resistance(self, celsius: FloatArray, shape: Shape) -> FloatArray:
        return np.maximum(1.0 + shape["resistance_per_kelvin"] * (celsius - REFERENCE_CELSIUS), 0.2)

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """-(1 - 1/r) qdot (T, 1)."""
        lost = 1.0 - 1.0 / self._resistance(signals.temperature, shape)
        return -(lost * signals.velocity)[:, None]

    def physical(self, theta: FloatArray, shape: Shape, gain: float) -> dict[str, float]:
        """k_e = F_e K."""
        named = {p.name: float(shape[p.name]) for p in self.shapes}
        return named | {"back_emf": float(theta[0]) * gain}

    def transform(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """y/r."""
        return np.asarray(effort / self._resistance(signals.temperature, shape))

    def kernel(self, parameters: Mapping[str, float], period: float) -> DriveKernel:
        """y/r + k_e (1 - 1/r) qdot; memory is [1/r, qdot]."""
        rate, constant = parameters["resistance_per_kelvin"], parameters["back_emf"]

        def observe(now: DriveSurroundings, memory: list[float], at: int) -> None:
            memory[at] = 1.0 / max(1.0 + rate * (now.celsius - REFERENCE_CELSIUS), 0.2)
            memory[at + 1] = now.velocity

        def step(value: float, effort: float, direction: float, memory: list[float], at: int) -> float:
            conductance = memory[at]
            return value * conductance + constant * (1.0 - conductance) * memory[at + 1]

        return DriveKernel(2, lambda value, effort: [1.0, 0.0], step, observe)
