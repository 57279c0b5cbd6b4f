"""p(tau) = P(lower <= G (tau + e) <= upper), e ~ N(0, Sigma): randomised quasi-Monte Carlo with its interval.

Separation of variables (Genz, J. Comp. Graph. Stat. 1, 1992; with more rows than axes Genz & Kwong, J. Stat. Comput.
Simul. 68, 2000). With e = L zeta and the rows over their standard deviations, an orthogonal change of the axes makes
row by row depend on one axis more, the row that is kept with least probability first. Then

    p = E prod_j (Phi(high_j) - Phi(low_j)),

where low_j, high_j are what the rows that end on axis j leave of it, given the axes before: each axis is drawn inside
its own limits, so no sample is lost however small p is, and rows that are orthogonal need no sample at all. Where p is
near 1 the same is done for the disjoint events that make up 1 - p.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr, ndtr, ndtri
from scipy.stats import t as student
from scipy.stats.qmc import Sobol

from drake_tc.errors import ParamsError
from drake_tc.tsid.robust.scaled import TorqueError, certain_miss, nothing, scaled
from drake_tc.tsid.rows import Polytope
from drake_tc.types import FloatArray, IntArray

REPLICATES = 16
"""Digital shifts of the Sobol points; the interval comes from their means."""

WIDER = 1.25
"""What the interval is wider by than Student's: means over Sobol's points have heavier tails than a normal."""

BITS = 30
"""Of a point's coordinates."""

FAR = 8.5
"""A side farther off than this many sigmas is left out: p would change by less than 1e-17."""

SPANNED = 1e-9
"""What is left of a unit row beside the axes before it, below which it has none of its own."""

SURE = 0.99
"""From here on 1 - p is estimated, side by side: p itself is a mean of ones with a rare exception."""

NEGLIGIBLE, SHARE = 1e-4, 16 * REPLICATES
"""Of 1 - p, below which a side is not looked at; least number of samples for one that is."""

ROUNDING = 1e-12
"""Least half width of the interval, absolute: what rounding does to p."""


@dataclass(frozen=True)
class Probability:
    """Of all rows at once.

    Attributes:
        value: p.
        ci95: (low, high) that holds the true p in 95 of 100 seeds.
        rows: How many rows mattered.
        axes: How many directions of the error they see.
    """

    value: float
    ci95: tuple[float, float]
    rows: int = 0
    axes: int = 0


def probability(
    polytope: Polytope,
    torque: FloatArray,
    error: TorqueError,
    *,
    group: str | None = None,
    samples: int = 4096,
    seed: int = 0,
) -> Probability:
    """The probability that torque + e keeps the limits; the torque need not keep them itself.

    Args:
        polytope: Limits over the torques.
        torque: (n,) [N m].
        error: e.
        group: Only the rows of this group.
        samples: Points in all, rounded up to `REPLICATES` times a power of 2.
        seed: Of the shifts; same seed, same numbers.

    Raises:
        ParamsError: an unknown group, or fewer samples than `REPLICATES`.
    """
    if group is not None:
        if group not in polytope.groups:
            raise ParamsError(f"group: expected one of {sorted(polytope.groups)}, got {group!r}")
        polytope = polytope.group(group)
    if samples < REPLICATES:
        raise ParamsError(f"samples: expected at least {REPLICATES}, got {samples}")
    problem = scaled(nothing(error.joints), polytope, error)
    x = torque / problem.scale
    if certain_miss(problem.limits, problem.certain, x):
        return Probability(0.0, (0.0, 0.0))
    rows = problem.erring
    value = rows.matrix @ x
    low, high = rows.lower - value, rows.upper - value
    if not np.all(high - low >= 0.0):
        return (
            Probability(0.0, (0.0, 0.0)) if not np.isnan(value).any() else Probability(math.nan, (math.nan, math.nan))
        )
    near = (low > -FAR) | (high < FAR)
    noise, low, high = problem.noise[near], low[near], high[near]
    p, half, axes = _estimate(noise, low, high, samples, seed)
    if p > SURE:
        missed, half = _missed(noise, low, high, samples, seed)
        p = 1.0 - missed
    half += ROUNDING * p
    return Probability(p, (max(p - half, 0.0), min(p + half, 1.0)), len(low), axes)


def _estimate(
    noise: FloatArray, low: FloatArray, high: FloatArray, samples: int, seed: int
) -> tuple[float, float, int]:
    """P(low <= K zeta <= high), K (m, r) of unit rows; the half width of its interval; how many axes it took."""
    if len(low) == 0:
        return 1.0, 0.0, 0
    (triangle, ends), low, high = _sorted(noise, low, high)
    axes = triangle.shape[1]
    if axes == 1:
        return float(_cell(*_limits(triangle, low, high, np.zeros((0, 1))))[0][0]), 0.0, 1
    power = max(0, math.ceil(math.log2(samples / REPLICATES)))
    means = _product(triangle, low, high, ends, _points(axes - 1, power, seed)).reshape(REPLICATES, -1).mean(axis=1)
    half = WIDER * float(student.ppf(0.975, REPLICATES - 1) * means.std(ddof=1) / math.sqrt(REPLICATES))
    return float(means.mean()), half, axes


def _points(dimension: int, power: int, seed: int) -> FloatArray:
    """(dimension, REPLICATES 2^power) points of the unit cube, each replicate with its own random digital shift."""
    shifts = np.random.default_rng(seed).integers(0, 1 << BITS, (dimension, REPLICATES, 1), dtype=np.uint32)
    shifted = (_sobol(dimension, power) ^ shifts).reshape(dimension, -1)
    return np.asarray((shifted + 0.5) * 2.0**-BITS, dtype=np.float64)


@lru_cache(maxsize=64)
def _sobol(dimension: int, power: int) -> NDArray[np.uint32]:
    """(dimension, REPLICATES, 2^power) digits of Sobol's points, scrambled in as many ways, the same ones always."""
    made = [Sobol(dimension, bits=BITS, seed=np.random.default_rng(k)).random_base2(power) for k in range(REPLICATES)]
    digits = np.floor(np.stack(made).transpose(2, 0, 1) * 2.0**BITS).astype(np.uint32)
    digits.setflags(write=False)
    return digits


def _missed(noise: FloatArray, low: FloatArray, high: FloatArray, samples: int, seed: int) -> tuple[float, float]:
    """1 - p, and the half width of its interval, where p is near 1.

    Sum over the sides, the nearest first, of P(this one is missed, those before are kept): disjoint, and each with the
    rare event on the first axis, so that every sample sees it. Sides that cannot matter any more widen the interval.
    """
    m = len(low)
    room = np.concatenate((high, -low))
    order = np.argsort(room)
    chances = ndtr(-room)
    kept_low, kept_high = np.full(m, -np.inf), np.full(m, np.inf)
    total = variance = doubt = 0.0
    share = max(SHARE, samples // max(1, int(np.count_nonzero(chances > NEGLIGIBLE * chances.max(initial=0.0)))))
    for turn, side in enumerate(order):
        if chances[side] <= NEGLIGIBLE * total:
            doubt += 0.5 * float(chances[side])
            continue
        row = int(side % m)
        below, above = kept_low.copy(), kept_high.copy()
        below[row], above[row] = (high[row], np.inf) if side < m else (-np.inf, low[row])
        used = (below > -np.inf) | (above < np.inf)
        value, half, _ = _estimate(noise[used], below[used], above[used], share, seed + 1 + turn)
        total, variance = total + value, variance + half * half
        if side < m:
            kept_high[row] = high[row]
        else:
            kept_low[row] = low[row]
    return total + doubt, math.sqrt(variance) + doubt


def _sorted(
    noise: FloatArray, low: FloatArray, high: FloatArray
) -> tuple[tuple[FloatArray, IntArray], FloatArray, FloatArray]:
    """K Q lower trapezoidal for an orthogonal Q, its rows in the order in which they take their axes.

    The next axis goes to the row that is kept with least probability once the axes before are at their conditional
    means; rows that the axes so far span end where they are first spanned.

    Returns:
        K Q (m, r') with the (m,) index of each row's last axis, low and high in its order.
    """
    m = len(low)
    rest = noise.copy()
    columns = np.zeros((m, min(noise.shape)))
    mean = np.zeros(m)
    ends = np.full(m, -1, dtype=np.int64)
    for j in range(columns.shape[1]):
        length = np.sqrt(np.einsum("ij,ij->i", rest, rest))
        open_rows = np.flatnonzero((ends < 0) & (length > SPANNED))
        if len(open_rows) == 0:
            break
        below, above = (low - mean)[open_rows] / length[open_rows], (high - mean)[open_rows] / length[open_rows]
        chance = _log_between(below, above)
        pick = int(chance.argmin())
        i = int(open_rows[pick])
        axis = rest[i] / length[i]
        columns[:, j] = rest @ axis
        rest -= np.outer(columns[:, j], axis)
        shift = _conditional_mean(float(below[pick]), float(above[pick]))
        mean += columns[:, j] * shift
        left = np.sqrt(np.einsum("ij,ij->i", rest, rest))
        ends[(ends < 0) & ((left <= SPANNED) | (np.arange(m) == i))] = j
    order = np.argsort(ends, kind="stable")
    width = int(ends.max()) + 1
    return (columns[order][:, :width], ends[order]), low[order], high[order]


def _log_between(low: FloatArray, high: FloatArray) -> FloatArray:
    """log(Phi(high) - Phi(low)), in whichever tail it lies."""
    flip = low > 0.0
    a, b = np.where(flip, -high, low), np.where(flip, -low, high)
    upper, lower = log_ndtr(b), log_ndtr(a)
    with np.errstate(divide="ignore", invalid="ignore"):
        value = upper + np.log1p(-np.exp(np.minimum(lower - upper, 0.0)))
    return np.where(np.isfinite(upper), value, -np.inf)


def _conditional_mean(low: float, high: float) -> float:
    """Of a standard normal inside [low, high]."""
    log_mass = float(_log_between(np.array([low]), np.array([high]))[0])
    if log_mass < -600.0:
        return low if abs(low) < abs(high) else high
    scale = math.exp(-log_mass) / math.sqrt(2.0 * math.pi)
    mean = (math.exp(-0.5 * low * low) - math.exp(-0.5 * high * high)) * scale
    return min(max(mean, low), high)


def _limits(
    triangle: FloatArray, low: FloatArray, high: FloatArray, drawn: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """What rows that end on axis j = len(drawn) leave of it: (N,) low, high, given the axes before (j, N)."""
    j = len(drawn)
    slope = triangle[:, j]
    past = triangle[:, :j] @ drawn
    one, other = (low[:, None] - past) / slope[:, None], (high[:, None] - past) / slope[:, None]
    rising = slope[:, None] > 0.0
    return np.where(rising, one, other).max(axis=0), np.where(rising, other, one).min(axis=0)


def _cell(low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Phi(high) - Phi(low) and where to draw from: mirrored where the cell is in the upper tail (sign -1)."""
    sign = np.where(low > 0.0, -1.0, 1.0)
    below, above = np.where(sign < 0.0, -high, low), np.where(sign < 0.0, -low, high)
    start = ndtr(below)
    return np.maximum(ndtr(above) - start, 0.0), start, sign, above


def _product(triangle: FloatArray, low: FloatArray, high: FloatArray, ends: IntArray, points: FloatArray) -> FloatArray:
    """(N,) products of the cells, along the axes, at points (axes - 1, N) of the unit cube."""
    axes = triangle.shape[1]
    weights = np.ones(points.shape[1])
    drawn = np.zeros((axes - 1, points.shape[1]))
    for j in range(axes):
        rows = ends == j
        width, start, sign, _ = _cell(*_limits(triangle[rows], low[rows], high[rows], drawn[:j]))
        weights *= width
        if j < axes - 1:
            inside = np.clip(start + points[j] * width, 1e-300, 1.0 - 1e-16)
            drawn[j] = sign * ndtri(inside)
    return weights
