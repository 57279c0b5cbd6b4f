"""The standard normal's cdf, hazard and their derivatives, accurate in both tails; u has no unit.

    Phi(u) cdf, phi(u) = exp(-u^2 / 2) / sqrt(2 pi)
    d/du log Phi = hazard(u) = phi(u) / Phi(u)
    d/du hazard = -curvature(u),  curvature = hazard (hazard + u) in (0, 1)

With x = -u the Mills ratio's continued fraction gives hazard + u = 1 / (x + 2 / (x + 3 / (x + ...))) without the
cancellation that costs u^2 roundings where u << 0 (Abramowitz & Stegun 26.2.14); the scaled complementary error
function of large arguments has the fraction 1 / (sqrt(pi) (x + (1/2) / (x + 1 / (x + (3/2) / (x + ...))))) (7.1.14).
"""

import math

from drake_tc.kernels.compiling import helper

CEILING = 37.0
"""Above it exp(u^2 / 2) nears the largest double, and hazard and curvature are below 1e-297."""

FRACTION_BELOW = -4.0
FRACTION_TERMS = 40
_SCALED_ABOVE, _SCALED_TERMS = 5.0, 30
_INVERSE_ROOT_2 = math.sqrt(0.5)
_ROOT_2_OVER_PI = math.sqrt(2.0 / math.pi)
_INVERSE_ROOT_PI = 1.0 / math.sqrt(math.pi)
_LOG_ROOT_2_PI = 0.5 * math.log(2.0 * math.pi)


@helper
def scaled_erfc(x: float) -> float:
    """exp(x^2) erfc(x); infinite below -26."""
    if not x > _SCALED_ABOVE:
        return math.exp(x * x) * math.erfc(x) if x > -26.6 else math.inf if x == x else x
    below = x
    for k in range(_SCALED_TERMS, 0, -1):
        below = x + 0.5 * k / below
    return _INVERSE_ROOT_PI / below


@helper
def log_cdf(u: float) -> float:
    """Log Phi(u)."""
    x = -_INVERSE_ROOT_2 * u
    if u > 0.0:
        return math.log1p(-0.5 * math.erfc(-x))
    if u == -math.inf:
        return u
    return math.log(0.5 * scaled_erfc(x)) - x * x if u < -1.0 else math.log(0.5 * math.erfc(x))


@helper
def hazard(u: float) -> float:
    """phi(u) / Phi(u); 0 where it is less than the smallest double."""
    return _ROOT_2_OVER_PI / scaled_erfc(-_INVERSE_ROOT_2 * u)


@helper
def curvature_of(u: float, rate: float) -> float:
    """Minus the second derivative of log Phi for u <= `CEILING`, from the hazard there."""
    if u >= FRACTION_BELOW:
        return rate * (rate + u)
    x = -u
    below = x
    for k in range(FRACTION_TERMS, 1, -1):
        below = x + k / below
    return rate / below


@helper
def around_zero(a: float, b: float) -> float:
    """-log of the mass of [-b, a], over sqrt 2, for a, b >= 0."""
    tails = 0.5 * (math.erfc(a) + math.erfc(b))
    if tails < 0.5:
        return -math.log1p(-tails)
    mass = 0.5 * (math.erf(a) + math.erf(b))
    return -math.log(mass) if mass > 0.0 else math.inf


@helper
def interval_risk(above: float, below: float) -> float:
    """-log P, P = Phi(a) - Phi(-b), of [-b, a] for a + b > 0; infinite where that is not so. Convex in (a, b).

    Whether the interval is wide, far out in one tail or both, P keeps its digits: -log(1 - tails) where they are small,
    erf where 0 is inside, scaled erfc where it is not.
    """
    a, b = _INVERSE_ROOT_2 * above, _INVERSE_ROOT_2 * below
    if a >= 0.0 and b >= 0.0:
        return around_zero(a, b)
    if not a + b > 0.0:
        return math.inf
    near, far = max(-a, -b), max(a, b)
    share = scaled_erfc(near) - math.exp((near - far) * (near + far)) * scaled_erfc(far)
    return near * near - math.log(0.5 * share) if share > 0.0 else math.inf


@helper
def interval_density(end: float, risk: float) -> float:
    """phi(end) / P of an interval that ends there, from -log P."""
    return math.exp(risk - _LOG_ROOT_2_PI - 0.5 * end * end)
