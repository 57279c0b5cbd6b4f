"""What every channel that comes late has in common."""

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np

from drake_tc.effects.base import Parameter, Plausible, SensorEffect, Signals
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
