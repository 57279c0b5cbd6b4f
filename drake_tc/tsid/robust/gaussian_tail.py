"""The standard normal's cdf, hazard and their derivatives, accurate in both tails; u any shape, no unit.

    Phi(u) cdf, phi(u) = exp(-u^2 / 2) / sqrt(2 pi)
    d/du log Phi = hazard(u) = phi(u) / Phi(u)
    d/du hazard = -curvature(u),  curvature = hazard (hazard + u) in (0, 1)

With x = -u the Mills ratio's continued fraction gives hazard + u = 1 / (x + 2 / (x + 3 / (x + ...))) without the
cancellation that costs u^2 roundings where u << 0 (Abramowitz & Stegun 26.2.14).
"""

import math
from typing import Any

import numpy as np
from scipy.special import erfcx, log_ndtr

from drake_tc.types import FloatArray

CEILING = 37.0
"""Above it exp(u^2 / 2) nears the largest double, and hazard and curvature are below 1e-297."""

FRACTION_BELOW = -4.0
FRACTION_TERMS = 40

_INVERSE_ROOT_2 = math.sqrt(0.5)
_ROOT_2_OVER_PI = math.sqrt(2.0 / math.pi)


def log_cdf(u: FloatArray) -> FloatArray:
    """Log Phi(u)."""
    value: FloatArray = log_ndtr(u)
    return value


def hazard(u: FloatArray) -> FloatArray:
    """phi(u) / Phi(u); 0 where it is less than the smallest double."""
    with np.errstate(over="ignore"):
        value: FloatArray = _ROOT_2_OVER_PI / erfcx(-_INVERSE_ROOT_2 * u)
    return value


def curvature(u: FloatArray) -> FloatArray:
    """Minus the second derivative of log Phi."""
    return curvature_of(np.minimum(u, CEILING), hazard(np.minimum(u, CEILING)))


def scaled_cdf(u: FloatArray) -> FloatArray:
    """2 Phi(u) exp(u^2 / 2) for u <= `CEILING`: from it come, for little more, log Phi and the hazard."""
    value: FloatArray = erfcx(-_INVERSE_ROOT_2 * u)
    return value


def risk_of(u: FloatArray, cdf: FloatArray) -> float:
    """-sum log Phi(u) from `scaled_cdf(u)`; rounded to 1e-16 of the largest u^2, so not for sums near 0."""
    return 0.5 * float(u @ u) - float(np.log(0.5 * cdf).sum())


def hazard_of(cdf: FloatArray) -> FloatArray:
    """The hazard from `scaled_cdf(u)`."""
    value: FloatArray = _ROOT_2_OVER_PI / cdf
    return value


def curvature_of(u: FloatArray, hazard: FloatArray) -> FloatArray:
    """Hazard (hazard + u) for u <= `CEILING`."""
    value = hazard + u
    value *= hazard
    if u.min(initial=0.0) < FRACTION_BELOW:
        deep = u < FRACTION_BELOW
        value[deep] = hazard[deep] * _hazard_plus_u(-u[deep])
    return value


def _hazard_plus_u(x: FloatArray) -> FloatArray:
    denominator: Any = x
    for k in range(FRACTION_TERMS, 1, -1):
        denominator = x + k / denominator
    value: FloatArray = 1.0 / denominator
    return value
