"""Viscous drag of a seal that is not centred: it varies once per turn of the joint."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Parameter, Plausible, Shape, Signals, Signature, TorqueEffect
from drake_tc.effects.kernel import TorqueKernel, TorqueParts
from drake_tc.types import FloatArray

AMPLITUDE = Plausible(
    -1.0,
    1.0,
    "the drag opposes the motion at every angle, so its variation is smaller than the viscous friction",
    "viscous",
)


class SealDrag(TorqueEffect):
    """(c cos q + s sin q) qdot [N m]."""

    id = "seal_drag"
    title = "Eccentric seal"
    kind = "friction"
    equation = "tau_add = (cosine_drag * cos(q) + sine_drag * sin(q)) * qdot"
    coefficients = (
        Parameter("cosine_drag", "N*m*s/rad", plausible=AMPLITUDE),
        Parameter("sine_drag", "N*m*s/rad", plausible=AMPLITUDE),
    )
    signature = Signature(x="position", split="direction", look_for="two waves of opposite sign, one per direction")
    isolated_by = "turn at constant speed over a whole turn, at three speeds"
    depends_on_position = True

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """(T, 2): the torque for one unit of each coefficient, at every sample of a log."""
        waves = np.stack([np.cos(signals.position), np.sin(signals.position)], axis=-1)
        return waves * signals.velocity[:, None]

    def kernel(self, parameters: Mapping[str, float]) -> TorqueKernel:
        """The same at one joint and one instant, for the simulation."""
        cosine, sine = parameters["cosine_drag"], parameters["sine_drag"]

        def parts(q: float, v: float, direction: float, tau: float, celsius: float, hysteresis: float) -> TorqueParts:
            return 0.0, cosine * float(np.cos(q)) + sine * float(np.sin(q)), 0.0

        return parts
