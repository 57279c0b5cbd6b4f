"""Three sensors at every series-elastic joint and the one relation between them: any one of them can be done without.

With theta before the spring, q behind it, tau in it, and d its deflection as `LinkPosition` has it,

    d[k] = d[k-1] + s (c tau[k] - d[k-1]),   r[k] = theta[k] - q[k] - d[k]

Nothing that the robot does moves r, so |r| > `TOLERANCE` + `SHARE` |d| says that one of the three is wrong. Which:
    the one that jumps most against its own line through the last two samples, in units of r, where that is more than
    half of what is allowed; else the encoder that has repeated itself for `STILL` ticks, and longer than the other (a
    frozen one); else the gauge, as encoders do not drift.
A reading that is not finite, a gauge that repeats itself `GAUGE_REPEATS` times and an encoder behind the spring that
does `LINK_REPEATS` times are wrong at once: both have noise. The encoder before the spring has none, and stands still
whenever its motor does. What is wrong is replaced from the other two, until it has agreed with them for `AGREED` ticks,
the encoder before the spring for ticks at which it moved, as a frozen one too is right now and then:

    theta = q + d,   tau = (d' + (d[k] - d')/s)/c with d[k] = theta - q, d' = d[k-1],   q = theta - d

Where two of three are wrong, each keeps its last good value. Source: our own; the paper has no faults.
"""

import numpy as np

from drake_tc.kernels.compiling import MATRIX, OUT_MATRIX, OUT_VECTOR, VECTOR, helper, kernel
from drake_tc.types import FloatArray

TOLERANCE, SHARE = 1e-3, 0.05
"""Of |r|: [rad], six deviations of a gauge of 0.02 N m at 120 N m/rad; and of the deflection, as stiffness is known."""
STILL, AGREED = 2, 20
"""Ticks."""
LARGEST = 1e9
"""No reading in SI units is as large."""
THETA, TAU, Q = 0, 1, 2
_LAST, _BEFORE, _RAW, _SAME, _DOUBT, DEFLECTION = 0, 3, 6, 9, 12, 15
"""Rows of the memory: values given at the last tick and the one before, raw readings, ticks that these have not
changed, ticks until a sensor is believed again (three rows each, theta, tau, q); d."""
MISSING, FROZEN, ODD, LOST = 0, 3, 6, 9
"""Rows of what is found."""


@helper
def begin(memory: FloatArray, y: FloatArray, compliance: FloatArray) -> None:
    """The memory (16, n) that a first sample y (3, n) leaves; what is not finite is taken for 0."""
    memory[:] = 0.0
    for j in range(y.shape[1]):
        for row in range(3):
            value = y[row, j] if abs(y[row, j]) < LARGEST else 0.0
            memory[_LAST + row, j] = memory[_BEFORE + row, j] = value
            memory[_RAW + row, j] = np.nan
        memory[DEFLECTION, j] = compliance[j] * memory[_LAST + TAU, j]


@helper
def blamed_of(memory: FloatArray, j: int, y: FloatArray, same: FloatArray, d: float, unit: float) -> int:
    """Which one of joint j is wrong, of three that are at odds for no other reason.

    Args:
        memory: (16, n) of the tick before.
        j: Joint.
        y: (3,) its readings.
        same: (3,) ticks that these have not changed.
        d: Deflection [rad].
        unit: Of the gauge, in r [rad/(N m)].
    """
    which, most = 0, -1.0
    for row in range(3):
        jump = abs(y[row] - 2.0 * memory[_LAST + row, j] + memory[_BEFORE + row, j]) * (unit if row == TAU else 1.0)
        if jump > most:
            which, most = row, jump
    if most > 0.5 * (TOLERANCE + SHARE * abs(d)):
        return which
    if max(same[THETA], same[Q]) >= STILL and same[THETA] != same[Q]:
        return THETA if same[THETA] > same[Q] else Q
    return TAU


@helper
def vote_of(
    memory: FloatArray, j: int, y: FloatArray, c: float, s: float, repeats: FloatArray, after: FloatArray,
    found: FloatArray,
) -> None:  # fmt: skip
    """The vote at joint j: its column of `after` and `found`.

    Args:
        memory: (16, n) of the tick before.
        j: Joint.
        y: (3,) its readings.
        c: Compliance [rad/(N m)].
        s: Share of a new deflection in d [-].
        repeats: (3,) ticks from which one that repeats itself is frozen.
        after: (16, n) written.
        found: (10, n) written.
    """
    same, bad, left, held = np.empty(3), np.zeros(3), np.empty(3), np.empty(3)
    before = memory[DEFLECTION, j]
    d = before + s * (c * y[TAU] - before)
    within = abs(y[THETA] - y[Q] - d) <= TOLERANCE + SHARE * abs(d)
    any_bad = doubted = False
    for row in range(3):
        same[row] = memory[_SAME + row, j] + 1.0 if y[row] == memory[_RAW + row, j] else 0.0
        found[MISSING + row, j] = 0.0 if abs(y[row]) < LARGEST else 1.0
        found[FROZEN + row, j] = 1.0 if same[row] >= repeats[row] else 0.0
        bad[row] = max(found[MISSING + row, j], found[FROZEN + row, j])
        any_bad = any_bad or bad[row] > 0.0
        doubted = doubted or memory[_DOUBT + row, j] > 0.0
    agreed = within and not any_bad
    blamed = -1
    if not (agreed or any_bad or doubted):
        blamed = blamed_of(memory, j, y, same, d, c * s)
    good = 0
    for row in range(3):
        doubt = memory[_DOUBT + row, j]
        forgiven = agreed and (row != THETA or same[row] == 0.0)
        left[row] = AGREED if bad[row] or blamed == row else max(doubt - (1.0 if forgiven else 0.0), 0.0)
        held[row] = memory[_LAST + row, j] if left[row] else y[row]
        good += 0 if left[row] else 1
        found[ODD + row, j] = 1.0 if left[row] and not bad[row] and not agreed else 0.0
    found[LOST, j] = 1.0 if good < 2 else 0.0
    both = not left[THETA] and not left[Q]
    if left[TAU]:
        d = held[THETA] - held[Q] if both else before
        held[TAU] = (before + (d - before) / s) / c if both else held[TAU]
    if left[THETA] and not left[Q]:
        held[THETA] = held[Q] + d
    elif left[Q] and not left[THETA]:
        held[Q] = held[THETA] - d
    for row in range(3):
        after[_LAST + row, j], after[_BEFORE + row, j] = held[row], memory[_LAST + row, j]
        after[_RAW + row, j], after[_SAME + row, j], after[_DOUBT + row, j] = y[row], same[row], left[row]
    after[DEFLECTION, j] = d


@kernel(VECTOR, VECTOR, VECTOR, VECTOR, MATRIX, VECTOR, OUT_VECTOR, OUT_MATRIX, OUT_MATRIX)
def vote(
    motor_angle: FloatArray,
    torque: FloatArray,
    link_angle: FloatArray,
    state: FloatArray,
    springs: FloatArray,
    repeats: FloatArray,
    after: FloatArray,
    given: FloatArray,
    found: FloatArray,
) -> bool:
    """One tick of all joints; whether nothing is wrong.

    Args:
        motor_angle: (n,) theta as it came [rad].
        torque: (n,) tau [N m].
        link_angle: (n,) q [rad].
        state: (16 n + 1,) memory, and 1 once there was a tick.
        springs: (2, n) compliance c [rad/(N m)] and share s.
        repeats: (3,) ticks from which one that repeats itself is frozen.
        after: (16 n + 1,) the state after it; written.
        given: (4, n) theta, tau, q that can be believed, and theta - d; written.
        found: (10, n) 1 where a reading is missing, frozen, odd (three rows each), and where two of three are wrong;
            written.
    """
    n = motor_angle.size
    y, memory, written = np.empty((3, n)), np.empty((16, n)), after[:-1].reshape(16, n)
    y[THETA], y[TAU], y[Q] = motor_angle, torque, link_angle
    if state[-1]:
        memory[:] = state[:-1].reshape(16, n)
    else:
        begin(memory, y, springs[0])
    for j in range(n):
        vote_of(memory, j, y[:, j].copy(), springs[0, j], springs[1, j], repeats, written, found)
        for row in range(3):
            given[row, j] = written[_LAST + row, j]
        given[3, j] = written[_LAST + THETA, j] - written[DEFLECTION, j]
    after[-1] = 1.0
    return not found.any()
