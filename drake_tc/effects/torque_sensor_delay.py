"""A torque channel that comes late."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from drake_tc.effects.base import Context, JointNumbers, Shape, Signals, Signature
from drake_tc.effects.sensor_delay import SensorDelay
from drake_tc.types import FloatArray


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
