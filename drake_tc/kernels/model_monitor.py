"""One tick of `drake_tc.watch.monitor.ModelMonitor`: whitened residual, CUSUMs, information, cause; see there.

State of a joint: ticks to the next row, ticks for which a push holds, cause, its size, whether there is a last row, its
residual, ticks for which the CUSUMs have been over their limit, ticks to the next copy; C of the last columns, C of the
tracked changes; and what a push takes back: 2 C of the CUSUMs, C of the moment b and C * C of the information matrix A,
with two copies of them that are one and two holds old.
"""

import numpy as np

from drake_tc.kernels.compiling import MATRIX, OUT_MATRIX, VECTOR, helper, kernel
from drake_tc.types import FloatArray

WAIT, HELD, CAUSE, SIZE, STARTED, LAST, OVER, COPY, PAST = 0, 1, 2, 3, 4, 5, 6, 7, 8
PUSH = -1.0
"""Cause of a joint that is pushed."""


@helper
def solved(a: FloatArray, b: FloatArray, x: FloatArray) -> None:
    """Solve a x = b, a positive definite (C, C), by Gaussian elimination; a and b are overwritten."""
    count = b.size
    for k in range(count):
        for i in range(k + 1, count):
            factor = a[i, k] / a[k, k]
            for j in range(k, count):
                a[i, j] -= factor * a[k, j]
            b[i] -= factor * b[k]
    for k in range(count - 1, -1, -1):
        total = b[k]
        for j in range(k + 1, count):
            total -= a[k, j] * x[j]
        x[k] = total / a[k, k]


@helper
def most_probable(moment: FloatArray, information: FloatArray, prior: FloatArray) -> tuple[int, float]:
    """The column whose change alone explains most, and that change.

    log odds = b^2/(2 (A + 1/s^2)) - log(1 + s^2 A)/2, the evidence of a change x ~ N(0, s^2) with the rest at 0.
    """
    best, odds, change = 0, -1e300, 0.0
    for k in range(moment.size):
        own, s2 = information[k * moment.size + k], prior[k] * prior[k]
        if s2 == 0.0:
            continue
        found = 0.5 * moment[k] ** 2 / (own + 1.0 / s2) - 0.5 * np.log1p(s2 * own)
        if found > odds:
            best, odds, change = k, found, moment[k] / (own + 1.0 / s2)
    return best, change


@kernel(MATRIX, VECTOR, VECTOR, MATRIX, MATRIX, VECTOR, OUT_MATRIX, OUT_MATRIX)
def watch(
    seen: FloatArray,
    needed: FloatArray,
    last: FloatArray,
    joints: FloatArray,
    sizes: FloatArray,
    numbers: FloatArray,
    state: FloatArray,
    out: FloatArray,
) -> None:
    """All joints of one tick.

    Args:
        seen: (6, n) position, velocity, acceleration, load torque, effort, external torque.
        needed: (n,) torque for which the model asks [N m].
        last: (n,) that of the tick before; NaN at the first.
        joints: (n, 6) standard deviation [N m], correlation from row to row, ticks of a row, largest external torque,
            gain K, inertia.
        sizes: (n, 2 C) sizes of the changes that are looked for, and prior deviations; 0: not looked for.
        numbers: (6,) what is left of the information after a row, limit of the CUSUMs, ticks after a push in which
            nothing is learned, speed of rest, period [s], ticks over the limit before a cause is named.
        state: (n, size) of the joints; written.
        out: (n, 4 + C) whitened residual, cause, change, largest CUSUM over its limit, tracked changes; written.
    """
    count = sizes.shape[1] // 2
    keep, limit, hold, rest, period = numbers[0], numbers[1], numbers[2], numbers[3], numbers[4]
    learned = 3 * count + count * count
    column = np.empty(count)
    for i in range(needed.size):
        q, v, a, load, external = seen[0, i], seen[1, i], seen[2, i], seen[3, i], seen[5, i]
        gain = joints[i, 4]
        residual = seen[4, i] / gain - needed[i]
        own = state[i]
        tracked, begin = own[PAST + count : PAST + 2 * count], PAST + 2 * count
        now, older = own[begin : begin + learned], own[begin + learned : begin + 2 * learned]
        oldest = own[begin + 2 * learned :]
        up, down, moment, information = (
            now[:count],
            now[count : 2 * count],
            now[2 * count : 3 * count],
            now[3 * count :],
        )
        own[WAIT] -= 1.0
        if np.abs(external) > joints[i, 3]:
            if own[HELD] <= 0.0:
                now[:] = oldest
                older[:] = oldest
            own[HELD] = hold
        own[COPY] -= 1.0
        if own[COPY] <= 0.0 and own[HELD] <= 0.0:
            oldest[:] = older
            older[:] = now
            own[COPY] = hold
        pushed = own[HELD] > 0.0
        own[HELD] = max(own[HELD] - 1.0, 0.0)
        finite = np.isfinite(residual + q + v + a + load)
        if own[WAIT] <= 0.0 and finite:
            own[WAIT] = joints[i, 2]
            if pushed or np.abs(v) <= rest:
                own[STARTED] = 0.0
            else:
                correlation = joints[i, 1] if own[STARTED] > 0.0 else 0.0
                scale = joints[i, 0] * np.sqrt(1.0 - correlation * correlation)
                white = (residual - correlation * own[LAST]) / scale
                own[LAST], own[STARTED] = residual, 1.0
                out[i, 0] = white
                rate = (needed[i] - last[i]) / period
                column[0] = needed[i] - load - joints[i, 5] * a
                column[1] = needed[i]
                column[2], column[3] = np.sin(q), np.cos(q)
                column[4] = rate if np.isfinite(rate) else 0.0
                column[5] = np.sign(needed[i]) / gain
                column[6] = 1.0
                fresh = np.empty(count)
                for k in range(count):
                    fresh[k] = (column[k] - correlation * own[PAST + k]) / scale
                    own[PAST + k] = column[k]
                largest = 0.0
                for k in range(count):
                    change = sizes[i, k] * fresh[k]
                    up[k] = max(0.0, up[k] + change * white - 0.5 * change * change)
                    down[k] = max(0.0, down[k] - change * white - 0.5 * change * change)
                    up[k], down[k] = min(up[k], 2.0 * limit), min(down[k], 2.0 * limit)
                    largest = max(largest, up[k], down[k])
                    moment[k] = keep * moment[k] + fresh[k] * white
                    for j in range(count):
                        information[k * count + j] = keep * information[k * count + j] + fresh[k] * fresh[j]
                prior = sizes[i, count:]
                total, right = np.empty((count, count)), moment.copy()
                for k in range(count):
                    for j in range(count):
                        total[k, j] = information[k * count + j]
                    total[k, k] += 1.0 / (prior[k] * prior[k]) if prior[k] > 0.0 else 1e300
                solved(total, right, tracked)
                own[OVER] = own[OVER] + joints[i, 2] if largest >= limit else 0.0
                if own[OVER] >= numbers[5]:
                    best, found = most_probable(moment, information, prior)
                    own[CAUSE], own[SIZE] = best + 1.0, found
                elif largest < 0.5 * limit:
                    own[CAUSE], own[SIZE] = 0.0, 0.0
                out[i, 3] = largest / limit
        out[i, 1] = PUSH if pushed else own[CAUSE]
        out[i, 2] = own[SIZE]
        for k in range(count):
            out[i, 4 + k] = tracked[k]
