"""Reflected inertia of the rotor."""

from collections.abc import Mapping
from typing import Any

from drake_tc.effects.base import Context, EquationEffect, JointNumbers, Parameter, Plausible, Shape, Signature
from drake_tc.kernels.torque_equations import CONSTANT
from drake_tc.types import FloatArray

SCREW_RANGE = Plausible(
    0.0,
    1e5,
    "a mass is positive, and a servo motor's rotor of 0.01 kg m^2 on a screw with a lead of 2 mm acts as 98700 kg",
)
ROTOR_INERTIA_RANGE = Plausible(
    0.0,
    300.0,
    "an inertia is positive, and a servo motor's rotor of 0.01 kg m^2 behind a gear of 1:160 reflects 256 kg m^2",
    sliding=SCREW_RANGE,
)


class RotorInertia(EquationEffect):
    """J qddot [N m], J = Jm N^2 on the joint side (Faraji et al., 2015, section II.A)."""

    id = "rotor_inertia"
    torque_kind = CONSTANT
    inertia_parameter = "rotor_inertia"
    title = "reflected rotor inertia"
    equation = "tau_add = rotor_inertia * qddot"
    kind = "load"
    linear = True
    coefficients = (
        Parameter(
            "rotor_inertia",
            "kg*m^2",
            0.0,
            description="inertia of rotor and gear on the link's side of the gear",
            plausible=ROTOR_INERTIA_RANGE,
        ),
    )
    signature = Signature(x="acceleration", split="", look_for="a straight line through zero")

    def obstacle(self, context: Context) -> str:
        """Not beside an unknown load, which has a column of the same form."""
        return context.taken_up or super().obstacle(context)

    def balance_inertia(self, theta: FloatArray, shape: Shape, rotor_inertia: float) -> float:
        """J."""
        return float(theta[0])

    def numbers(self, parameters: Mapping[str, Any]) -> tuple[Any, ...]:
        """Zeros: it is an inertia alone."""
        return 0.0, 0.0, 0.0

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 0.1 * n.inertia if n.inertia > 0.0 else n.part / max(n.speed, 1.0)
