"""A constant error of the torque sensor."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from drake_tc.effects.base import Context, JointNumbers, Parameter, Plausible, SensorEffect, Shape, Signals, Signature
from drake_tc.types import FloatArray

BIAS_RANGE = Plausible(
    -1.0,
    1.0,
    "a sensor whose zero is off by more than the largest torque it recorded is defective (data sheets: 1 "
    "to 2 % of full scale, some 20 % after mounting)",
    "load",
)


class TorqueSensorBias(SensorEffect):
    """tau_meas = tau + b [N m], so the balance misses -b."""

    id = "torque_sensor_bias"
    title = "torque sensor bias"
    equation = "tau_meas = tau + bias"
    kind = "sensor"
    linear = True
    coefficients = (Parameter("bias", "N*m", description="reading without a torque", plausible=BIAS_RANGE),)
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

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return n.friction
