"""Which of a series-elastic joint's three sensors is late.

A sensor that is late by m ticks is right about the past. With theta before the spring, q behind it, its deflection d by
the gauge, r = theta - q - d, and a hat for what the other two say of a sensor,

    theta^ = q + d,   d^ = theta - q,   q^ = theta - d;   e(m)^2 = mean (x[k-i] - x^[k-i-m])^2,   i < `WINDOW`

it is late if, for some m up to `LATEST`,
    e(m)^2 is below `OF_SPREAD` of the variance of r over the window, and below `OF_OTHERS` of the least e^2 of the
    others;
    x itself has varied by `OF_OWN` of that variance;
    the RMS of r over the window is more than is allowed;
    and r has not jumped by half of that in any tick that is looked at.
An offset does not change r, and so is never taken for a delay. Where a sensor of the same kind is late at another
joint, as on a slow bus, the mean of r^2 counts in place of its variance, however small it is, and no other kind is
called late.
Source: our own.

Three sensors at every series-elastic joint and the one relation between them: any one of them can be done without.

With theta before the spring, q behind it, tau in it, and d its deflection as `LinkPosition` has it,

    d[k] = d[k-1] + s (c tau[k] - d[k-1]),   r[k] = theta[k] - q[k] - d[k]

Nothing that the robot does moves r, so |r| > `TOLERANCE` + `SHARE` |d| says that one of the three is wrong. Which:
    the one that jumps most against its own line through the last two samples, in units of r, where that is more than
    half of what is allowed; else, where both encoders move, the one that is late (`late_sensor`); else the one whose
    kind is late at another joint; else the encoder that has repeated itself for `STILL` ticks, and longer than the
    other (a frozen one); else the gauge, as encoders do not drift.
A reading that is not finite, a gauge that repeats itself `GAUGE_REPEATS` times and an encoder behind the spring that
does `LINK_REPEATS` times are wrong at once: both have noise. The encoder before the spring has none, and stands still
whenever its motor does. What is wrong is replaced from the other two, until it has agreed with them for `AGREED` ticks,
the encoder before the spring for ticks at which it moved, as a frozen one too is right now and then:

    theta = q + d,   tau = (d' + (d[k] - d')/s)/c with d[k] = theta - q, d' = d[k-1],   q = theta - d

Where two of three are wrong, each keeps its last good value.

A late sensor is believed again after it has agreed for `LATE_AGREED` ticks, as it is right whenever the joint stands.
Source: our own; the paper has no faults.
"""

from typing import Any

import numpy as np

from drake_tc.kernels.compiling import MATRIX, OUT_MATRIX, OUT_VECTOR, REAL, VECTOR, helper, kernel, together
from drake_tc.types import FloatArray

LATEST, WINDOW = 40, 40
"""Largest delay that is looked for, and the window over which it must explain the contradiction [ticks]."""
HISTORY = LATEST + WINDOW
OF_SPREAD, OF_OTHERS, OF_OWN = 0.05, 0.25, 0.25
LARGEST = 1e9
"""No reading in SI units is as large."""
THETA, TAU, Q = 0, 1, 2


@helper
def latest_of(row: int, before: float, reading: float, c: float, s: float) -> float:
    """The theta, d or q of a joint by a raw reading; one that is not finite leaves the last value.

    Args:
        row: Which sensor: THETA, TAU or Q.
        before: The value of the tick before.
        reading: theta, tau or q as it came.
        c: Compliance [rad/(N m)].
        s: Share of a new deflection in d [-].
    """
    if not abs(reading) < LARGEST:
        return before
    return before + s * (c * reading - before) if row == TAU else reading


@helper
def misfit_of(past: FloatArray, row: int, late: int) -> float:
    """Mean square over the window of a sensor against what the other two said of it `late` ticks before [rad^2].

    Args:
        past: (3, HISTORY) theta, d and q, the latest first.
        row: Which sensor.
        late: Ticks.
    """
    total = 0.0
    for i in range(WINDOW):
        theta, d, q = past[THETA, i + late], past[TAU, i + late], past[Q, i + late]
        told = q + d if row == THETA else (theta - q if row == TAU else theta - d)
        total += (past[row, i] - told) ** 2
    return total / WINDOW


@helper
def variance_of(values: FloatArray) -> float:
    """Of the window, the latest first."""
    mean = 0.0
    for i in range(WINDOW):
        mean += values[i] / WINDOW
    total = 0.0
    for i in range(WINDOW):
        total += (values[i] - mean) ** 2
    return total / WINDOW


@helper
def late_of(past: FloatArray, allowed: float, known: FloatArray) -> int:
    """Which sensor of a joint is late, or -1 where a delay explains nothing; `past` as in `misfit_of`.

    Args:
        past: (3, HISTORY) theta, d and q, the latest first.
        allowed: Of |r| [rad].
        known: (3,) 1 for a kind of sensor that is late at some joint.
    """
    r, square = past[THETA] - past[Q] - past[TAU], 0.0
    for i in range(HISTORY - 2):
        if abs(r[i] - 2.0 * r[i + 1] + r[i + 2]) > 0.5 * allowed:
            return -1
    for i in range(WINDOW):
        square += r[i] * r[i] / WINDOW
    if square <= allowed * allowed and not known.any():
        return -1
    least, spread = np.full(3, np.inf), variance_of(r)
    for row in range(3):
        if variance_of(past[row]) > OF_OWN * spread:
            for late in range(1, LATEST + 1):
                least[row] = min(least[row], misfit_of(past, row, late))
    which = int(np.argmin(least))
    others = min(least[(which + 1) % 3], least[(which + 2) % 3])
    if known.any() and not known[which]:
        return -1
    explained = square if known[which] else spread
    return which if least[which] < min(OF_SPREAD * explained, OF_OTHERS * others) else -1


TOLERANCE, SHARE = 1e-3, 0.05
"""Of |r|: [rad], six deviations of a gauge of 0.02 N m at 120 N m/rad; and of the deflection, as stiffness is known."""
STILL, AGREED, LATE_AGREED = 2, 20, 500
"""Ticks."""
LATE_MOVES = 5
"""Ticks after which an encoder that has not changed stands or is frozen, and no delay is looked for."""
_LAST, _BEFORE, _RAW, _SAME, _DOUBT, DEFLECTION, LATEST_RAW, ROWS = 0, 3, 6, 9, 12, 15, 16, 19
"""Rows of the memory: values given at the last tick and the one before, raw readings, ticks that these have not
changed, ticks until a sensor is believed again (three rows each, theta, tau, q); d; theta, d and q by the raw readings.
The last three rows of each tick k are kept in row k modulo `HISTORY` of the past."""
MISSING, FROZEN, ODD, LOST = 0, 3, 6, 9
"""Rows of what is found."""


@helper
def begin(memory: FloatArray, y: FloatArray, compliance: FloatArray) -> None:
    """The memory (ROWS, n) that a first sample y (n, 3) leaves; what is not finite is taken for 0."""
    memory[:] = 0.0
    for j in range(y.shape[0]):
        for row in range(3):
            value = y[j, row] if abs(y[j, row]) < LARGEST else 0.0
            memory[_LAST + row, j] = memory[_BEFORE + row, j] = value
            memory[_RAW + row, j] = np.nan
        memory[DEFLECTION, j] = compliance[j] * memory[_LAST + TAU, j]
        for row in range(3):
            memory[LATEST_RAW + row, j] = memory[DEFLECTION, j] if row == TAU else memory[_LAST + row, j]


@helper
def past_of(past: FloatArray, ticks: int, memory: FloatArray, j: int) -> FloatArray:
    """(3, HISTORY) theta, d and q of joint j by the raw readings, the latest first; before the first tick, as then.

    Args:
        past: (HISTORY, 3 n) of the ticks before.
        ticks: How many these are.
        memory: (ROWS, n) of this tick.
        j: Joint.
    """
    n = memory.shape[1]
    found = np.empty((3, HISTORY))
    for row in range(3):
        found[row, 0] = memory[LATEST_RAW + row, j]
        for age in range(1, HISTORY):
            tick = max(ticks - age, 0)
            found[row, age] = past[tick % HISTORY, row * n + j] if ticks else found[row, 0]
    return found


@helper
def jumped_of(memory: FloatArray, j: int, y: FloatArray, d: float, unit: float) -> int:
    """Which one of joint j jumps by more than half of what is allowed, and the most; -1 where none does.

    Args:
        memory: (ROWS, n) of the tick before.
        j: Joint.
        y: (3,) its readings.
        d: Deflection [rad].
        unit: Of the gauge, in r [rad/(N m)].
    """
    which, most = -1, 0.5 * (TOLERANCE + SHARE * abs(d))
    for row in range(3):
        jump = abs(y[row] - 2.0 * memory[_LAST + row, j] + memory[_BEFORE + row, j]) * (unit if row == TAU else 1.0)
        if jump > most:
            which, most = row, jump
    return which


@helper
def suspect_of(same: FloatArray, known: FloatArray) -> int:
    """Which one is at odds where none jumps and no delay is told.

    The kind that is late at another joint; the encoder that has repeated itself longer; else the gauge.

    Args:
        same: (3,) ticks without a change.
        known: (3,) 1 for a kind of sensor that is late at some joint.
    """
    if known.sum() == 1.0:
        return int(np.argmax(known))
    if max(same[THETA], same[Q]) >= STILL and same[THETA] != same[Q]:
        return THETA if same[THETA] > same[Q] else Q
    return TAU


@helper
def vote_of(
    before_now: tuple[Any, ...], joint: tuple[int, float, float], y: FloatArray, limits: tuple[FloatArray, ...],
    written: tuple[FloatArray, ...],
) -> None:  # fmt: skip
    """The vote at joint j: its column of `after` and `found`.

    Args:
        before_now: (ROWS, n) memory of the tick before, (HISTORY, 3 n) of the ticks before, and how many these are.
        joint: j, compliance c [rad/(N m)], share s of a new deflection in d [-].
        y: (3,) its readings.
        limits: (3,) ticks from which one that repeats itself is frozen, (3,) 1 for a kind of sensor that is late at
            some joint.
        written: (4, 3) for intermediate results, (ROWS, n) after, (10, n) found.
    """
    (memory, past, ticks), (j, c, s), (repeats, known), (work, after, found) = before_now, joint, limits, written
    same, bad, left, held = work[0], work[1], work[2], work[3]
    before = memory[DEFLECTION, j]
    d = before + s * (c * y[TAU] - before)
    allowed = TOLERANCE + SHARE * abs(d)
    within = abs(y[THETA] - y[Q] - d) <= allowed
    any_bad = doubted = False
    for row in range(3):
        same[row] = memory[_SAME + row, j] + 1.0 if y[row] == memory[_RAW + row, j] else 0.0
        found[MISSING + row, j] = 0.0 if abs(y[row]) < LARGEST else 1.0
        found[FROZEN + row, j] = 1.0 if same[row] >= repeats[row] else 0.0
        bad[row] = max(found[MISSING + row, j], found[FROZEN + row, j])
        any_bad = any_bad or bad[row] > 0.0
        doubted = doubted or memory[_DOUBT + row, j] > 0.0
    agreed = within and not any_bad
    for row in range(3):
        after[LATEST_RAW + row, j] = latest_of(row, memory[LATEST_RAW + row, j], y[row], c, s)
    blamed = late = -1
    if not (agreed or any_bad):
        if max(same[THETA], same[Q]) < LATE_MOVES:
            late = late_of(past_of(past, ticks, after, j), allowed, known)
        if not doubted:
            jumped = jumped_of(memory, j, y, d, c * s)
            blamed = jumped if jumped >= 0 else suspect_of(same, known)
    good = 0
    for row in range(3):
        doubt = memory[_DOUBT + row, j]
        forgiven = agreed and (row != THETA or same[row] == 0.0)
        left[row] = AGREED if bad[row] or blamed == row else max(doubt - (1.0 if forgiven else 0.0), 0.0)
        if late >= 0:
            left[row] = LATE_AGREED if row == late else 0.0
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


@kernel(
    together(VECTOR, VECTOR, VECTOR), together(VECTOR, MATRIX), MATRIX, VECTOR,
    together(OUT_VECTOR, OUT_MATRIX, OUT_MATRIX),
)  # fmt: skip
def vote(
    now: tuple[FloatArray, ...],
    before: tuple[FloatArray, ...],
    springs: FloatArray,
    repeats: FloatArray,
    written: tuple[FloatArray, ...],
) -> bool:
    """One tick of all joints; whether nothing is wrong.

    Args:
        now: (n,) theta as it came [rad], tau [N m], q [rad].
        before: (ROWS n + 1,) memory, and the number of ticks so far; (HISTORY, 3 n) of these ticks.
        springs: (2, n) compliance c [rad/(N m)] and share s.
        repeats: (3,) ticks from which one that repeats itself is frozen.
        written: (ROWS n + 1,) the state after it; (4, n) theta, tau, q that can be believed, and theta - d; (10, n) 1
            where a reading is missing, frozen, odd (three rows each), and where two of three are wrong.
    """
    (motor_angle, torque, link_angle), (state, past), (after, given, found) = now, before, written
    n, ticks = motor_angle.size, int(state[-1])
    y, work, known = np.empty((n, 3)), np.empty((4, 3)), np.zeros(3)
    memory, reached = state[:-1].reshape(ROWS, n), after[:-1].reshape(ROWS, n)
    y[:, THETA], y[:, TAU], y[:, Q] = motor_angle, torque, link_angle
    if not ticks:
        fresh = np.empty((ROWS, n))
        begin(fresh, y, springs[0])
        memory = fresh
    for row in range(3):
        known[row] = 1.0 if memory[_DOUBT + row].max() > AGREED else 0.0
    for j in range(n):
        spring = j, springs[0, j], springs[1, j]
        vote_of((memory, past, ticks), spring, y[j], (repeats, known), (work, reached, found))
        for row in range(3):
            given[row, j] = reached[_LAST + row, j]
        given[3, j] = reached[_LAST + THETA, j] - reached[DEFLECTION, j]
    after[-1] = ticks + 1.0
    return not found.any()


@kernel(together(VECTOR, MATRIX), REAL, together(OUT_VECTOR, OUT_MATRIX, OUT_VECTOR, OUT_VECTOR, OUT_VECTOR))
def remember(voted: tuple[FloatArray, ...], hold: float, kept: tuple[FloatArray, ...]) -> None:
    """The state after a vote, in place; arrays that are written hold the state before it.

    Flags stay up, and joints stay lost, for `hold` ticks; each cause that the vote finds begins them anew.

    Args:
        voted: (ROWS n + 1,) `after` and (10, n) `found` of the vote.
        hold: Ticks.
        kept: (ROWS n + 1,) becomes `after`; (HISTORY, 3 n) takes this tick's readings; (7,) ticks that each flag stays
            up; (7,) 1 where it is up: a missing and an odd encoder before the spring (a frozen one too); a missing, a
            frozen and an odd gauge; an odd encoder behind the spring; two of three wrong; (n,) ticks that each joint
            stays lost.
    """
    (reached, found), (memory, past, left, flags, lost) = voted, kept
    n = lost.size
    for i in range(reached.size):
        memory[i] = reached[i]
    row = past[(int(reached[-1]) - 1) % HISTORY]
    for i in range(3 * n):
        row[i] = reached[LATEST_RAW * n + i]
    if not (left.any() or found.any()):
        return
    causes = MISSING + THETA, ODD + THETA, MISSING + TAU, FROZEN + TAU, ODD + TAU, ODD + Q, LOST
    for k in range(len(causes)):
        left[k] = hold if found[causes[k]].any() else max(left[k] - 1.0, 0.0)
        flags[k] = 1.0 if left[k] > 0.0 else 0.0
    for j in range(n):
        lost[j] = hold if found[LOST, j] else max(lost[j] - 1.0, 0.0)
