"""A gravity load whose centre of mass is not where the model has it when it hangs."""

from collections.abc import Mapping
from typing import Any

from drake_tc.effects.base import Context, EquationEffect, Parameter, Plausible, Signature
from drake_tc.kernels.torque_equations import WAVE

TILT_MOMENT_RANGE = Plausible(
    -0.35,
    0.35,
    "a pendulum mounted by eye is tilted by at most some 20 degrees",
    "load",
)


class LoadTilt(EquationEffect):
    """A cos q [N m]: m g l sin(q - z) has A = -m g l sin z more than the load that hangs at q = 0."""

    id = "load_tilt"
    joint_types = frozenset(("revolute",))
    torque_kind = WAVE
    title = "tilt of the gravity load"
    equation = "tau_add = tilt_moment * cos(q)"
    kind = "load"
    depends_on_position = True
    linear = True
    coefficients = (Parameter("tilt_moment", "N*m", description="A = -m g l sin z", plausible=TILT_MOMENT_RANGE),)
    signature = Signature(x="position", split="", look_for="a cosine of the angle")

    def obstacle(self, context: Context) -> str:
        """Only a load computed from the angle can be tilted; a measured one has all of it."""
        return "" if context.load == "pendulum" else "the load is measured and not computed from the angle"

    def numbers(self, parameters: Mapping[str, Any]) -> tuple[Any, ...]:
        """A wave of one cycle a turn."""
        return parameters["tilt_moment"], 0.0, 1.0
