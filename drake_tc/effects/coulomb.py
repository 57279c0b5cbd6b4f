"""Coulomb friction."""

from collections.abc import Mapping

from drake_tc.effects.base import Parameter, Plausible, Shape, Signals, Signature, TorqueEffect
from drake_tc.effects.kernel import TorqueKernel, TorqueParts
from drake_tc.types import FloatArray

COULOMB_RANGE = Plausible(
    0.0,
    1.0,
    "friction dissipates energy, so it opposes the motion, and it cannot exceed the largest torques of drive and load "
    "together",
    "torque",
)


class Coulomb(TorqueEffect):
    """F_c sign(qdot) [N m]; while the direction turns over, F_c times the bristle's deflection in [-1, 1]."""

    id = "coulomb"
    title = "Coulomb friction"
    equation = "tau_add = coulomb * sign(qdot)"
    kind = "friction"
    coefficients = (
        Parameter(
            "coulomb",
            "N*m",
            0.0,
            description="friction torque while the joint moves, at any speed",
            plausible=COULOMB_RANGE,
        ),
    )
    signature = Signature(x="velocity", split="direction", look_for="a step at zero velocity")

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 1): see the class."""
        return signals.direction[:, None]

    def kernel(self, parameters: Mapping[str, float]) -> TorqueKernel:
        """The same at one instant."""
        level = parameters["coulomb"]

        def parts(q: float, v: float, direction: float, tau: float, celsius: float, hysteresis: float) -> TorqueParts:
            return level, 0.0, 0.0

        return parts
