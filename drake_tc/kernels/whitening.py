"""Whitening of residuals whose noise is white beside a slow process, see `drake_tc.diagnosis.noise`."""

import numpy as np

from drake_tc.kernels.compiling import MATRIX, OUT_MATRIX, REAL, VECTOR, kernel
from drake_tc.types import FloatArray


@kernel(MATRIX, VECTOR, VECTOR, REAL, REAL, OUT_MATRIX)
def whiten(
    values: FloatArray, apart: FloatArray, white: FloatArray, ratio: float, memory: float, out: FloatArray
) -> float:
    """Innovations of each column under n[k] + d[k], n white of variance `white`, d of variance `ratio` and this memory.

    d is an Ornstein-Uhlenbeck process, whose Kalman filter has one state a column and the same gains for all of them.

    Args:
        values: (N, k) columns.
        apart: (N,) time since the row before [s]; infinite where a row has none.
        white: (N,) variances of the white noise, in a unit of variance.
        ratio: Variance of the slow process in that unit.
        memory: Correlation time of the slow process [s].
        out: (N, k) innovations over their standard deviations; written.

    Returns:
        The logarithm of the determinant of the noise's covariance.
    """
    rows, columns = values.shape
    state = np.zeros(columns)
    spread, log_determinant = ratio, 0.0
    for i in range(rows):
        kept = np.exp(-apart[i] / memory)
        spread = kept * kept * spread + ratio * (1.0 - kept * kept)
        total = spread + white[i]
        gain, scale = spread / total, 1.0 / np.sqrt(total)
        for j in range(columns):
            expected = kept * state[j]
            innovation = values[i, j] - expected
            state[j] = expected + gain * innovation
            out[i, j] = innovation * scale
        spread *= 1.0 - gain
        log_determinant += np.log(total)
    return log_determinant
