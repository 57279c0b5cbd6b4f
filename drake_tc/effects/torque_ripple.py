"""Torque that varies with the angle: cogging, gear meshing, ripple."""

import math
from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Context, Parameter, Shape, Signals, Signature, TorqueEffect
from drake_tc.effects.kernel import TorqueKernel, TorqueParts
from drake_tc.types import FloatArray


class TorqueRipple(TorqueEffect):
    """R_1 cos(n q) + R_2 sin(n q) [N m], n cycles a turn."""

    id = "torque_ripple"
    title = "torque ripple"
    kind = "load"
    coefficients = (
        Parameter("ripple_cosine", "N*m"),
        Parameter("ripple_sine", "N*m"),
    )
    shapes = (Parameter("cycles_per_turn", "1/turn", 1.5, 2000.0, 20.0),)
    signature = Signature(
        x="position modulo period",
        split="direction",
        look_for="a wave over one period, the same in both directions",
    )

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Starting points that cover what the logs excite."""
        turns = (context.position_span[1] - context.position_span[0]) / (2 * np.pi)
        return [
            {"cycles_per_turn": float(n)}
            for n in np.arange(max(2.0, 1.2 / turns), min(420.0, 200 / turns), 0.35 / turns)
        ]

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 2): see the class."""
        phase = shape["cycles_per_turn"] * signals.position
        return np.stack([np.cos(phase), np.sin(phase)], axis=-1)

    def kernel(self, parameters: Mapping[str, float]) -> TorqueKernel:
        """The same at one instant."""
        cosine, sine = parameters["ripple_cosine"], parameters["ripple_sine"]
        cycles = parameters["cycles_per_turn"]

        def parts(q: float, v: float, direction: float, tau: float, celsius: float, hysteresis: float) -> TorqueParts:
            return 0.0, 0.0, cosine * math.cos(cycles * q) + sine * math.sin(cycles * q)

        return parts
