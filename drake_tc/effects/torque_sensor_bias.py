"""A constant error of the torque sensor."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from drake_tc.effects.base import Context, Parameter, SensorEffect, Shape, Signals, Signature
from drake_tc.types import FloatArray


class TorqueSensorBias(SensorEffect):
    """tau_meas = tau + b [N m], so the balance misses -b."""

    id = "torque_sensor_bias"
    title = "torque sensor bias"
    kind = "sensor"
    linear = True
    coefficients = (Parameter("bias", "N*m"),)
    signature = Signature(x="load_torque", split="", look_for="everything shifted by one constant, at rest too")

    def obstacle(self, context: Context) -> str:
        """Needs a torque sensor."""
        return "" if context.load == "torque" else "there is no torque sensor"

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 1): see the class."""
        return -np.ones((len(signals), 1))

    def corrupt(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """Add the bias."""
        return replace(signals, load_torque=signals.load_torque + parameters["bias"])

    def restore(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """Take the bias off."""
        return replace(signals, load_torque=signals.load_torque - parameters["bias"])
