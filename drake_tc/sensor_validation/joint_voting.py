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

from typing import NamedTuple

import numpy as np
from numpy import count_nonzero

from drake_tc.types import BoolArray, FloatArray

TOLERANCE, SHARE = 1e-3, 0.05
"""Of |r|: [rad], six deviations of a gauge of 0.02 N m at 120 N m/rad; and of the deflection, as stiffness is known."""
STILL, GAUGE_REPEATS, LINK_REPEATS, AGREED = 2, 6, 20, 20
"""Ticks."""
LARGEST = 1e9
"""No reading in SI units is as large."""
THETA, TAU, Q = 0, 1, 2
_LAST, _BEFORE, _RAW, _SAME, _DOUBT = (slice(a, a + 3) for a in range(0, 15, 3))
DEFLECTION, ROWS = 15, 16
"""Of the memory: values given at the last tick and the one before, raw readings, ticks that these have not changed,
ticks until a sensor is believed again (three rows each, theta, tau, q); d."""


class Vote(NamedTuple):
    """Of one tick; n joints, rows theta, tau, q.

    Attributes:
        given: (3, n) finite.
        memory: (ROWS, n).
        missing, frozen, odd: (3, n) where a reading is not finite, repeats itself, or is at odds with the other two.
        lost: (n,) where two of three are wrong.
        well: Whether nothing is wrong, for sure.
    """

    given: FloatArray
    memory: FloatArray
    missing: BoolArray
    frozen: BoolArray
    odd: BoolArray
    lost: BoolArray
    well: bool = False


class JointVoting:
    """The vote, compiled for n springs; holds no changing data."""

    def __init__(self, compliance: FloatArray, share: FloatArray, noisy: tuple[bool, bool] = (True, True)) -> None:
        """Compile.

        Args:
            compliance: (n,) c [rad/(N m)].
            share: (n,) s = dt/(dt + t_d) [-].
            noisy: Whether gauges and encoders behind the springs have noise; one without may repeat itself.
        """
        self._c, self._s = np.array(compliance, dtype=float), np.array(share, dtype=float)
        one = np.ones(len(self._c))
        self._unit = np.stack([one, self._c * self._s, one])
        gauge, link = (
            ticks if has else np.inf for ticks, has in zip((GAUGE_REPEATS, LINK_REPEATS), noisy, strict=True)
        )
        self._repeats = np.array([[np.inf], [gauge], [link]])
        nothing = np.zeros((3, len(self._c)), dtype=np.bool_)
        self._well = (nothing, nothing, nothing, nothing[0])

    def started(self, y: FloatArray) -> FloatArray:
        """The memory (ROWS, n) that a first sample y (3, n) leaves; what is not finite is taken for 0."""
        memory = np.zeros((ROWS, y.shape[1]))
        memory[_LAST] = memory[_BEFORE] = np.where(np.abs(y) < LARGEST, y, 0.0)
        memory[_RAW], memory[DEFLECTION] = np.nan, self._c * memory[TAU]
        return memory

    def step(self, memory: FloatArray, y: FloatArray) -> Vote:
        """One tick.

        Args:
            memory: (ROWS, n).
            y: (3, n) theta [rad], tau [N m], q [rad], as they came.
        """
        same = (memory[_SAME] + 1.0) * (y == memory[_RAW])
        before, (theta, tau, q) = memory[DEFLECTION], y
        doubt = memory[_DOUBT]
        if count_nonzero(np.abs(y) < LARGEST) == y.size and not count_nonzero(doubt):  # nearly always
            d = before + self._s * (self._c * tau - before)
            within = np.abs(theta - q - d) <= TOLERANCE + SHARE * np.abs(d)
            if count_nonzero(within) == within.size and not count_nonzero(same >= self._repeats):
                return Vote(y, np.concatenate((y, memory[_LAST], y, same, doubt, d[None])), *self._well, well=True)
        after = np.empty_like(memory)
        after[_BEFORE], after[_RAW], after[_SAME] = memory[_LAST], y, same
        with np.errstate(invalid="ignore", over="ignore"):
            d = before + self._s * (self._c * tau - before)
            within = np.abs(theta - q - d) <= TOLERANCE + SHARE * np.abs(d)
            return self._examine(memory, after, y, d, within, same >= self._repeats)

    def _examine(
        self, memory: FloatArray, after: FloatArray, y: FloatArray, d: FloatArray, within: BoolArray, frozen: BoolArray
    ) -> Vote:
        """The vote where something is wrong."""
        doubt, before = memory[_DOUBT], memory[DEFLECTION]
        missing = ~(np.abs(y) < LARGEST)
        bad = missing | frozen
        agreed = within & ~bad.any(axis=0)
        blamed = self._blamed(memory, y, d, ~agreed & ~(bad | (doubt > 0.0)).any(axis=0), after[_SAME])
        forgiven = np.stack([agreed & (after[_SAME][THETA] == 0.0), agreed, agreed])
        after[_DOUBT] = left = np.where(bad | blamed, float(AGREED), np.maximum(doubt - forgiven, 0.0))
        theta, tau, q = good = left == 0.0
        last, held = memory[_LAST], np.where(good, y, memory[_LAST])
        stretched = held[THETA] - held[Q]
        after[DEFLECTION] = d = np.where(tau, d, np.where(theta & q, stretched, before))
        wound = (before + (d - before) / self._s) / self._c
        given = np.stack(
            [
                np.where(theta, held[THETA], np.where(q, held[Q] + d, last[THETA])),
                np.where(tau, held[TAU], np.where(theta & q, wound, last[TAU])),
                np.where(q, held[Q], np.where(theta, held[THETA] - d, last[Q])),
            ]
        )
        after[_LAST] = given
        return Vote(given, after, missing, frozen, (left > 0.0) & ~bad & ~agreed, good.sum(axis=0) < 2)

    def _blamed(self, memory: FloatArray, y: FloatArray, d: FloatArray, odd: BoolArray, same: FloatArray) -> BoolArray:
        """(3, n) which one is wrong of three that are at odds for no other reason."""
        blamed = np.zeros(y.shape, dtype=np.bool_)
        if odd.any():
            jump = np.abs(y - 2.0 * memory[_LAST] + memory[_BEFORE]) * self._unit
            jumped = jump.max(axis=0) > 0.5 * (TOLERANCE + SHARE * np.abs(d))
            longest = np.where(same[THETA] > same[Q], THETA, Q)
            still = (np.maximum(same[THETA], same[Q]) >= STILL) & (same[THETA] != same[Q])
            stuck = np.where(still, longest, TAU)
            which = np.where(jumped, jump.argmax(axis=0), stuck)
            joints = np.flatnonzero(odd)
            blamed[which[joints], joints] = True
        return blamed
