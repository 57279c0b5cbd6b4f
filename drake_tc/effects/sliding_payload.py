"""A mass that a joint which slides carries and that the model lacks."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from drake_tc.effects.base import Context, JointNumbers, Parameter, Plausible, Shape, Signature
from drake_tc.effects.equation_effect import EquationEffect
from drake_tc.kernels.torque_equations import CONSTANT
from drake_tc.types import GRAVITY, FloatArray

WEIGHT_RANGE = Plausible(
    -1.0, 1.0, "a mass pulls with no more than the largest forces of drive and load together", "torque"
)
MASS_RANGE = Plausible(0.0, 2000.0, "a mass is positive, and axes of machine tools carry up to two tonnes")
MARGIN = 1.5
"""Over the weight that a mass can have, for the error of both estimates."""


class SlidingPayload(EquationEffect):
    """G_p + M_p qddot [N]: a mass, and its weight along the axis, which does not change with the position.

    |G_p| is at most M_p g.
    """

    id = "payload"
    form = "sliding"
    joint_types = frozenset(("prismatic",))
    torque_kind = CONSTANT
    title = "payload"
    equation = "tau_add = payload_weight + payload_mass * qddot"
    inertia_parameter = "payload_mass"
    kind = "load"
    linear = True
    coefficients = (
        Parameter("payload_weight", "N*m", description="weight along the axis", plausible=WEIGHT_RANGE),
        Parameter("payload_mass", "kg*m^2", 0.0, description="mass", plausible=MASS_RANGE),
    )
    size = ("payload_mass", "kg*m^2")
    signature = Signature(x="acceleration", split="", look_for="a straight line over the acceleration")

    def obstacle(self, context: Context) -> str:
        """Not beside a model of the load that has a mass of its own."""
        if context.load == "links":
            return "a payload is part of the fitted parameters of the link"
        if context.load == "robot":
            return "a payload is looked for on all joints together"
        return context.taken_up

    def inconsistency(self, parameters: Mapping[str, float], context: Context) -> str:
        """The weight along the axis is at most that of the mass."""
        weight, mass = parameters["payload_weight"], parameters["payload_mass"]
        if abs(weight) <= MARGIN * GRAVITY * mass:
            return ""
        return (
            f"A mass of {mass:.3g} kg*m^2 weighs at most {GRAVITY * mass:.3g} N*m, and payload_weight is "
            f"{weight:.3g} N*m."
        )

    def balance_inertia(self, theta: FloatArray, shape: Shape, rotor_inertia: float) -> float:
        """M_p."""
        return float(theta[1])

    def numbers(self, parameters: Mapping[str, Any]) -> tuple[Any, ...]:
        """A constant force."""
        return 0.0, 0.0, parameters["payload_weight"]

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 0.1 * n.inertia if n.inertia > 0.0 else n.part

    def unit_coefficients(self, n: JointNumbers) -> tuple[FloatArray, ...]:
        """See `Effect.unit_coefficients`."""
        return (np.array([0.0, 1.0]),)
