"""A torque sensor that drifts with time."""

from collections.abc import Mapping
from dataclasses import replace

from drake_tc.effects.base import Context, Parameter, SensorEffect, Shape, Signals, Signature
from drake_tc.types import FloatArray


class TorqueSensorDrift(SensorEffect):
    """tau_meas = tau + d t [N m], t since the start of the run."""

    id = "torque_sensor_drift"
    title = "torque sensor drift"
    kind = "sensor"
    linear = True
    coefficients = (Parameter("drift", "N*m/s"),)
    signature = Signature(x="time", split="", look_for="a straight line over the time of every run")

    def obstacle(self, context: Context) -> str:
        """Needs a torque sensor."""
        return "" if context.load == "torque" else "there is no torque sensor"

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 1): see the class."""
        return -signals.time[:, None]

    def corrupt(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """Add the drift."""
        return replace(signals, load_torque=signals.load_torque + parameters["drift"] * signals.time)

    def restore(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """Take the drift off."""
        return replace(signals, load_torque=signals.load_torque - parameters["drift"] * signals.time)
