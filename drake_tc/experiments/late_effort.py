"""An effort that is recorded after it acts: the check looks for it beside what a diagnosis looks for."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from drake_tc.effects.base import Context, Shape, Signals, Signature
from drake_tc.effects.sensor_delay import SensorDelay
from drake_tc.types import FloatArray


class LateEffort(SensorDelay):
    """y_meas(t) = y(t - d): a filter, a bus or another clock makes the record of the effort late.

    The drive then acts before its record does. In a servo, the derivatives of the command take up what such a delay
    does, so that a log does not tell it.
    """

    title = "delay of the recorded effort"
    equation = "y_meas(t) = y(t - delay)"
    form = "effort_record"
    delayed = ("effort",)
    ages_of: ClassVar[Mapping[str, float]] = {"effort": 1.0}
    signature = Signature(
        x="acceleration", split="direction", look_for="loops: the residual follows the rate of the effort"
    )

    def obstacle(self, context: Context) -> str:
        """Needs a measured torque, and an effort that does not hold the position."""
        if context.drive == "position_servo" or context.load != "torque":
            return "only a measured torque tells when an effort acts that does not hold the position"
        return ""

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Rate of the torque of the drive (T, 1)."""
        if len(signals) < 2:
            return np.zeros((len(signals), 1))
        return np.asarray(np.gradient(signals.expected_torque, signals.period))[:, None]
