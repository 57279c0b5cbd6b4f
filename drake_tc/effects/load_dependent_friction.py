"""Friction that grows with the load on the gear."""

from collections.abc import Mapping
from typing import Any

from drake_tc.effects.base import Context, EquationEffect, JointNumbers, Parameter, Plausible, Signature
from drake_tc.kernels.torque_equations import LOAD_FRICTION

LOAD_FRICTION_RANGE = Plausible(
    0.0,
    1.0,
    "gears that are driven are at least 50 % efficient (efficiency 1/(1 + mu)); catalogues of harmonic "
    "and planetary gears give 60 to 97 %",
)


class LoadDependentFriction(EquationEffect):
    """mu |tau| sign(qdot) [N m], tau the transmitted torque on the link side (inertia of the link included)."""

    id = "load_dependent_friction"
    torque_kind = LOAD_FRICTION
    title = "load-dependent friction"
    equation = "tau_add = load_friction * abs(tau) * sign(qdot)"
    kind = "friction"
    coefficients = (
        Parameter(
            "load_friction",
            "-",
            0.0,
            1.0,
            description="friction torque for 1 N·m of load",
            plausible=LOAD_FRICTION_RANGE,
        ),
    )
    signature = Signature(
        x="load_torque", split="direction", look_for="a V for one direction, an inverted V for the other"
    )

    def numbers(self, parameters: Mapping[str, Any]) -> tuple[Any, ...]:
        """The same mu whichever side drives."""
        return parameters["load_friction"], parameters["load_friction"]

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 0.1
