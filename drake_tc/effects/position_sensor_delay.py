"""A position channel that comes late."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from drake_tc.effects.base import Context, JointNumbers, Shape, Signals, Signature
from drake_tc.effects.sensor_delay import SensorDelay
from drake_tc.types import FloatArray


class PositionSensorDelay(SensorDelay):
    """q_meas(t) = q(t - d): the encoder, its filter or its bus is late against command and torque.

    To first order the balance misses d times the rate of all that is computed from the position: J qdddot + F_v qddot.

    What tells it apart: a late command shifts torque and motion together, a late torque sensor the torque alone, a late
    encoder the motion alone. Two of the three are known from a log; all three together are one shift of the clock.
    Where the load torque is computed from the position, only the command is left to compare with, and a late encoder
    is a command that is late by the same time. A servo's effort q_d - q holds the position itself: there d acts as
    viscous friction d/K, which is always fitted.
    """

    title = "delay of the position sensor"
    equation = "q_meas(t) = q(t - delay)"
    form = "position_sensor"
    delayed = ("position", "velocity", "acceleration")
    ages_of: ClassVar[Mapping[str, float]] = {"effort": -1.0, "torque": -1.0}
    signature = Signature(
        x="acceleration", split="direction", look_for="loops: the residual follows the rate of the acceleration"
    )

    def obstacle(self, context: Context) -> str:
        """Needs a measured torque, and an effort that does not hold the position."""
        if context.load != "torque":
            return "the load is computed from the position, so that a late encoder is the same as a late command"
        if context.drive == "position_servo":
            return "the effort of a servo contains the position, so that a late encoder acts like viscous friction"
        return super().obstacle(context)

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """J qdddot + F_v qddot (T, 1)."""
        if len(signals) < 2:
            return np.zeros((len(signals), 1))
        jerk = np.gradient(signals.acceleration, signals.period)
        return np.asarray(signals.rotor_inertia * jerk + signals.viscous * signals.acceleration)[:, None]

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 3e-3
