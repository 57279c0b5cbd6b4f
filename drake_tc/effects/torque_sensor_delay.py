"""A torque channel that comes late."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from drake_tc.effects.base import Context, Parameter, Plausible, SensorEffect, Shape, Signals, Signature
from drake_tc.types import FloatArray

DELAY_RANGE = Plausible(
    0.0,
    0.05,
    "sensor filters and field buses are late by at most some 50 ms, and never early",
)


class TorqueSensorDelay(SensorEffect):
    """tau_meas(t) = tau(t - d): the sensor, its filter or its bus is late against encoder and command.

    To first order the balance misses d times the rate of the torque.
    """

    id = "delay"
    title = "delay of the torque sensor"
    kind = "sensor"
    form = "torque_sensor"
    linear = True
    coefficients = (Parameter("delay", "s", 0.0, 0.2, plausible=DELAY_RANGE),)
    signature = Signature(
        x="acceleration", split="direction", look_for="loops: the residual follows the rate of the load"
    )

    def obstacle(self, context: Context) -> str:
        """Needs a torque sensor."""
        return "" if context.load == "torque" else "there is no torque sensor"

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """D tau/dt (T, 1), from the slow torque."""
        if len(signals) < 2:
            return np.zeros((len(signals), 1))
        return np.asarray(np.gradient(signals.slow_torque, signals.period))[:, None]

    def corrupt(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """Shift the torque to later times."""
        when = signals.time - parameters["delay"]
        return replace(signals, load_torque=np.interp(when, signals.time, signals.load_torque))

    def restore(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """Shift it back; the end holds the last value."""
        when = signals.time + parameters["delay"]
        return replace(signals, load_torque=np.interp(when, signals.time, signals.load_torque))
