"""A gravity load whose centre of mass is not where the model has it when it hangs."""

import math
from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Context, Parameter, Plausible, Shape, Signals, Signature, TorqueEffect
from drake_tc.effects.kernel import TorqueKernel, TorqueParts
from drake_tc.types import FloatArray

TILT_MOMENT_RANGE = Plausible(
    -0.35,
    0.35,
    "a pendulum mounted by eye is tilted by at most some 20 degrees",
    "load",
)


class LoadTilt(TorqueEffect):
    """A cos q [N m]: m g l sin(q - z) has A = -m g l sin z more than the load that hangs at q = 0."""

    id = "load_tilt"
    title = "tilt of the gravity load"
    equation = "tau_add = tilt_moment * cos(q)"
    kind = "load"
    depends_on_position = True
    linear = True
    coefficients = (Parameter("tilt_moment", "N*m", description="A = -m g l sin z", plausible=TILT_MOMENT_RANGE),)
    signature = Signature(x="position", split="", look_for="a cosine of the angle")

    def obstacle(self, context: Context) -> str:
        """Only a load computed from the angle can be tilted; a measured one has all of it."""
        return "" if context.load == "pendulum" else "the load is measured, not computed from the angle"

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 1): see the class."""
        return np.cos(signals.position)[:, None]

    def kernel(self, parameters: Mapping[str, float]) -> TorqueKernel:
        """The same at one instant."""
        moment = parameters["tilt_moment"]

        def parts(q: float, v: float, direction: float, tau: float, celsius: float, hysteresis: float) -> TorqueParts:
            return 0.0, 0.0, moment * math.cos(q)

        return parts
