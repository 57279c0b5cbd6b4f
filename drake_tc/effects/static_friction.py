"""A joint that sticks: static friction that exceeds sliding friction by much, at standstill only."""

import math
from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Context, Parameter, Plausible, Shape, Signals, Signature, TorqueEffect
from drake_tc.effects.kernel import TorqueKernel, TorqueParts
from drake_tc.types import FloatArray

EXCESS_RANGE = Plausible(
    0.0,
    1.0,
    "static friction exceeds sliding friction (Armstrong-Hélouvry, Dupont and Canudas de Wit, 1994), and a joint that "
    "moved was broken away by the largest torques of drive and load together",
    "torque",
)
SPEED_RANGE = Plausible(0.0, 1.0, "the speed below which the joint counts as sticking is within the log", "speed")


class StaticFriction(TorqueEffect):
    """(F_s - F_c) exp(-(qdot/v_b)^2) sign(qdot) [N m], v_b so small that no sliding row of a log sees it.

    A Stribeck peak is seen while the joint slides slowly; this one only as the effort at which the joint breaks away.
    The regression takes no rows at rest, where friction can be anything up to its limit, so the effect is not searched
    for: `drake_tc.identification.break_away` finds the level from the events in which the joint starts to move.
    """

    id = "static_friction"
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
        return "rows at rest take no part in the fit: it is found from the efforts at which the joint breaks away"

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 1): see the class."""
        decay = np.exp(-((signals.velocity / shape["break_away_speed"]) ** 2))
        return np.asarray((signals.direction * decay)[:, None])

    def kernel(self, parameters: Mapping[str, float]) -> TorqueKernel:
        """The same at one instant."""
        excess, speed = parameters["static_excess"], parameters["break_away_speed"]

        def parts(q: float, v: float, direction: float, tau: float, celsius: float, hysteresis: float) -> TorqueParts:
            return excess * math.exp(-((v / speed) ** 2)), 0.0, 0.0

        return parts
