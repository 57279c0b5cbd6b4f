"""Friction that changes with temperature."""

import numpy as np

from drake_tc.effects.base import Context, EquationEffect, JointNumbers, Parameter, Plausible, Signature
from drake_tc.kernels.torque_equations import THERMAL
from drake_tc.types import FloatArray

COULOMB_PER_KELVIN_RANGE = Plausible(
    -0.2,
    0.2,
    "lubricants change their friction by at most a tenth of it for each kelvin, here twice that, because both are "
    "extrapolated from the temperatures of the log",
    "coulomb",
)
VISCOUS_PER_KELVIN_RANGE = Plausible(
    -0.2,
    0.2,
    "lubricants change their viscosity by at most a tenth of it for each kelvin (mineral oil: 3 to 7 %), here twice "
    "that, because both are extrapolated from the temperatures of the log",
    "viscous",
)
THERMAL_RATE_RANGE = Plausible(
    0.0,
    0.2,
    "the viscosity of lubricants falls by at most a tenth for each kelvin (mineral oil: 3 to 7 %), here twice that "
    "for the error of the estimate",
)


class ThermalFriction(EquationEffect):
    """(F_cT sign(qdot) + F_vT qdot) w(T) [N m],  w = (1 - exp(-r (T - 25 °C)))/r.

    A lubricant's viscosity falls exponentially; r is how fast it settles, r -> 0 a straight line in the temperature.
    """

    id = "thermal_friction"
    torque_kind = THERMAL
    title = "temperature-dependent friction"
    equation = (
        "tau_add = (coulomb_per_kelvin * sign(qdot) + viscous_per_kelvin * qdot)"
        " * (1 - exp(-(thermal_rate * (T - T_25)))) / thermal_rate"
    )
    kind = "friction"
    needs = frozenset({"temperature"})
    coefficients = (
        Parameter(
            "coulomb_per_kelvin",
            "N*m/K",
            description="change of Coulomb friction for 1 K, at 25 °C",
            plausible=COULOMB_PER_KELVIN_RANGE,
        ),
        Parameter(
            "viscous_per_kelvin",
            "N*m*s/(rad*K)",
            description="change of viscous friction for 1 K, at 25 °C",
            plausible=VISCOUS_PER_KELVIN_RANGE,
        ),
    )
    shapes = (
        Parameter(
            "thermal_rate",
            "1/K",
            1e-4,
            0.2,
            1e-4,
            description="rate at which the change levels off with the temperature",
            plausible=THERMAL_RATE_RANGE,
        ),
    )
    signature = Signature(
        x="temperature", split="direction", look_for="a fan that opens (or closes) as the joint warms up"
    )

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Straight, and two exponentials."""
        return [{"thermal_rate": r} for r in (1e-4, 0.015, 0.04)]

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 0.01 * max(n.coulomb, n.part)

    def unit_coefficients(self, n: JointNumbers) -> tuple[FloatArray, ...]:
        """See `Effect.unit_coefficients`."""
        return (np.array([-1.0, -n.damping_ratio]),)
