"""Viscous friction that grows less than in proportion to the speed."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from drake_tc.effects.base import Context, EquationEffect, Parameter, Plausible, Shape, Signals, Signature
from drake_tc.kernels.torque_equations import POWER
from drake_tc.types import FloatArray

VISCOUS_POWER_RANGE = Plausible(
    0.0, np.inf, "friction dissipates energy; all friction together must do so at the highest recorded speed"
)
VISCOUS_EXPONENT_RANGE = Plausible(
    0.1,
    0.9,
    "shear-thinning lubricants have exponents of 0.2 to 0.9 (Waiboer, Aarts and Jonker, 2005); nearer to 1 it is "
    "viscous friction",
)


class ViscousPower(EquationEffect):
    """F_p |qdot|^p sign(qdot) [N m], p < 1: a shear-thinning lubricant.

    Beside viscous friction F_v qdot the two coefficients share the line; what is told is their sum's curvature.
    Friction that grows faster than the speed is `quadratic_viscous`.
    Source: Ostwald and de Waele's power law of a lubricant's shear stress; Waiboer, Aarts and Jonker, Velocity
    dependence of joint friction in robotic manipulators with gear transmissions (2005), eq. 9.
    """

    id = "viscous_power"
    torque_kind = POWER
    title = "viscous friction by a power law"
    equation = "tau_add = viscous_power * abs(qdot) ** viscous_exponent * sign(qdot)"
    kind = "friction"
    coefficients = (
        Parameter(
            "viscous_power",
            "N*m*(s/rad)^p",
            0.0,
            description="friction torque at 1 rad/s",
            plausible=VISCOUS_POWER_RANGE,
        ),
    )
    shapes = (
        Parameter(
            "viscous_exponent",
            "-",
            0.1,
            0.9,
            0.5,
            description="exponent p of the velocity",
            plausible=VISCOUS_EXPONENT_RANGE,
        ),
    )
    signature = Signature(x="velocity", split="", look_for="an S that flattens towards the highest speeds")

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Exponents of lubricants."""
        return [{"viscous_exponent": p} for p in (0.2, 0.35, 0.5, 0.65, 0.8)]

    def inconsistency(self, parameters: Mapping[str, float], context: Context) -> str:
        """All friction together must dissipate energy at the highest speed: F_c + F_v v + F_p v^p >= 0."""
        speed = context.max_speed
        dry, viscous = (context.fitted.get(name, np.inf) for name in ("coulomb", "viscous"))
        total = dry + viscous * speed + parameters["viscous_power"] * speed ** parameters["viscous_exponent"]
        if total >= 0.0:
            return ""
        return f"All friction together is {total:.3g} N*m at {speed:.3g} rad/s: it would drive the joint."

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 1), with the sign of the velocity itself: at rest the friction is 0, not a level."""
        return super().columns(replace(signals, direction=np.sign(signals.velocity)), shape)
