"""One tick of `drake_tc.watch.monitor.ModelMonitor`: whitened residual, CUSUMs, information, cause; see there.

State of a joint: ticks to the next row, ticks for which a push holds, cause, its size, whether there is a last row, its
residual, ticks to the next copy, needed torque less its low-passed one, rate of the latter, needed torque of the tick
before (NaN before the first one); C of the last columns, C of the tracked changes; and what a push takes back: 2 C of
the CUSUMs, C of the moment b and C * C of the information matrix A, with two copies of them that are one and two holds
old.
"""

from typing import NamedTuple

import numpy as np

from drake_tc.kernels.compiling import MATRIX, OUT_MATRIX, VECTOR, helper, kernel, together
from drake_tc.types import FloatArray

WAIT, HELD, CAUSE, SIZE, STARTED, LAST, COPY, LAG, RATE, BEFORE, PAST = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10
RATE_S = 0.03
"""Time constant of both low-passes of the rate of the needed torque [s]: many correlation times of the noise, which
would be in residual and rate alike, and would look like a delay."""
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


class Constants(NamedTuple):
    """What does not change from tick to tick.

    Attributes:
        joints: (n, 7) standard deviation [N m], correlation from row to row, ticks of a row, largest external torque,
            gain K, inertia, 1/K of a position servo and 0 of other drives.
        sizes: (n, 3 C) sizes of the changes that are looked for, prior deviations, 0 where not looked for, and changes
            by which the model was off from the beginning.
        numbers: (9,) what is left of the information after a row, limit of the CUSUMs, ticks after a push in which
            nothing is learned, speed of rest, period [s], ticks in which a CUSUM reaches its limit at the soonest,
            shares of friction and of the needed torque that add to the largest external torque, time from a reversal
            [s]. Near one the rate stands still: it has no jump of the friction.
    """

    joints: FloatArray
    sizes: FloatArray
    numbers: FloatArray


@kernel(MATRIX, VECTOR, together(MATRIX, MATRIX, VECTOR), OUT_MATRIX, OUT_MATRIX)
def watch(
    seen: FloatArray, needed: FloatArray, constants: tuple[FloatArray, ...], state: FloatArray, out: FloatArray
) -> None:
    """All joints of one tick.

    Args:
        seen: (6, n) position, velocity, acceleration, load torque, effort, external torque; NaN: the residual is it.
        needed: (n,) torque for which the model asks [N m].
        constants: See `Constants`.
        state: (n, size) of the joints; written.
        out: (n, 4 + C) whitened residual, cause, change, largest CUSUM over its limit, tracked changes; written.
    """
    joints, sizes, numbers = Constants(*constants)
    count = sizes.shape[1] // 3
    keep, limit, hold, rest, period = numbers[0], numbers[1], numbers[2], numbers[3], numbers[4]
    learned = 3 * count + count * count
    column, forget = np.empty(count), -np.expm1(-period / RATE_S)
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
        friction = needed[i] - load - joints[i, 5] * a
        moving = np.abs(v) > rest + numbers[8] * np.abs(a)
        if np.isfinite(needed[i]):
            if moving and np.isfinite(own[BEFORE]):
                own[LAG] += needed[i] - own[BEFORE]
                step = own[LAG] * forget
                own[LAG] -= step
                own[RATE] += step / RATE_S - own[RATE] * forget
            own[BEFORE] = needed[i]
        column[0], column[1] = friction, needed[i]
        column[2], column[3] = np.sin(q), np.cos(q)
        column[4] = own[RATE] + joints[i, 6] * v
        column[5], column[6] = 0.5 * np.sign(load) * joints[i, 6], 1.0
        for k in range(count):
            residual -= column[k] * sizes[i, 2 * count + k]
        if np.isnan(external):
            external = residual
        if np.abs(external) > joints[i, 3] + numbers[6] * np.abs(friction) + numbers[7] * np.abs(needed[i]):
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
            if pushed or not moving:
                own[STARTED] = 0.0
            else:
                correlation = joints[i, 1] if own[STARTED] > 0.0 else 0.0
                scale = joints[i, 0] * np.sqrt(1.0 - correlation * correlation)
                white = (residual - correlation * own[LAST]) / scale
                own[LAST], own[STARTED] = residual, 1.0
                out[i, 0] = white
                fresh = np.empty(count)
                for k in range(count):
                    fresh[k] = (column[k] - correlation * own[PAST + k]) / scale
                    own[PAST + k] = column[k]
                largest, most = 0.0, limit * joints[i, 2] / numbers[5]
                for k in range(count):
                    change = sizes[i, k] * fresh[k]
                    more, against = change * white - 0.5 * change * change, -change * white - 0.5 * change * change
                    up[k] = max(0.0, up[k] + min(max(more, -most), most))
                    down[k] = max(0.0, down[k] + min(max(against, -most), most))
                    up[k], down[k] = min(up[k], 2.0 * limit), min(down[k], 2.0 * limit)
                    largest = max(largest, up[k], down[k])
                    moment[k] = keep * moment[k] + fresh[k] * white
                    for j in range(count):
                        information[k * count + j] = keep * information[k * count + j] + fresh[k] * fresh[j]
                prior = sizes[i, count : 2 * count]
                total, right = np.empty((count, count)), moment.copy()
                for k in range(count):
                    for j in range(count):
                        total[k, j] = information[k * count + j]
                    total[k, k] += 1.0 / (prior[k] * prior[k]) if prior[k] > 0.0 else 1e300
                solved(total, right, tracked)
                if largest >= limit:
                    best, found = most_probable(moment, information, prior)
                    own[CAUSE], own[SIZE] = best + 1.0, found
                elif largest < 0.5 * limit:
                    own[CAUSE], own[SIZE] = 0.0, 0.0
                out[i, 3] = largest / limit
        out[i, 1] = PUSH if pushed else own[CAUSE]
        out[i, 2] = own[SIZE]
        for k in range(count):
            out[i, 4 + k] = tracked[k]
