"""Stribeck friction: more at rest than in motion."""

import numpy as np

from drake_tc.effects.base import Context, EquationEffect, JointNumbers, Parameter, Plausible, Signature
from drake_tc.kernels.torque_equations import STRIBECK

STRIBECK_RANGE = Plausible(
    0.0,
    1.0,
    "friction dissipates energy, so it opposes the motion, and it cannot exceed the torque that drive and"
    " load put in; static friction exceeds sliding friction (Armstrong-Hélouvry, Dupont and Canudas de "
    "Wit, 1994)",
    "torque",
)
STRIBECK_VELOCITY_RANGE = Plausible(
    0.0,
    1.0,
    "the Stribeck peak dies out within the recorded speeds; beyond them it is viscous friction",
    "speed",
)
STRIBECK_EXPONENT_RANGE = Plausible(
    0.5,
    2.0,
    "published exponents lie between 0.5 and 2 (Armstrong-Hélouvry, Dupont and Canudas de Wit, 1994)",
)


class Stribeck(EquationEffect):
    """(F_s - F_c) exp(-|qdot/v_s|^m) sign(qdot) [N m].

    Source: Armstrong-Hélouvry, Dupont and Canudas de Wit (1994), eq. 12, exponent m between 0.5 and 2.
    """

    id = "stribeck"
    torque_kind = STRIBECK
    title = "Stribeck friction"
    equation = "tau_add = stribeck * exp(-(abs(qdot) / stribeck_velocity) ** stribeck_exponent) * sign(qdot)"
    kind = "friction"
    coefficients = (
        Parameter("stribeck", "N*m", 0.0, description="height F_s - F_c of the peak at rest", plausible=STRIBECK_RANGE),
    )
    shapes = (
        Parameter(
            "stribeck_velocity",
            "rad/s",
            1e-4,
            default=0.1,
            description="velocity v_s at which the peak has fallen to 1/e",
            plausible=STRIBECK_VELOCITY_RANGE,
        ),
        Parameter(
            "stribeck_exponent",
            "-",
            0.5,
            2.0,
            2.0,
            description="exponent m of the velocity",
            plausible=STRIBECK_EXPONENT_RANGE,
        ),
    )
    signature = Signature(
        x="velocity",
        split="direction",
        look_for="peaks at zero velocity, of opposite sign on both sides, that end within the Stribeck velocity",
    )

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Starting points that cover what the logs excite."""
        fastest = 0.5 * context.max_speed
        return [
            {"stribeck_velocity": float(v), "stribeck_exponent": m}
            for v in np.geomspace(fastest / 120, fastest, 10)
            for m in (1.0, 2.0)
        ]

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 2.0 * n.friction
