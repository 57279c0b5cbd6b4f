"""Friction that differs with the direction of motion."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from drake_tc.effects.base import Context, EquationEffect, JointNumbers, Parameter, Plausible, Signature
from drake_tc.kernels.torque_equations import ASYMMETRY
from drake_tc.types import FloatArray

COULOMB_ASYMMETRY_RANGE = Plausible(
    -1.0,
    1.0,
    "friction dissipates energy in both directions of motion",
    "coulomb",
)
VISCOUS_ASYMMETRY_RANGE = Plausible(
    -1.0,
    1.0,
    "friction cannot exceed the largest torques of drive and load together",
    "torque/speed",
)


class AsymmetricFriction(EquationEffect):
    """(A_c sign(qdot) + A_v qdot) sign(qdot) [N m]: F_c +/- A_c and F_v +/- A_v in the two directions."""

    id = "asymmetric_friction"
    torque_kind = ASYMMETRY
    title = "direction-dependent friction"
    equation = "tau_add = (coulomb_asymmetry * sign(qdot) + viscous_asymmetry * qdot) * sign(qdot)"
    kind = "friction"
    coefficients: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "coulomb_asymmetry",
            "N*m",
            description="half the difference of Coulomb friction between forward and backward motion",
            plausible=COULOMB_ASYMMETRY_RANGE,
        ),
        Parameter(
            "viscous_asymmetry",
            "N*m*s/rad",
            description="half the difference of viscous friction between forward and backward motion",
            plausible=VISCOUS_ASYMMETRY_RANGE,
        ),
    )
    signature = Signature(x="velocity", split="", look_for="both directions shifted the same way, more so at speed")

    def inconsistency(self, parameters: Mapping[str, float], context: Context) -> str:
        """Friction opposes the motion in both directions at the highest speed: F_c + F_v v >= |A_c + A_v v|."""
        speed, fitted = context.max_speed, context.fitted
        mean = fitted.get("coulomb", np.inf) + fitted.get("viscous", np.inf) * speed
        part = abs(parameters["coulomb_asymmetry"] + parameters.get("viscous_asymmetry", 0.0) * speed)
        if part <= mean:
            return ""
        return (
            f"At {speed:.3g} rad/s the directions differ by {part:.3g} N*m from a friction of {mean:.3g} N*m: "
            f"{COULOMB_ASYMMETRY_RANGE.source}."
        )

    def obstacle(self, context: Context) -> str:
        """Not beside an unknown load, which has a column of the same form."""
        return context.taken_up or super().obstacle(context)

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return n.friction

    def unit_coefficients(self, n: JointNumbers) -> tuple[FloatArray, ...]:
        """See `Effect.unit_coefficients`."""
        return (np.array([1.0, n.damping_ratio])[: len(self.coefficients)],)


class CoulombAsymmetry(AsymmetricFriction):
    """A_c [N m]: only the Coulomb level differs. In motion this is a constant, as a torque sensor's bias is."""

    form = "coulomb"
    equation = "tau_add = coulomb_asymmetry"
    coefficients = (
        Parameter(
            "coulomb_asymmetry",
            "N*m",
            description="half the difference of Coulomb friction between forward and backward motion",
            plausible=COULOMB_ASYMMETRY_RANGE,
        ),
    )

    def numbers(self, parameters: Mapping[str, Any]) -> tuple[Any, ...]:
        """A_v is 0."""
        return parameters["coulomb_asymmetry"], 0.0
