"""Readings of an IMU that are `age` old, carried to the tick.

With x the reading at tick n, of the time t_n - age, and m its low pass of time T:

    slope = k (x - m)/dt,   m+ = m + k (x - m),   k = dt/(T + dt),   now = x + age slope

`now` stands for the step that ends at the tick, as the reading of a gyro does that averages over its period (and the
velocity of a discrete plant). Of a sinusoid of w [rad/s] it is, with z = e^(i w dt), the truth times

    e^(-i w age) (1 + age S),   S = (k/dt) (1 - z^-1)/(1 - (1 - k) z^-1) = i w/(1 + i w T) + O(dt)

which is off by w^2 age (T + age/2 + dt/2), to the lowest order, instead of w age. Noise grows by 1 + k age/dt in one
reading, but not in an angle: slopes telescope.
"""

import numpy as np

from drake_tc.types import FloatArray

SLOPE_TIME = 5e-3
"""T of the low pass behind the slopes [s]."""


def carried(reading: FloatArray, trail: FloatArray, age: float, period: float) -> tuple[FloatArray, FloatArray]:
    """((6,) now, (6,) m of the next tick).

    Args:
        reading: (6,) x, [gyro; accel] in the IMU's axes [rad/s, m/s^2].
        trail: (6,) m.
        age: Of the reading [s].
        period: Of a tick [s].
    """
    rise = (period / (SLOPE_TIME + period)) * (reading - trail)
    return reading + (age / period) * rise, np.asarray(trail + rise)
