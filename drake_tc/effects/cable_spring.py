"""A spring along the joint: cables, hoses, a gravity compensator."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Parameter, Shape, Signals, Signature, TorqueEffect
from drake_tc.effects.kernel import TorqueKernel, TorqueParts
from drake_tc.types import FloatArray


class CableSpring(TorqueEffect):
    """k (q - q_0) [N m], as k q - k q_0."""

    id = "cable_spring"
    title = "cable spring"
    kind = "load"
    linear = True
    coefficients = (
        Parameter("spring_stiffness", "N*m/rad"),
        Parameter("spring_preload", "N*m", description="-k q_0"),
    )
    signature = Signature(
        x="position", split="", look_for="a straight line over the angle, the same in both directions"
    )

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 2): see the class."""
        return np.stack([signals.position, np.ones(len(signals))], axis=-1)

    def kernel(self, parameters: Mapping[str, float]) -> TorqueKernel:
        """The same at one instant."""
        stiffness, preload = parameters["spring_stiffness"], parameters["spring_preload"]

        def parts(q: float, v: float, direction: float, tau: float, celsius: float, hysteresis: float) -> TorqueParts:
            return 0.0, 0.0, stiffness * q + preload

        return parts
