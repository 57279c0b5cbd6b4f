"""A joint that sticks: static friction that exceeds sliding friction by much, at standstill only."""

from collections.abc import Mapping
from typing import Any

from drake_tc.effects.base import Context, EquationEffect, Parameter, Plausible, Signature
from drake_tc.kernels.torque_equations import STRIBECK

EXCESS_RANGE = Plausible(
    0.0,
    1.0,
    "static friction exceeds sliding friction (Armstrong-Hélouvry, Dupont and Canudas de Wit, 1994), and a joint that "
    "moved was broken away by the largest torques of drive and load together",
    "torque",
)
SPEED_RANGE = Plausible(0.0, 1.0, "the speed below which the joint counts as sticking is within the log", "speed")


class StaticFriction(EquationEffect):
    """(F_s - F_c) exp(-(qdot/v_b)^2) sign(qdot) [N m], v_b so small that no sliding row of a log sees it.

    A Stribeck peak is seen while the joint slides slowly; this one only as the effort at which the joint breaks away.
    The regression takes no rows at rest, where friction can be anything up to its limit, so the effect is not searched
    for: a model file states its level.
    """

    id = "static_friction"
    torque_kind = STRIBECK
    title = "static friction"
    equation = "tau_add = static_excess * exp(-(qdot / break_away_speed) ** 2) * sign(qdot)"
    kind = "friction"
    coefficients = (
        Parameter(
            "static_excess", "N*m", 0.0, description="F_s - F_c, beyond the Coulomb friction", plausible=EXCESS_RANGE
        ),
    )
    given_shapes = (
        Parameter("break_away_speed", "rad/s", 1e-5, default=1e-2, description="v_b", plausible=SPEED_RANGE),
    )
    signature = Signature(
        x="effort",
        split="direction",
        look_for="stretches at rest that end at one and the same effort in each direction",
    )

    def obstacle(self, context: Context) -> str:
        """Rows at rest take no part in a regression."""
        return "rows at rest take no part in the fit"

    def numbers(self, parameters: Mapping[str, Any]) -> tuple[Any, ...]:
        """Those of a Stribeck peak of exponent 2."""
        return parameters["static_excess"], parameters["break_away_speed"], 2.0
