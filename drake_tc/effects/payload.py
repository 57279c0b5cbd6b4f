"""A mass on the link that the model does not carry."""

import math
from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Parameter, Shape, Signals, Signature, TorqueEffect
from drake_tc.effects.kernel import TorqueKernel, TorqueParts
from drake_tc.types import FloatArray


class Payload(TorqueEffect):
    """G_p sin(q - q_h) + J_p qddot [N m]: first moment times gravity, and its inertia; q_h = 0 is hanging."""

    id = "payload"
    title = "payload"
    kind = "load"
    linear = True
    coefficients = (
        Parameter("payload_moment", "N*m", 0.0, description="m g l"),
        Parameter("payload_inertia", "kg*m^2", 0.0, description="m l^2"),
    )
    signature = Signature(
        x="position", split="", look_for="a sine of the angle that comes with a line over the acceleration"
    )

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 2): see the class."""
        return np.stack([np.sin(signals.position), signals.acceleration], axis=-1)

    def kernel(self, parameters: Mapping[str, float]) -> TorqueKernel:
        """The same at one instant."""
        moment = parameters["payload_moment"]

        def parts(q: float, v: float, direction: float, tau: float, celsius: float, hysteresis: float) -> TorqueParts:
            return 0.0, 0.0, moment * math.sin(q)

        return parts

    def inertia(self, parameters: Mapping[str, float]) -> float:
        """J_p."""
        return parameters["payload_inertia"]
