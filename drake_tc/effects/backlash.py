"""Play in the gear."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import (
    Context,
    JointNumbers,
    Parameter,
    Plausible,
    Shape,
    Signals,
    Signature,
    TransmissionEffect,
)
from drake_tc.effects.context import BETWEEN_ENCODERS
from drake_tc.effects.kernel import Transmission
from drake_tc.types import FloatArray

CONTACT_STIFFNESS = 2.0e4
"""Stiffness of the closed gear in simulation [N m/rad]."""


BACKLASH_RANGE = Plausible(
    0.0,
    0.1,
    "gears of hobby servos have 1 to 3 degrees of play, worn ones 6 (catalogues of robot gears: below 0.001 rad)",
    sliding=Plausible(0.0, 0.005, "worn racks and lead screws have some mm of play, ball screws below 0.1 mm"),
)


class Backlash(TransmissionEffect):
    """The link hangs back by up to +/- b/2 behind the motor, on the side that the load torque chooses.

    In a log of the link's position under a servo that holds the motor's: q_motor = q + (b/2) sign(tau), so the effort
    is off by that, which costs stiffness times (b/2) sign(tau).
    """

    id = "backlash"
    title = "backlash of the gear"
    equation = "q_motor = q + backlash / 2 * sign(tau)"
    kind = "transmission"
    depends_on_position = True
    coefficients = (Parameter("backlash", "rad", 0.0, 0.5, description="whole gap b", plausible=BACKLASH_RANGE),)
    signature = Signature(x="load_torque", split="", look_for="a step where the load torque changes its sign")

    def obstacle(self, context: Context) -> str:
        """Visible in a servo's effort; between two encoders it shows too, but not in the balance."""
        if context.drive != "position_servo":
            two = "motor_position" in context.recorded
            return BETWEEN_ENCODERS if two else "needs a position servo whose loop is closed on the motor's encoder"
        return super().obstacle(context)

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Stiffness sign(tau)/2 (T, 1)."""
        return 0.5 * signals.stiffness * np.sign(signals.expected_torque)[:, None]

    def transmission(self, parameters: Mapping[str, float]) -> Transmission:
        """Free inside the gap, stiff outside."""
        return Transmission(half_gap=0.5 * parameters["backlash"], compliance=1.0 / CONTACT_STIFFNESS)

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """1 mrad or 0.1 mm, unless less than that costs 5 % of the torque of a stiff servo."""
        play = 1e-4 if context.units.slides else 1e-3
        return min(play, 2.0 * n.gain * n.part) if context.drive == "position_servo" else play
