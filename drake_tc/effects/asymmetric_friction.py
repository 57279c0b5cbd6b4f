"""Friction that differs with the direction of motion."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from drake_tc.effects.base import Parameter, Shape, Signals, Signature, TorqueEffect
from drake_tc.effects.kernel import TorqueKernel, TorqueParts
from drake_tc.types import FloatArray


class AsymmetricFriction(TorqueEffect):
    """(A_c sign(qdot) + A_v qdot) sign(qdot) [N m]: F_c +/- A_c and F_v +/- A_v in the two directions."""

    id = "asymmetric_friction"
    title = "direction-dependent friction"
    kind = "friction"
    coefficients: ClassVar[tuple[Parameter, ...]] = (
        Parameter("coulomb_asymmetry", "N*m"),
        Parameter("viscous_asymmetry", "N*m*s/rad"),
    )
    signature = Signature(x="velocity", split="", look_for="both directions shifted the same way, more so at speed")

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 2): see the class."""
        return np.stack([signals.direction**2, np.abs(signals.velocity)], axis=-1)

    def kernel(self, parameters: Mapping[str, float]) -> TorqueKernel:
        """The same at one instant."""
        coulomb, viscous = parameters["coulomb_asymmetry"], parameters["viscous_asymmetry"]

        def parts(q: float, v: float, direction: float, tau: float, celsius: float, hysteresis: float) -> TorqueParts:
            return coulomb * direction, (viscous if v >= 0.0 else -viscous), 0.0

        return parts


class CoulombAsymmetry(AsymmetricFriction):
    """A_c [N m]: only the Coulomb level differs. In motion this is a constant, as a torque sensor's bias is."""

    form = "coulomb"
    coefficients = (Parameter("coulomb_asymmetry", "N*m"),)

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 1): see the class."""
        return np.asarray(signals.direction**2)[:, None]

    def kernel(self, parameters: Mapping[str, float]) -> TorqueKernel:
        """The same at one instant."""
        coulomb = parameters["coulomb_asymmetry"]

        def parts(q: float, v: float, direction: float, tau: float, celsius: float, hysteresis: float) -> TorqueParts:
            return coulomb * direction, 0.0, 0.0

        return parts
