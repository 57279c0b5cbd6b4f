"""Which of a joint's parameters changed between two posteriors.

With the values p_0 of the stored model, p_1 of new logs, and d = p_1 - p_0,

    d | C ~ N(0, S + sum_{k in C} s_k^2 e_k e_k'),    S = S_0 + S_1 + R + H

for a set C of parameters that changed. S_0 is diagonal, because a model file has intervals and no correlations; S_1 is
the whole covariance of the new fit. R is what one joint's parameters differ by from session to session, H what an
unmodelled temperature does to them, and s_k the prior size of a change. The set is the most probable one:

    log odds(C) = log N(d; 0, S_C) - log N(d; 0, S) + |C| log prior odds
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.priors import ALTERNATIVE
from drake_tc.effects.library import effect
from drake_tc.types import FloatArray

CHANGE_ODDS = -5.0
"""Log prior odds that a parameter changed."""
CHANGE_SIZE = 0.3
"""Standard deviation of a change over the parameter's value."""
FEWEST_DEVIATIONS = 10.0
"""Prior deviation of a change over the deviation of d, at least: a parameter near 0 has no scale of its own."""
SESSION_FRICTION = 0.02
"""Standard deviation of a friction from session to session over its mean, at least: rest, grease, load history."""
SESSION_OTHER = 0.003
"""The same of other parameters, the drive gain among them."""
FRICTION_PER_KELVIN = 0.05
"""Relative standard deviation of a friction for 1 K of difference: mineral oil loses 3 to 7 % of its viscosity."""
GAIN_PER_KELVIN = 0.002
"""The same of the drive gain: magnets lose 0.1 to 0.2 % of their torque constant."""


@dataclass(frozen=True)
class Known:
    """A value with its standard deviation, infinite where the logs do not limit it."""

    value: float
    deviation: float

    @classmethod
    def of(cls, value: float, ci95: Sequence[float]) -> "Known":
        """From a 95 % interval; of one that ends at a bound, the longer side counts."""
        return cls(value, max(value - ci95[0], ci95[1] - value, 0.0) / 1.96)

    @property
    def ci95(self) -> tuple[float, float]:
        """The 95 % interval."""
        return self.value - 1.96 * self.deviation, self.value + 1.96 * self.deviation


def session_deviation(key: str, size: float, run_spread: float) -> float:
    """Standard deviation from session to session of a parameter of the effect `key` ("drive"), of this size."""
    share = max(SESSION_FRICTION, run_spread) if is_friction(key) else SESSION_OTHER
    return share * size


def heat_deviation(key: str, size: float, kelvin: float) -> float:
    """Standard deviation of what a difference of temperature does to a parameter of this size."""
    share = GAIN_PER_KELVIN if key == "drive" else FRICTION_PER_KELVIN if is_friction(key) else 0.0
    return share * abs(kelvin) * size


def is_friction(key: str) -> bool:
    """Whether the effect is friction."""
    return key != "drive" and effect(key).kind == "friction"


def of_temperature(key: str) -> bool:
    """Whether the effect follows the temperature: it is no change of the joint."""
    return key != "drive" and "temperature" in effect(key).needs


@dataclass(frozen=True)
class Shift:
    """From one posterior to another, over p parameters.

    Attributes:
        difference: (p,) d.
        then, now: (p, p) S_0, diagonal, and S_1.
        between: (p,) variances of R + H.
        prior: (p,) s, the standard deviations of changes.
    """

    difference: FloatArray
    then: FloatArray
    now: FloatArray
    between: FloatArray
    prior: FloatArray

    def covariance(self, which: Sequence[int] = ()) -> FloatArray:
        """(p, p) S_C."""
        return self.then + self.now + np.diag(self.between + self._sizes(which))

    def _sizes(self, which: Sequence[int]) -> FloatArray:
        """(p,) prior variances of the changes of a set."""
        out = np.zeros(self.difference.size)
        out[list(which)] = self.prior[list(which)] ** 2
        return out

    def log_odds(self, which: Sequence[int]) -> float:
        """Log odds of a set over the empty one."""
        gain = _log_density(self.difference, self.covariance(which)) - _log_density(self.difference, self.covariance())
        return gain + CHANGE_ODDS * len(which)

    def best(self) -> tuple[tuple[int, ...], FloatArray]:
        """The most probable set, and for each parameter the log odds of the set with it over that without it."""
        best: tuple[int, ...] = ()
        odds = 0.0
        while True:
            toggled = [tuple(sorted(set(best) ^ {k})) for k in range(self.difference.size)]
            scores = [self.log_odds(each) for each in toggled]
            if not scores or max(scores) <= odds + 1e-9:
                return best, np.array([odds - s if k in best else s - odds for k, s in enumerate(scores)])
            best, odds = toggled[int(np.argmax(scores))], max(scores)

    def alternatives(self, best: tuple[int, ...]) -> list[tuple[int, int]]:
        """Pairs (k, l): with parameter l in place of k of the best set, the set is nearly as probable."""
        least, out = self.log_odds(best) - ALTERNATIVE, []
        for k in best:
            for other in set(range(self.difference.size)) - set(best):
                if self.log_odds([*(set(best) - {k}), other]) >= least:
                    out.append((k, other))
        return out

    def change(self, k: int, best: Sequence[int]) -> "Known":
        """The change of parameter k if it changed beside those of the best set: s_k^2 e_k' S_C^-1 d."""
        inverse, size = np.linalg.inv(self.covariance([*{*best, k}])), self.prior[k] ** 2
        return Known(float(size * inverse[k] @ self.difference), _root(size - size**2 * inverse[k, k]))

    def new(self, k: int, best: Sequence[int]) -> "Known":
        """(p_1 - p_0)_k under the new logs, with the stored posterior and that change as the prior."""
        before = self.then + np.diag(self.between + self._sizes([*{*best, k}]))
        gain = before[k] @ np.linalg.inv(before + self.now)
        return Known(float(gain @ self.difference), _root(before[k, k] - gain @ before[:, k]))


def _root(variance: float) -> float:
    return float(np.sqrt(max(variance, 0.0)))


def _log_density(difference: FloatArray, covariance: FloatArray) -> float:
    scale = np.sqrt(np.diag(covariance))
    lower = np.linalg.cholesky(covariance / np.outer(scale, scale) + 1e-9 * np.eye(scale.size))
    white = np.linalg.solve(lower, difference / scale)
    return float(-0.5 * white @ white - np.sum(np.log(np.diag(lower))) - np.sum(np.log(scale)))
