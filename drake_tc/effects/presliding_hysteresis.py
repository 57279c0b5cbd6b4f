"""Friction that has to be wound up after every reversal."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Context, Parameter, Shape, Signals, Signature, TorqueEffect
from drake_tc.effects.kernel import TorqueKernel, TorqueParts
from drake_tc.types import FloatArray


class PreslidingHysteresis(TorqueEffect):
    """-2 F_p exp(-s/s_p) sign(qdot) [N m], s the travel since the last reversal.

    The Dahl model's answer after full sliding: dz/ds = (1 - z sign(qdot))/s_p from z = -sign(qdot).
    """

    id = "presliding_hysteresis"
    title = "presliding hysteresis"
    kind = "friction"
    coefficients = (Parameter("presliding", "N*m", 0.0),)
    shapes = (Parameter("presliding_travel", "rad", 1.5e-3, 1.0, 0.01),)
    signature = Signature(
        x="travel",
        split="direction",
        look_for="a deficit right after reversals that dies out with the distance moved",
    )

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Starting points that cover what the logs excite."""
        span = context.position_span[1] - context.position_span[0]
        return [{"presliding_travel": float(s)} for s in np.geomspace(2e-3, 0.25 * span, 8)]

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 1): see the class."""
        return np.asarray((-2.0 * np.exp(-signals.travel / shape["presliding_travel"]) * signals.direction)[:, None])

    def kernel(self, parameters: Mapping[str, float]) -> TorqueKernel:
        """The same at one instant."""
        level = parameters["presliding"]

        def parts(q: float, v: float, direction: float, tau: float, celsius: float, hysteresis: float) -> TorqueParts:
            return -level, 0.0, level * hysteresis

        return parts

    def hysteresis_travel(self, parameters: Mapping[str, float]) -> float:
        """s_p: the Dahl state takes over the share F_p of the Coulomb friction, after any reversals."""
        return parameters["presliding_travel"]
