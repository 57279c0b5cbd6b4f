"""Load-dependent friction that is higher at low speed."""

import numpy as np

from drake_tc.effects.base import Context, EquationEffect, Parameter, Plausible, Signature
from drake_tc.kernels.torque_equations import LOAD_STRIBECK

LOAD_STRIBECK_RANGE = Plausible(
    0.0,
    1.0,
    "gears that are driven are at least 50 % efficient, from break-away on",
)
LOAD_STRIBECK_VELOCITY_RANGE = Plausible(
    0.0,
    1.0,
    "the Stribeck peak dies out within the recorded speeds; beyond them it is load-dependent friction",
    "speed",
)


class LoadStribeck(EquationEffect):
    """mu_s |tau| exp(-|qdot|/v_s) sign(qdot) [N m]: what load-dependent friction has more at rest than in motion.

    Source: Duclusaud et al., Extended Friction Models for the Physics Simulation of Servo Actuators (2025), the
    load-dependent Stribeck term of their model M5, with exponent 1 and the torque that the gear transmits as load.
    """

    id = "load_stribeck"
    torque_kind = LOAD_STRIBECK
    title = "Stribeck part of load-dependent friction"
    equation = "tau_add = load_stribeck * abs(tau) * exp(-abs(qdot) / load_stribeck_velocity) * sign(qdot)"
    kind = "friction"
    coefficients = (
        Parameter(
            "load_stribeck",
            "-",
            0.0,
            1.0,
            description="additional friction at rest for 1 N·m of load",
            plausible=LOAD_STRIBECK_RANGE,
        ),
    )
    shapes = (
        Parameter(
            "load_stribeck_velocity",
            "rad/s",
            1e-3,
            default=0.3,
            description="velocity at which the additional friction has fallen to 1/e",
            plausible=LOAD_STRIBECK_VELOCITY_RANGE,
        ),
    )
    signature = Signature(
        x="velocity", split="direction", look_for="peaks at zero velocity whose height follows the load"
    )

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Speeds up to a half of the largest."""
        fastest = 0.5 * context.max_speed
        return [{"load_stribeck_velocity": float(v)} for v in np.geomspace(fastest / 30, fastest, 8)]
