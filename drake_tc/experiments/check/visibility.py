"""How small an effect may be and still be found at recorded motions, and which effects it would be confused with.

A diagnosis names an effect (`diagnosis.priors`) when what it explains has an RMS r [N m] with

    r >= NAMED_FLOORS floor,   n ln(sqrt(e^2 + r^2)/e) - p/2 ln(n) >= NAMED                         (found)

e: RMS of what remains with the effect, at least the noise floor; n: independent samples in it; p: its parameters. The
smallest r that meets both gives the size that is found in half of all logs, because the remainder of
`contributions` tells r for each size. In one log the noise adds N(0, e^2/n) to r. An r that is larger by
z e/sqrt(n), z the 95 % quantile of the standard normal distribution, is therefore found in 95 % of the logs, and one
that is smaller by as much in 5 %.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from drake_tc.diagnosis.priors import NAMED, NAMED_FLOORS
from drake_tc.diagnosis.thresholds import SAME_ERROR
from drake_tc.effects.base import Effect
from drake_tc.experiments.check.contributions import NUMERICAL, Contribution, is_late
from drake_tc.experiments.sizes import Size
from drake_tc.types import FloatArray

Status = Literal["seen", "weakly", "not_seen", "not_separable"]
WEAK = 4.0
"""Smallest size over the typical size, up to which an effect is called weakly seen."""
CERTAIN = 1.6448536269514722
"""95 % quantile z of the standard normal distribution."""
SEPARABLE_WITHIN = 1.1
"""Ratio to which the size is known from which on an effect is separable."""
SHAPES_SEEN = 0.8
"""Share of the shapes of an effect at which the size that counts as found must suffice."""


@dataclass(frozen=True)
class Noise:
    """What is left of the balance when nothing is missing.

    Attributes:
        floor: What the sensors' noise alone leaves [N m].
        left: RMS that the best model of all effects together leaves, at least the floor [N m].
        independent: Number of independent samples in it.
    """

    floor: float
    left: float
    independent: float

    @property
    def margin(self) -> float:
        """What noise adds to, or takes from, the RMS that an effect explains [N m], with 95 % certainty each."""
        return CERTAIN * self.left / math.sqrt(self.independent)

    def least(self, parameters: int) -> float:
        """RMS [N m] that an effect with so many parameters must explain to be found in half of all logs."""
        evidence = NAMED + 0.5 * parameters * math.log(max(self.independent, 2.0))
        by_evidence = self.left * math.sqrt(math.expm1(min(2.0 * evidence / self.independent, 50.0)))
        return max(by_evidence, NAMED_FLOORS * self.floor)


@dataclass(frozen=True)
class Visibility:
    """What logs show of one effect.

    Attributes:
        key, id, title: Of the effect.
        status: At the typical size.
        size: What tells its strength.
        smallest: Size that is found in 95 % of such logs, whatever most of its other parameters are; infinite where
            none is.
        easiest: Size that is found in 5 % of such logs where its other parameters are the most favourable ones.
        not_separable_from: Ids of effects that fit as well.
        kept: Share of its contribution (RMS) that the declared model does not imitate; 0 where it cannot be computed.
        reason: Why it is not seen, or only weakly, in one sentence; empty where it is seen.
        separable: Size below which it is found but fits as well as `confused_below`; None where there is no such size.
        confused_below: Ids of these effects.
        obstacle: Why it cannot be looked for at all, without its full stop; empty where it can.
    """

    key: str
    id: str
    title: str
    status: Status
    size: Size
    smallest: float
    easiest: float
    not_separable_from: tuple[str, ...] = ()
    kept: float = 0.0
    reason: str = ""
    separable: float | None = None
    confused_below: tuple[str, ...] = ()
    obstacle: str = ""

    @property
    def why(self) -> str:
        """What the user should know of the verdict, in one sentence without its full stop; empty where nothing is."""
        if self.not_separable_from:
            return f"not separable from {', '.join(self.not_separable_from)}"
        if self.separable is not None:
            names = ", ".join(self.confused_below)
            below = f"below {self.separable:.3g} {self.size.unit}".removesuffix(" -")
            return f"{below} not separable from {names}" if not self.reason else self.reason
        return self.reason


def smallest_sizes(
    contributions: Sequence[Contribution], least: float, *, falling: bool, margin: float = 0.0
) -> tuple[float, float]:
    """(smallest, easiest) sizes at which the RMS of the remainder is reached: over most shapes, over any shape.

    For a falling size (a limit) the largest sizes are told; infinite, or 0 for a falling size, where none suffices.

    Args:
        contributions: Of the effect, at its shapes.
        least: RMS of the remainder that is found in half of all logs [N m].
        margin: By how much more is found for certain, and by how much less hardly ever [N m].
        falling: Whether a smaller size is a stronger effect.
    """
    most = _reaching(contributions, least + margin, falling=falling)
    place = min(math.ceil(SHAPES_SEEN * len(most)), len(most)) - 1
    return most[place], _reaching(contributions, max(least - margin, 0.0), falling=falling)[0]


def _reaching(contributions: Sequence[Contribution], least: float, *, falling: bool) -> list[float]:
    """Sizes at which the remainder's RMS reaches `least` at each shape, the weakest effect first."""
    never = 0.0 if falling else math.inf
    found = []
    for each in contributions:
        rms = each.rms()
        if each.linear:
            found.append(least / float(rms[0]) if rms[0] > NUMERICAL * float(each.whole[0]) else never)
            continue
        found.append(_crossing(each.sizes, rms, least, never))
    return sorted(found, reverse=falling)


def _crossing(sizes: FloatArray, rms: FloatArray, least: float, never: float) -> float:
    """Weakest size of a grid (weakest first) from which on the RMS reaches `least`, between two sizes in proportion."""
    reached = np.flatnonzero(rms >= least)
    if not reached.size:
        return never
    at = int(reached[0])
    if at == 0:
        return float(sizes[0] * least / rms[0]) if sizes[0] <= sizes[-1] else float(sizes[0])
    low, high = max(float(rms[at - 1]), 1e-300), float(rms[at])
    share = math.log(least / low) / math.log(high / low) if low > 1e-200 else 1.0
    return float(math.exp((1.0 - share) * math.log(sizes[at - 1]) + share * math.log(sizes[at])))


def confused_with(
    own: Sequence[Contribution], others: Mapping[str, Sequence[Contribution]], size: float, noise: Noise
) -> tuple[str, ...]:
    """Ids of the effects that explain an effect of this size as well as itself, by the rules of a diagnosis.

    Args:
        own: The effect at its shapes; the middle one stands for it.
        others: By key, the other effects.
        size: Of the effect.
        noise: Of the rows.
    """
    middle = own[len(own) // 2]
    effect: Effect = middle.effect
    found: dict[str, None] = {}
    for each in others.values():
        other = each[0].effect
        if other.id == effect.id or other.degrees_of_freedom > effect.degrees_of_freedom:
            continue
        left = float(np.max(np.min([middle.left_by(shape, size) for shape in each], axis=0)))
        same = math.hypot(noise.left, left) <= (1.0 + SAME_ERROR) * noise.left
        late = is_late(effect) and is_late(other) and left < NAMED_FLOORS * noise.floor
        if same or late:
            found[other.id] = None
    return tuple(found)


def separable_from(
    own: Sequence[Contribution],
    others: Mapping[str, Sequence[Contribution]],
    sizes: tuple[float, float],
    noise: Noise,
) -> tuple[float | None, tuple[str, ...]]:
    """(size, ids): below the size an effect that is found fits as well as these effects, by `confused_with`.

    The difference of two effects grows with their size, so that an effect that is confused with none at its typical
    size may be confused with one at the smallest size that is found.

    Args:
        own: The effect at its shapes.
        others: By key, the other effects.
        noise: Of the rows.
        sizes: (smallest size that is found, size at which it is confused with none).
    """
    low, high = sizes
    same = confused_with(own, others, low, noise)
    if not same or not low < high < math.inf:
        return None, ()
    while high > SEPARABLE_WITHIN * low:
        middle = math.sqrt(low * high)
        found = confused_with(own, others, middle, noise)
        low, high, same = (middle, high, found) if found else (low, middle, same)
    return high, same
