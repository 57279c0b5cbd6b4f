"""Savitzky-Golay filters (`drake_tc.filtering`), and the whitening of residuals (`drake_tc.diagnosis.noise`)."""

import numpy as np

from drake_tc.kernels.compiling import INDEX, MATRIX, OUT_MATRIX, OUT_VECTOR, REAL, VECTOR, helper, kernel, together
from drake_tc.types import FloatArray, IntArray


@helper
def polynomials(memory: FloatArray, table: FloatArray, orders: IntArray, estimate: FloatArray) -> None:
    """y_d = w_d . X of each channel, d = 0, 1, 2; table and orders are the weights of `advance`."""
    n, columns, window = orders.shape[0], table.shape[1], table.shape[0] // 2
    first, distinct = window - int(memory[memory.shape[0] - 1]), columns // 3
    sums = np.zeros((columns, n))
    for k in range(window):
        for c in range(columns):
            weight = table[first + k, c]
            for i in range(n):
                sums[c, i] += weight * memory[k * n + i]
    for d in range(3):
        for i in range(n):
            estimate[d * n + i] = sums[d * distinct + orders[i], i]


@kernel(VECTOR, together(MATRIX, INDEX), OUT_VECTOR, OUT_VECTOR, OUT_VECTOR)
def advance(
    signal: FloatArray,
    weights: tuple[FloatArray, IntArray],
    memory: FloatArray,
    fault: FloatArray,
    estimate: FloatArray,
) -> None:
    """One step of the recursion of `SavitzkyGolayFilter`.

    Args:
        signal: (n,) u[k].
        weights: (2N, 3m) w_d of m orders twice over, so that those of any rotation stand together; (n,) which of the
            orders each channel has.
        memory: (N n + n + 1,) window, started flags and the row of the oldest sample; updated.
        fault: (n,) 1 where u[k] is not finite; written.
        estimate: (3n,) [y_0; y_1; y_2]; written.
    """
    table, orders = weights
    n, window, end = orders.shape[0], table.shape[0] // 2, memory.shape[0] - 1
    oldest = int(memory[end])
    newest = (oldest - 1) % window
    for i in range(n):
        u = signal[i]
        fault[i] = 0.0 if np.isfinite(u) else 1.0
        if fault[i] > 0.0:
            u = memory[newest * n + i]
        elif memory[window * n + i] == 0.0:
            memory[window * n + i] = 1.0
            for k in range(window):
                memory[k * n + i] = u
        memory[oldest * n + i] = u
    memory[end] = (oldest + 1) % window
    polynomials(memory, table, orders, estimate)


@kernel(VECTOR, MATRIX, INDEX, OUT_VECTOR)
def fit(memory: FloatArray, table: FloatArray, orders: IntArray, estimate: FloatArray) -> None:
    """The estimate that belongs to a memory; arguments as `polynomials`."""
    polynomials(memory, table, orders, estimate)


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
    spread, log_determinant, product = ratio, 0.0, 1.0
    step, kept = np.inf, 0.0
    for i in range(rows):
        if apart[i] != step:  # most rows are equally far apart
            step = apart[i]
            kept = np.exp(-step / memory)
        spread = kept * kept * spread + ratio * (1.0 - kept * kept)
        total = spread + white[i]
        gain, scale = spread / total, 1.0 / np.sqrt(total)
        for j in range(columns):
            expected = kept * state[j]
            innovation = values[i, j] - expected
            state[j] = expected + gain * innovation
            out[i, j] = innovation * scale
        spread *= 1.0 - gain
        product *= total
        if not 1e-100 < product < 1e100:  # a logarithm of each costs more than all of the rest
            log_determinant += np.log(product)
            product = 1.0
    return float(log_determinant + np.log(product))
