"""Viscous friction."""

from collections.abc import Mapping

from drake_tc.effects.base import Parameter, Plausible, Shape, Signals, Signature, TorqueEffect
from drake_tc.effects.kernel import TorqueKernel, TorqueParts
from drake_tc.types import FloatArray

VISCOUS_RANGE = Plausible(
    0.0,
    1.0,
    "friction dissipates energy, so it opposes the motion, and it cannot exceed the largest torques of drive and load "
    "together",
    "torque/speed",
)


class Viscous(TorqueEffect):
    """F_v qdot [N m]. Holds the drive's own damping too (back-EMF, servo damping): one log cannot tell them apart."""

    id = "viscous"
    title = "viscous friction"
    equation = "tau_add = viscous * qdot"
    kind = "friction"
    linear = True
    coefficients = (
        Parameter("viscous", "N*m*s/rad", 0.0, description="friction torque at 1 rad/s", plausible=VISCOUS_RANGE),
    )
    signature = Signature(x="velocity", split="", look_for="a straight line through zero")

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 1): see the class."""
        return signals.velocity[:, None]

    def kernel(self, parameters: Mapping[str, float]) -> TorqueKernel:
        """The same at one instant."""
        damping = parameters["viscous"]

        def parts(q: float, v: float, direction: float, tau: float, celsius: float, hysteresis: float) -> TorqueParts:
            return 0.0, damping, 0.0

        return parts
