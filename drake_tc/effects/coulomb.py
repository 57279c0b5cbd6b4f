"""Coulomb friction."""

from collections.abc import Mapping
from typing import Any

from drake_tc.effects.base import EquationEffect, Parameter, Plausible, Signature
from drake_tc.kernels.torque_equations import CONSTANT

COULOMB_RANGE = Plausible(
    0.0,
    1.0,
    "friction dissipates energy, so it opposes the motion, and it cannot exceed the largest torques of drive and load "
    "together",
    "torque",
)


class Coulomb(EquationEffect):
    """F_c sign(qdot) [N m]; while the direction turns over, F_c times the bristle's deflection in [-1, 1]."""

    id = "coulomb"
    torque_kind = CONSTANT
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

    def numbers(self, parameters: Mapping[str, Any]) -> tuple[Any, ...]:
        """Level F_c."""
        return parameters["coulomb"], 0.0, 0.0
