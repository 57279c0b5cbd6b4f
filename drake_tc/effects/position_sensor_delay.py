"""A position channel that comes late."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from drake_tc.effects.base import Context, Parameter, Plausible, SensorEffect, Shape, Signals, Signature
from drake_tc.types import FloatArray

DELAY_RANGE = Plausible(0.0, 0.05, "encoders, filters and field buses are late by at most some 50 ms, and never early")


class PositionSensorDelay(SensorEffect):
    """q_meas(t) = q(t - d): the encoder, its filter or its bus is late against command and torque.

    To first order the balance misses d times the rate of all that is computed from the position: J qdddot + F_v qddot.

    What tells it apart: a late command shifts torque and motion together, a late torque sensor the torque alone, a late
    encoder the motion alone. Two of the three are known from a log; all three together are one shift of the clock.
    Where the load torque is computed from the position, only the command is left to compare with, and a late encoder
    is a command that is late by the same time. A servo's effort q_d - q holds the position itself: there d acts as
    viscous friction d/K, which is always fitted.
    """

    id = "delay"
    title = "delay of the position sensor"
    kind = "sensor"
    form = "position_sensor"
    linear = True
    coefficients = (Parameter("delay", "s", 0.0, 0.2, plausible=DELAY_RANGE),)
    signature = Signature(
        x="acceleration", split="direction", look_for="loops: the residual follows the rate of the acceleration"
    )

    def obstacle(self, context: Context) -> str:
        """Needs a measured torque, and an effort that does not hold the position."""
        if context.load != "torque":
            return "the load is computed from the position: a late encoder is the same as a late command"
        if context.drive == "position_servo":
            return "a servo's effort holds the position: a late encoder acts as viscous friction"
        return super().obstacle(context)

    def balance_inertia(self, theta: FloatArray, rotor_inertia: float) -> float:
        """None: d F_v is far below any rotor inertia."""
        return 0.0

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """J qdddot + F_v qddot (T, 1)."""
        if len(signals) < 2:
            return np.zeros((len(signals), 1))
        jerk = np.gradient(signals.acceleration, signals.period)
        return np.asarray(signals.rotor_inertia * jerk + signals.viscous * signals.acceleration)[:, None]

    def _shifted(self, signals: Signals, by: FloatArray | float) -> Signals:
        when = signals.time - by
        names = ("position", "velocity", "acceleration")
        late = {name: np.interp(when, signals.time, getattr(signals, name)) for name in names}
        return replace(signals, **late)

    def corrupt(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """Shift position, velocity and acceleration to later times."""
        return self._shifted(signals, parameters["delay"])

    def restore(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """Shift them back; the end holds the last value."""
        return self._shifted(signals, -parameters["delay"])
