"""Where the joint resolvably slides, which way, and which samples may therefore take part in the regression.

What a position sensor does not resolve shows at rest. White noise is known from the differences of samples. Noise that
wanders, over a tenth of a second or more, is not: it shows as a slow motion to and fro of a joint that sticks, and
friction would be given the sign of that motion. A joint that stays within a few milliradians for half a second and
turns twice is therefore taken to be at rest, and what its filtered velocity is there, about its median line (a slow
reversal has a trend), is what the sensor does not resolve. A joint that breaks away at the end of such a window, or
comes to rest at its begin, moves in the lesser part of it; medians within and over the windows leave it out.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.ndimage import minimum_filter1d

from drake_tc.config.joint_units import JointType
from drake_tc.diagnosis.data.resolution import Resolution
from drake_tc.errors import IdentificationError
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.types import BoolArray, FloatArray, IntArray

LEAST_ROWS = 50
"""Fewest rows of a regression."""
BLOCK_SECONDS = 0.5
MAX_ROWS = 60_000
LEAST_TRAVEL: Mapping[JointType, float] = {"revolute": 1e-3, "prismatic": 1e-4}
"""Travel after a reversal or stop [rad or m] before the joint counts as sliding: bristles of any gear, guide or screw
wind up over less."""
STILL = 0.2
"""Mean speed over the resolved speed, below which a joint that does not resolvably move stands still."""
WINDOW = 0.5
"""Length of the windows in which a joint is found at rest [s]."""
HOPS = 2
"""Windows that begin within one window's length."""
LEAST_WINDOWS = 10
"""Fewest windows at rest from which a speed is told."""
POINTS = 50
"""Samples of a window through which its median line goes, at most."""
MOST_TRAVEL = 5e-3
"""Span of the position of a joint at rest, at most [rad], and as a share of the whole motion's span ..."""
MOST_SHARE = 0.02
LEAST_TURNS = 2
"""Changes of the velocity's sign within a window, at least: a reversal is one, creep none."""
AT_ONCE = 256
"""Windows whose lines are computed together."""
NORMAL = 0.6744897501960817
"""Median of the absolute values of a standard normal variable."""
MOST_OF_SPEED = 0.02
"""The result as a share of the 95th percentile of the speed, at most: the motion must stay resolved."""


def direction_of_motion(
    q: FloatArray,
    v: FloatArray,
    segments: Sequence[slice],
    resolution: Resolution,
    joint_type: JointType = "revolute",
    *,
    both_sides: bool = False,
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Direction of the last resolved motion, travel since it turned, and where both are certain.

    `both_sides`: the joint also has to move on as far before it turns or stops as it has to move afterwards.
    """
    threshold = resolution.least_speed
    least_travel = max(8.0 * resolution.position_noise, LEAST_TRAVEL[joint_type])
    direction, travel = np.zeros_like(q), np.zeros_like(q)
    moving = np.zeros(q.size, dtype=bool)
    for s in segments:
        sign = np.where(np.abs(v[s]) > threshold, np.sign(v[s]), 0.0)
        known = np.flatnonzero(sign)
        if known.size == 0:
            continue
        turned, held = _turns(sign, v[s])
        direction[s], travel[s] = held, _travel_since(turned, q[s])
        # how far the bristles were wound when the stretch began is unknown: wait for five times the travel
        settled = np.maximum.accumulate(travel[s]) > 5.0 * least_travel
        since = _travel_since(_stops(sign, v[s], threshold), q[s])
        moving[s] = settled & (sign != 0.0) & (since > least_travel)
        if both_sides:
            moving[s] &= _travel_until_stop(sign, v[s], q[s], threshold) > least_travel
    return direction, travel, moving


def _turns(sign: FloatArray, v: FloatArray) -> tuple[IntArray, FloatArray]:
    """First samples of the strokes in one direction, the first one's being 0, and the direction of each sample (T,)."""
    held, coming = _held(sign), _held(sign[::-1])[::-1]
    # between two different resolved signs the true crossing is where the velocity itself crosses
    turning = (sign == 0.0) & (held != coming) & (v != 0.0)
    held = np.where(turning, np.sign(v), held)
    return np.concatenate([[0], np.flatnonzero(np.diff(held)) + 1]), held


def _travel_until_stop(sign: FloatArray, v: FloatArray, q: FloatArray, threshold: float) -> FloatArray:
    """Travel of each sample (T,) until the joint turns or comes to rest; infinite where it does neither any more."""
    stops = _stops(-sign[::-1], -v[::-1], threshold)
    travel = _travel_since(stops, q[::-1])
    travel[: stops[1] if stops.size > 1 else travel.size] = np.inf  # the last sample is no stop
    return travel[::-1]


def _stops(sign: FloatArray, v: FloatArray, threshold: float) -> IntArray:
    """First samples after the joint turned or stood still, sample 0 included."""
    return np.union1d(_turns(sign, v)[0], _departures(sign, v, threshold))


def _travel_since(starts: IntArray, q: FloatArray) -> FloatArray:
    """Travel of each sample since the last of the samples `starts`, whose first is 0."""
    start = starts[np.searchsorted(starts, np.arange(q.size), side="right") - 1]
    return np.abs(q - q[start])


def _departures(sign: FloatArray, v: FloatArray, threshold: float) -> IntArray:
    """Where the joint moves on after it stood still.

    While a joint stands still its friction follows the load, whatever the direction of the last motion was, so the
    bristles are wound anew when it moves on. It stood still where its mean speed over a stretch without resolved motion
    is below `STILL` of the resolved speed; a slow motion that noise takes below the threshold for some samples did not.
    A mean speed against the direction of the motion before and after counts as below it: the bristles of a joint at
    rest give way to a torque that turns, and spring back.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[1.0], np.abs(sign), [1.0]])))
    begins, ends = edges[::2], edges[1::2]
    travelled = np.concatenate([[0.0], np.cumsum(v)])
    before, after = np.concatenate([[0.0], sign])[begins], np.concatenate([sign, [0.0]])[ends]
    way = travelled[ends] - travelled[begins]
    along = np.where(before * after > 0.0, before * way, np.abs(way))
    still = along < STILL * threshold * (ends - begins)
    return np.asarray(ends[still & (ends < sign.size)])


def choose_rows(
    moving: BoolArray, segments: Sequence[slice], final: CommonKernel, light: CommonKernel, period: float
) -> tuple[IntArray, IntArray]:
    """Rows whose neighbourhood in the final kernel moves throughout, thinned to the kernel's resolution."""
    usable = _usable(moving, segments, final, light)
    stride = max(1, final.box // 2)
    stride = max(stride, int(np.ceil(usable.sum() / MAX_ROWS)))
    rows = np.concatenate([np.arange(s.start, s.stop, stride) for s in segments])
    rows = rows[usable[rows]]
    length = max(1, round(BLOCK_SECONDS / period))
    segment_of = np.searchsorted([s.stop for s in segments], rows, side="right")
    starts = np.array([s.start for s in segments])
    raw = segment_of * 10**7 + (rows - starts[segment_of]) // length
    block = np.unique(raw, return_inverse=True)[1]
    return rows.astype(np.int64), block.astype(np.int64)


def covered(moving: BoolArray, segments: Sequence[slice], final: CommonKernel, light: CommonKernel) -> int:
    """How many samples may become rows under a final kernel."""
    return int(np.count_nonzero(_usable(moving, segments, final, light)))


def _usable(moving: BoolArray, segments: Sequence[slice], final: CommonKernel, light: CommonKernel) -> BoolArray:
    """(T,) whether the joint moves throughout a sample's neighbourhood in the final kernel."""
    reach, edge = _reach(final), final.margin + light.margin
    usable = np.zeros(moving.size, dtype=bool)
    for s in segments:
        inner = minimum_filter1d(moving[s].astype(np.uint8), 2 * reach + 1, mode="nearest").astype(bool)
        inner[:edge] = False
        inner[max(0, inner.size - edge) :] = False
        usable[s] = inner
    return usable


def _reach(final: CommonKernel) -> int:
    """Samples on either side of a row that must move too."""
    return max(1, int(0.6 * final.margin))


def require_rows(rows: IntArray, moving: BoolArray, resolution: Resolution, final: CommonKernel, label: str) -> None:
    """Refuse runs in which the joint does not move long enough at a stretch.

    Raises:
        IdentificationError: Fewer than 50 rows.
    """
    if rows.size >= LEAST_ROWS:
        return
    window = (2 * _reach(final) + 1) * final.period
    raise IdentificationError(
        f"{label}: too little motion; expected at least {LEAST_ROWS} filter windows of {1e3 * window:.0f} ms in all of "
        f"which the joint moves faster than {resolution.least_speed:.2g} rad/s, which the sensor "
        f"resolves, got {rows.size} (such motion lasts {np.count_nonzero(moving) * final.period:.2g} s in all); "
        "record runs with longer or faster strokes"
    )


def _held(sign: FloatArray) -> FloatArray:
    """Each sample's last sign other than 0, 0 before the first (T,)."""
    last = np.maximum.accumulate(np.where(sign != 0.0, np.arange(sign.size), -1))
    return np.where(last >= 0, sign[np.maximum(last, 0)], 0.0)


def speed_at_rest(q: FloatArray, v: FloatArray, segments: Sequence[slice], period: float) -> float:
    """Standard deviation of the filtered velocity while the joint is at rest [rad/s]; 0 where it hardly rests.

    Args:
        q: (T,) filtered position [rad].
        v: (T,) filtered velocity [rad/s].
        segments: Uniform stretches without the filters' margins.
        period: [s].
    """
    length = max(4, round(WINDOW / period))
    hop = max(1, length // HOPS)
    windows = [slice(begin, begin + length) for s in segments for begin in range(s.start, s.stop - length + 1, hop)]
    if len(windows) < LEAST_WINDOWS:
        return 0.0
    narrow = min(MOST_TRAVEL, MOST_SHARE * float(np.ptp(np.concatenate([q[w] for w in windows]))))
    resting = [v[w] for w in windows if np.ptp(q[w]) < narrow and _reversals(v[w]) >= LEAST_TURNS]
    if len(resting) < LEAST_WINDOWS:
        return 0.0
    deviation = np.concatenate(
        [_deviations(np.array(resting[k : k + AT_ONCE])) for k in range(0, len(resting), AT_ONCE)]
    )
    fast = float(np.percentile(np.abs(np.concatenate([v[w] for w in windows])), 95.0))
    return min(float(np.median(deviation)), MOST_OF_SPEED * fast)


def _deviations(v: FloatArray) -> FloatArray:
    """(W,) standard deviation of each window (W, length) about its median line, from the median absolute deviation.

    The line has the median of the medians of the slopes between one sample and all others (Siegel, 1982).
    """
    few = v[:, :: -(-v.shape[1] // POINTS)]
    count = few.shape[1]
    at = np.arange(count, dtype=float)
    first, second = np.nonzero(~np.eye(count, dtype=bool))
    slopes = ((few[:, first] - few[:, second]) / (first - second)).reshape(len(few), count, count - 1)
    slope = np.median(np.median(slopes, axis=2), axis=1)
    left = few - slope[:, None] * at
    left -= np.median(left, axis=1)[:, None]
    return np.asarray(np.median(np.abs(left), axis=1) / NORMAL)


def _reversals(v: FloatArray) -> int:
    sign = np.sign(v[v != 0.0])
    return int(np.count_nonzero(np.diff(sign)))
