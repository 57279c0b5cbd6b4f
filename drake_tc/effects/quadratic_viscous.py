"""Friction that grows with the square of the speed."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Parameter, Plausible, Shape, Signals, Signature, TorqueEffect
from drake_tc.effects.kernel import TorqueKernel, TorqueParts
from drake_tc.types import FloatArray

QUADRATIC_VISCOUS_RANGE = Plausible(
    0.0,
    1.0,
    "churning and windage grow with the square of the speed and dissipate energy; friction that flattens "
    "with the speed is a power law below 1",
    "torque/speed^2",
)


class QuadraticViscous(TorqueEffect):
    """F_q qdot |qdot| [N m]."""

    id = "quadratic_viscous"
    title = "quadratic viscous friction"
    equation = "tau_add = quadratic_viscous * qdot * abs(qdot)"
    kind = "friction"
    coefficients = (
        Parameter(
            "quadratic_viscous",
            "N*m*s^2/rad^2",
            description="friction torque at 1 rad/s that grows with the square of the velocity",
            plausible=QUADRATIC_VISCOUS_RANGE,
        ),
    )
    signature = Signature(
        x="velocity", split="", look_for="an S that steepens (or flattens) towards the highest speeds"
    )

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 1): see the class."""
        return (signals.velocity * np.abs(signals.velocity))[:, None]

    def kernel(self, parameters: Mapping[str, float]) -> TorqueKernel:
        """The same at one instant."""
        quadratic = parameters["quadratic_viscous"]

        def parts(q: float, v: float, direction: float, tau: float, celsius: float, hysteresis: float) -> TorqueParts:
            return 0.0, quadratic * abs(v), 0.0

        return parts
