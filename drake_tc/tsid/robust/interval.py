"""-log of the probability that a standard normal falls into an interval, with two derivatives."""

import math

import numpy as np
from scipy.special import erf, erfc, erfcx

from drake_tc.types import FloatArray

_INVERSE_ROOT_2 = math.sqrt(0.5)
_LOG_ROOT_2_PI = 0.5 * math.log(2.0 * math.pi)


def interval_risk(above: FloatArray, below: FloatArray) -> FloatArray:
    """-log P, P = Phi(a) - Phi(-b), of [-b, a] for a + b > 0; inf where that is not so. Convex in (a, b).

    Arguments and result have one shape. Whether the interval is wide, far out in one tail or both, P keeps its digits:
    -log(1 - tails) where they are small, erf where 0 is inside, scaled erfc where it is not.
    """
    a, b = _INVERSE_ROOT_2 * above, _INVERSE_ROOT_2 * below
    inside = (a >= 0.0) & (b >= 0.0)
    if inside.all():
        return _around_zero(a, b)
    risk = np.full(a.shape, np.inf)
    risk[inside] = _around_zero(a[inside], b[inside])
    aside = ~inside & (a + b > 0.0)
    near, far = np.maximum(-a, -b)[aside], np.maximum(a, b)[aside]
    share = erfcx(near) - np.exp((near - far) * (near + far)) * erfcx(far)
    with np.errstate(divide="ignore"):
        risk[aside] = near * near - np.log(0.5 * share)
    return risk


def _around_zero(a: FloatArray, b: FloatArray) -> FloatArray:
    tails = 0.5 * (erfc(a) + erfc(b))
    if tails.size and tails.max() < 0.5:
        return np.asarray(-np.log1p(-tails), dtype=np.float64)
    with np.errstate(divide="ignore"):
        log = np.where(tails < 0.5, np.log1p(-np.minimum(tails, 0.5)), np.log(0.5 * (erf(a) + erf(b))))
    return np.asarray(-log, dtype=np.float64)


def interval_slopes(
    above: FloatArray, below: FloatArray, risk: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Derivatives of -log P by (a, b): -A, -B, A (a + A), A B, B (b + B), A = phi(a) / P, B = phi(b) / P.

    Args:
        above: a.
        below: b > -a.
        risk: -log P of them.
    """
    by_a = np.exp(risk - _LOG_ROOT_2_PI - 0.5 * above * above)
    by_b = np.exp(risk - _LOG_ROOT_2_PI - 0.5 * below * below)
    return -by_a, -by_b, by_a * (above + by_a), by_a * by_b, by_b * (below + by_b)
