"""Friction that changes with temperature."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Parameter, Shape, Signals, Signature, TorqueEffect
from drake_tc.effects.kernel import TorqueKernel, TorqueParts
from drake_tc.types import FloatArray

REFERENCE_CELSIUS = 25.0


class ThermalFriction(TorqueEffect):
    """(F_cT sign(qdot) + F_vT qdot) (T - 25 °C) [N m]."""

    id = "thermal_friction"
    title = "temperature-dependent friction"
    kind = "friction"
    needs = frozenset(["temperature"])
    coefficients = (
        Parameter("coulomb_per_kelvin", "N*m/K"),
        Parameter("viscous_per_kelvin", "N*m*s/(rad*K)"),
    )
    signature = Signature(
        x="temperature", split="direction", look_for="a fan that opens (or closes) as the joint warms up"
    )

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 2): see the class."""
        warmth = (signals.temperature - REFERENCE_CELSIUS) * np.ones(len(signals))
        return np.stack([signals.direction * warmth, signals.velocity * warmth], axis=-1)

    def kernel(self, parameters: Mapping[str, float]) -> TorqueKernel:
        """The same at one instant."""
        coulomb, viscous = parameters["coulomb_per_kelvin"], parameters["viscous_per_kelvin"]

        def parts(q: float, v: float, direction: float, tau: float, celsius: float, hysteresis: float) -> TorqueParts:
            return coulomb * (celsius - REFERENCE_CELSIUS), viscous * (celsius - REFERENCE_CELSIUS), 0.0

        return parts
