"""Channels of the torque and of the position that come late."""

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np

from drake_tc.effects.base import Context, JointNumbers, Parameter, Plausible, SensorEffect, Shape, Signals, Signature
from drake_tc.types import FloatArray

DELAY_RANGE = Plausible(
    0.0, 0.05, "encoders, torque sensors, filters and field buses are late by at most some 50 ms, and never early"
)


class SensorDelay(SensorEffect):
    """x_meas(t) = x(t - d) for the signals x of one sensor.

    Subclasses name the signals, and give the column by which the delay unbalances the joint: to first order it misses d
    times the rate of what is computed from them.
    """

    id = "delay"
    kind = "sensor"
    linear = True
    delayed: ClassVar[tuple[str, ...]]
    """Fields of `Signals` that come late."""
    coefficients = (Parameter("delay", "s", 0.0, 0.2, description="age of the reading", plausible=DELAY_RANGE),)

    def _shifted(self, signals: Signals, by: FloatArray | float) -> Signals:
        when = signals.time - by
        return replace(
            signals, **{name: np.interp(when, signals.time, getattr(signals, name)) for name in self.delayed}
        )

    def corrupt(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """Shift the signals to later times; the start holds the first value."""
        return self._shifted(signals, parameters["delay"])

    def restore(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """Shift them back; the end holds the last value."""
        return self._shifted(signals, -parameters["delay"])


class TorqueSensorDelay(SensorDelay):
    """tau_meas(t) = tau(t - d): the sensor, its filter or its bus is late against encoder and command.

    To first order the balance misses d times the rate of the torque.
    """

    title = "delay of the torque sensor"
    equation = "tau_meas(t) = tau(t - delay)"
    form = "torque_sensor"
    delayed = ("load_torque",)
    ages_of: ClassVar[Mapping[str, float]] = {"torque": 1.0}
    signature = Signature(
        x="acceleration", split="direction", look_for="loops: the residual follows the rate of the load"
    )

    def obstacle(self, context: Context) -> str:
        """Needs a torque sensor."""
        return "" if context.load == "torque" else "there is no torque sensor"

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Rate of the slow torque (T, 1)."""
        if len(signals) < 2:
            return np.zeros((len(signals), 1))
        return np.asarray(np.gradient(signals.slow_torque, signals.period))[:, None]

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 3e-3


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
