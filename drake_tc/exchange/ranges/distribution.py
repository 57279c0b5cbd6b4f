"""The distribution of one parameter, normal or lognormal and cut off at its limits, and the spread between fits."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import ndtr, ndtri

from drake_tc.types import FloatArray

CRITICAL = float(ndtri(0.975))
NEAR_ZERO = 4.0
"""A positive parameter within this many standard deviations of 0 is lognormal: a normal one would be cut off there."""

Law = Literal["normal", "lognormal"]


@dataclass(frozen=True)
class Distribution:
    """A parameter x = value + deviation z, or x = value exp(s z) with s^2 = log(1 + (deviation/value)^2); z ~ N(0, 1).

    What lies outside of [lower, upper] is cut off, not moved to the limit.

    Attributes:
        law: Which of the two.
        value: Median before the cut.
        deviation: Standard deviation, in the unit of the value; 0: the value alone.
        lower: Physical limit, inclusive.
        upper: The same.
    """

    law: Law
    value: float
    deviation: float
    lower: float = -np.inf
    upper: float = np.inf

    @property
    def scale(self) -> float:
        """The s of a lognormal parameter."""
        return float(np.sqrt(np.log1p((self.deviation / self.value) ** 2)))

    def quantile(self, share: FloatArray) -> FloatArray:
        """Values below which these shares of the distribution lie, of the same shape."""
        if self.deviation == 0.0:
            return np.full_like(share, self.value)
        ends = np.array([self.lower, self.upper])
        if self.law == "lognormal":
            with np.errstate(divide="ignore"):
                low, high = ndtr(np.log(np.maximum(ends, 0.0) / self.value) / self.scale)
            found = self.value * np.exp(self.scale * ndtri(low + share * (high - low)))
        else:
            low, high = ndtr((ends - self.value) / self.deviation)
            found = self.value + self.deviation * ndtri(low + share * (high - low))
        return np.asarray(np.clip(found, *ends))

    @property
    def interval(self) -> tuple[float, float]:
        """Its central 95 %."""
        low, high = self.quantile(np.array([0.025, 0.975]))
        return float(low), float(high)


def distribution(value: float, deviation: float, lower: float = -np.inf, upper: float = np.inf) -> Distribution:
    """The distribution of a parameter: lognormal where it is positive and its deviation reaches 0, otherwise normal.

    Args:
        value: Best estimate; one outside of the limits is moved to the limit.
        deviation: Standard deviation.
        lower: Physical limit.
        upper: The same.
    """
    value = float(np.clip(value, lower, upper))
    lognormal = lower >= 0.0 and 0.0 < value < NEAR_ZERO * deviation
    return Distribution("lognormal" if lognormal else "normal", value, float(deviation), lower, upper)


def deviation_of(value: float, ci95: tuple[float, float]) -> float:
    """Standard deviation of an estimate with this 95 % interval; the end that a limit has not cut off counts."""
    return max(ci95[1] - value, value - ci95[0], 0.0) / CRITICAL


def spread_between(values: Sequence[float], deviations: Sequence[float]) -> float:
    """Standard deviation tau between fits of which each has its own deviation (DerSimonian and Laird, 1986).

        Q = sum_k w_k (x_k - x)^2,   tau^2 = max(0, (Q - (K - 1))/(sum w_k - sum w_k^2/sum w_k)),   w_k = 1/s_k^2

    Args:
        values: (K,) x_k, at least two.
        deviations: (K,) s_k, positive.
    """
    x, w = np.asarray(values), 1.0 / np.asarray(deviations) ** 2
    mean = float(w @ x / w.sum())
    excess = float(w @ (x - mean) ** 2) - (x.size - 1)
    return float(np.sqrt(max(excess / float(w.sum() - (w @ w) / w.sum()), 0.0)))


def of_units(units: Sequence[Distribution]) -> Distribution:
    """What a further unit may have, from the distributions of this parameter in K units.

    With weights w_k = 1/(s_k^2 + tau^2) its value is sum w_k x_k/sum w_k, its variance tau^2 + 1/sum w_k.

    Args:
        units: One a unit, at least one.
    """
    first = units[0]
    if len(units) == 1:
        return first
    x = np.array([each.value for each in units])
    s = np.maximum([each.deviation for each in units], 1e-12 * max(float(np.max(np.abs(x))), 1e-300))
    tau = spread_between(x.tolist(), s.tolist())
    w = 1.0 / (s**2 + tau**2)
    deviation = float(np.sqrt(tau**2 + 1.0 / w.sum()))
    return distribution(float(w @ x / w.sum()), deviation, first.lower, first.upper)
