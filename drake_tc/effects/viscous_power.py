"""Viscous friction that grows less (or more) than in proportion to the speed."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Context, Parameter, Shape, Signals, Signature, TorqueEffect
from drake_tc.effects.kernel import TorqueKernel, TorqueParts
from drake_tc.types import FloatArray


class ViscousPower(TorqueEffect):
    """F_p |qdot|^p sign(qdot) [N m]: a shear-thinning lubricant where p < 1.

    Beside viscous friction F_v qdot the two coefficients share the line; what is told is their sum's curvature.
    Source: Ostwald and de Waele's power law of a lubricant's shear stress; Waiboer, Aarts and Jonker, Velocity
    dependence of joint friction in robotic manipulators with gear transmissions (2005), eq. 9.
    """

    id = "viscous_power"
    title = "viscous friction by a power law"
    kind = "friction"
    coefficients = (Parameter("viscous_power", "N*m*(s/rad)^p"),)
    shapes = (Parameter("viscous_exponent", "-", 0.1, 3.0, 0.5),)
    signature = Signature(x="velocity", split="", look_for="an S that flattens towards the highest speeds")

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Exponents on both sides of 1."""
        return [{"viscous_exponent": p} for p in (0.2, 0.35, 0.5, 0.65, 0.8, 1.5)]

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 1): see the class."""
        speed = np.abs(signals.velocity)
        return np.asarray((np.sign(signals.velocity) * speed ** shape["viscous_exponent"])[:, None])

    def kernel(self, parameters: Mapping[str, float]) -> TorqueKernel:
        """The same at one instant."""
        level, exponent = parameters["viscous_power"], parameters["viscous_exponent"]

        def parts(q: float, v: float, direction: float, tau: float, celsius: float, hysteresis: float) -> TorqueParts:
            return level * abs(v) ** exponent, 0.0, 0.0

        return parts
