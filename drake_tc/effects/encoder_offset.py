"""A joint encoder whose zero is not where the model has it."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from drake_tc.effects.base import Context, JointNumbers, Parameter, Plausible, SensorEffect, Shape, Signals, Signature
from drake_tc.types import FloatArray

OFFSET_RANGE = Plausible(
    -0.35,
    0.35,
    "a joint zeroed by eye or on the wrong spline tooth is off by at most some 20 degrees",
    sliding=Plausible(
        -0.05, 0.05, "an axis that was zeroed by eye, or one turn of its screw away, is off by at most some 50 mm"
    ),
)


class EncoderOffset(SensorEffect):
    """q_meas = q + o [rad]: a load computed from the position is off by o d tau/d q, a position servo's effort by o."""

    id = "encoder_offset"
    title = "encoder offset"
    equation = "q_meas = q + offset"
    kind = "sensor"
    depends_on_position = True
    linear = True
    coefficients = (Parameter("offset", "rad", description="reading at the true position 0", plausible=OFFSET_RANGE),)
    signature = Signature(
        x="position", split="", look_for="a constant (servo) or a cosine of the angle (pendulum load)"
    )

    def obstacle(self, context: Context) -> str:
        """Empty when the logs can show the effect."""
        if context.taken_up:
            return context.taken_up
        if context.drive != "position_servo" and context.load in ("robot", "links"):
            return "the loads of other joints depend on the encoder's zero too: it is looked for on all joints together"
        if context.drive != "position_servo" and context.load != "pendulum":
            return "neither the effort nor the load depends on the encoder's zero"
        return super().obstacle(context)

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 1): see the class."""
        return -(signals.load_slope + signals.stiffness * np.ones(len(signals)))[:, None]

    def corrupt(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """Shift the logged position."""
        return replace(signals, position=signals.position + parameters["offset"])

    def restore(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """Shift the position back."""
        return replace(signals, position=signals.position - parameters["offset"])

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return n.gain * n.part if context.drive == "position_servo" else 0.01
