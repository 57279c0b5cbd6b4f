"""Viscous friction."""

from collections.abc import Mapping
from typing import Any

from drake_tc.effects.base import EquationEffect, Parameter, Plausible, Signature
from drake_tc.kernels.torque_equations import CONSTANT

VISCOUS_RANGE = Plausible(
    0.0,
    1.0,
    "friction dissipates energy, so it opposes the motion, and it cannot exceed the largest torques of drive and load "
    "together",
    "torque/speed",
)


class Viscous(EquationEffect):
    """F_v qdot [N m]. Holds the drive's own damping too (back-EMF, servo damping): one log cannot tell them apart."""

    id = "viscous"
    torque_kind = CONSTANT
    title = "viscous friction"
    equation = "tau_add = viscous * qdot"
    kind = "friction"
    linear = True
    coefficients = (
        Parameter("viscous", "N*m*s/rad", 0.0, description="friction torque at 1 rad/s", plausible=VISCOUS_RANGE),
    )
    signature = Signature(x="velocity", split="", look_for="a straight line through zero")

    def numbers(self, parameters: Mapping[str, Any]) -> tuple[Any, ...]:
        """Damping F_v."""
        return 0.0, parameters["viscous"], 0.0
