"""A torque sensor that drifts with time."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from drake_tc.effects.base import Context, JointNumbers, Parameter, Plausible, SensorEffect, Shape, Signals, Signature
from drake_tc.types import FloatArray

DRIFT_RANGE = Plausible(
    -1.0,
    1.0,
    "a sensor that drifts by more than the largest torque it recorded within one run is defective (data "
    "sheets: below 1 % of full scale for 10 K)",
    "load/duration",
)


class TorqueSensorDrift(SensorEffect):
    """tau_meas = tau + d t [N m], t since the start of the run."""

    id = "torque_sensor_drift"
    title = "torque sensor drift"
    equation = "tau_meas = tau + drift * t"
    kind = "sensor"
    linear = True
    coefficients = (Parameter("drift", "N*m/s", description="change of the reading in 1 s", plausible=DRIFT_RANGE),)
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

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return n.friction / (context.duration if np.isfinite(context.duration) else 30.0)
