"""Which of a joint's parameters changed between two posteriors.

With the values p_0 of the stored model, p_1 of new logs, and d = p_1 - p_0,

    d | C ~ N(h, S + sum_{k in C} (s_k^2 e_k e_k' + f_k f_k')),    S = S_0 + S_1 + R + H

for a set C of parameters that changed. S_0 is diagonal, because a model file has intervals and no correlations; S_1 is
the whole covariance of the new fit. R is what one joint's parameters differ by from session to session, h and H what an
unmodelled temperature does to them, and s_k the prior size of a change. The sizes of an effect that the new logs have
and the model lacks are parameters that were 0; they change together, and what such an effect leaves open of the other
parameters is f_k. The set is the most probable one:

    log odds(C) = log N(d; h, S_C) - log N(d; h, S) + (number of changes) log prior odds
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

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
VISCOUS_PER_KELVIN = (-0.025, 0.025)
"""Mean and standard deviation of the relative change of viscous friction for 1 K more: a dry joint has 0, and mineral
oil loses 3 to 7 % of its viscosity."""
FRICTION_PER_KELVIN = (-0.015, 0.015)
"""The same of other friction, of which the oil bears a part."""
GAIN_PER_KELVIN = (0.0, 0.002)
"""The same of the drive gain: magnets lose 0.1 to 0.2 % of their torque constant, and windings gain resistance."""
OF_THE_OIL = ("viscous", "quadratic_viscous", "viscous_power")
"""Effects that are friction of the lubricant alone."""


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


def change_by_heat(key: str, value: float, kelvin: float) -> tuple[float, float]:
    """Mean and standard deviation of what a difference of temperature does to a parameter of this value."""
    if key == "drive":
        mean, deviation = GAIN_PER_KELVIN
    elif is_friction(key):
        mean, deviation = VISCOUS_PER_KELVIN if key in OF_THE_OIL else FRICTION_PER_KELVIN
    else:
        return 0.0, 0.0
    return mean * kelvin * value, deviation * abs(kelvin * value)


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
        expected: (p,) h; None: 0.
        together: Numbers of parameters that change together, the sizes of one effect; all others change alone.
        opened: By the first number of such a group, (p,) f.
    """

    difference: FloatArray
    then: FloatArray
    now: FloatArray
    between: FloatArray
    prior: FloatArray
    expected: FloatArray | None = None
    together: tuple[tuple[int, ...], ...] = ()
    opened: Mapping[int, FloatArray] = field(default_factory=dict)

    @cached_property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """Numbers of the parameters, those that change together in one group."""
        grouped = {k for group in self.together for k in group}
        return (*((k,) for k in range(self.difference.size) if k not in grouped), *self.together)

    @property
    def excess(self) -> FloatArray:
        """(p,) d - h."""
        return self.difference if self.expected is None else self.difference - self.expected

    def before(self, which: Sequence[int] = ()) -> FloatArray:
        """(p, p) covariance of the present parameters before the new logs: S_C - S_1."""
        variances = self.between.copy()
        variances[list(which)] += self.prior[list(which)] ** 2
        opened = sum((np.outer(f, f) for k, f in self.opened.items() if k in which), np.zeros_like(self.now))
        return np.asarray(self.then + np.diag(variances) + opened)

    def covariance(self, which: Sequence[int] = ()) -> FloatArray:
        """(p, p) S_C."""
        return self.before(which) + self.now

    def log_odds(self, which: Sequence[int]) -> float:
        """Log odds of a set over the empty one."""
        gain = _log_density(self.excess, self.covariance(which)) - _log_density(self.excess, self.covariance())
        return gain + CHANGE_ODDS * sum(group[0] in which for group in self.groups)

    def best(self) -> tuple[tuple[int, ...], FloatArray]:
        """The most probable set, and for each parameter the log odds of the set with it over that without it.

        The search adds and removes one change at a time, once from no change and once from all new effects.
        """
        starts = {(), tuple(sorted(k for group in self.together for k in group))}
        best, _, odds = max(map(self._climbed, sorted(starts)), key=lambda found: found[1])
        return best, odds

    def _climbed(self, best: tuple[int, ...]) -> tuple[tuple[int, ...], float, FloatArray]:
        """The set where no single change is more probable, its log odds, and those of each parameter."""
        odds = self.log_odds(best)
        while True:
            toggled = [tuple(sorted(set(best) ^ set(group))) for group in self.groups]
            scores = [self.log_odds(each) for each in toggled]
            if not scores or max(scores) <= odds + 1e-9:
                out = np.zeros(self.difference.size)
                for group, score in zip(self.groups, scores, strict=True):
                    out[list(group)] = odds - score if group[0] in best else score - odds
                return best, odds, out
            best, odds = toggled[int(np.argmax(scores))], max(scores)

    def alternatives(self, best: tuple[int, ...]) -> list[tuple[int, int]]:
        """Pairs (k, l): with the change of parameter l in place of k of the best set, the set is nearly as probable."""
        least, out = self.log_odds(best) - ALTERNATIVE, []
        inside = [group for group in self.groups if group[0] in best]
        for group in inside:
            for other in set(self.groups) - set(inside):
                if self.log_odds(sorted((set(best) - set(group)) | set(other))) >= least:
                    out.append((group[0], other[0]))
        return out

    def change(self, k: int, best: Sequence[int]) -> "Known":
        """The change of parameter k if it changed beside those of the best set: s_k^2 e_k' S_C^-1 (d - h)."""
        inverse, size = np.linalg.inv(self.covariance([*{*best, k}])), self.prior[k] ** 2
        return Known(float(size * inverse[k] @ self.excess), _root(size - size**2 * inverse[k, k]))

    def new(self, k: int, best: Sequence[int]) -> "Known":
        """(p_1 - p_0)_k under the new logs, with the stored posterior and that change as the prior."""
        before = self.before([*{*best, k}])
        gain = before[k] @ np.linalg.inv(before + self.now)
        moved = float(gain @ self.excess + (self.difference - self.excess)[k])
        return Known(moved, _root(before[k, k] - gain @ before[:, k]))


def _root(variance: float) -> float:
    return float(np.sqrt(max(variance, 0.0)))


def _log_density(difference: FloatArray, covariance: FloatArray) -> float:
    scale = np.sqrt(np.diag(covariance))
    lower = np.linalg.cholesky(covariance / np.outer(scale, scale) + 1e-9 * np.eye(scale.size))
    white = np.linalg.solve(lower, difference / scale)
    return float(-0.5 * white @ white - np.sum(np.log(np.diag(lower))) - np.sum(np.log(scale)))
