"""The reading of a tick, see `drake_tc.sensing.sensor`."""

import numpy as np

from drake_tc.kernels.compiling import INDEX, MATRIX, OUT_VECTOR, VECTOR, WHOLE, kernel
from drake_tc.types import FloatArray, IntArray

_TICK, _STUCK, _OFFSET = range(3)


@kernel(VECTOR, MATRIX, WHOLE, VECTOR, VECTOR, MATRIX, INDEX, OUT_VECTOR)
def reading(
    truth: FloatArray,
    rows: FloatArray,
    at: int,
    ring: FloatArray,
    last: FloatArray,
    channels: FloatArray,
    layout: IntArray,
    out: FloatArray,
) -> None:
    """y[n] of `SensorBase`.

    Args:
        truth: (n,) u[n]; not looked at by a sensor with latency.
        rows: (B, ...) [k, any m, o, m, a] of some ticks, m and a where the sensor has them.
        at: Row of this tick.
        ring: (L n,) the true values of the last L ticks; empty for a sensor that reads the present one.
        last: (n,) last finite reading; empty for a sensor that is never stuck.
        channels: (2, n) scale and resolution, 0 for none.
        layout: (2,) latency [ticks], and where in a row the additional ages begin, 0 for none.
        out: (n,) written.
    """
    n, row = out.shape[0], rows[at]
    length, tick = ring.shape[0] // n, int(row[_TICK])
    for i in range(n):
        age = layout[0]
        if layout[1]:
            age += int(row[layout[1] + i])
        u = ring[(tick - age) % length * n + i] if age else truth[i]
        y, step = channels[0, i] * u + row[_OFFSET + i], channels[1, i]
        if step > 0.0:
            y = np.rint(y / step) * step
        if row[_STUCK] and row[_OFFSET + n + i] > 0.0 and np.isfinite(last[i]):
            y = last[i]
        out[i] = y
