"""How small an effect may be and still be found at recorded motions, and which effects it would be confused with.

A search takes an effect for real (`diagnosis.thresholds`) when what it explains has an RMS r [N m] with

    r >= least_removed * floor,   1 - e/sqrt(e^2 + r^2) >= least_gain,
    n ln(sqrt(e^2 + r^2)/e) - p/2 ln(n) >= least_log_evidence                                       (found)

e: RMS of what remains with the effect, at least the noise floor; n: independent samples in it; p: its parameters. The
smallest r of all three gives the smallest size, because the remainder of `contributions` tells r for each size.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from drake_tc.diagnosis.selection.lag_or_noise import LATE
from drake_tc.diagnosis.thresholds import JOINT, SAME_ERROR
from drake_tc.effects.base import Effect
from drake_tc.experiments.check.contributions import Contribution, explained_by
from drake_tc.experiments.sizes import Size
from drake_tc.types import FloatArray

Status = Literal["seen", "weakly", "not_seen", "not_separable"]
WEAK = 4.0
"""Smallest size over the typical size, up to which an effect is called weakly seen."""
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

    def least(self, parameters: int) -> float:
        """RMS [N m] that an effect with so many parameters must explain to be found: see the module."""
        evidence = JOINT.least_log_evidence + 0.5 * parameters * math.log(max(self.independent, 2.0))
        by_evidence = self.left * math.sqrt(math.expm1(min(2.0 * evidence / self.independent, 50.0)))
        by_gain = self.left * math.sqrt(1.0 / (1.0 - JOINT.least_gain) ** 2 - 1.0)
        return max(by_evidence, by_gain, JOINT.least_removed * self.floor)


@dataclass(frozen=True)
class Visibility:
    """What logs show of one effect.

    Attributes:
        key, id, title: Of the effect.
        status: At the typical size.
        size: What tells its strength.
        smallest: Size that is found whatever most of its other parameters are; infinite where none is.
        easiest: Size that is found where its other parameters are the most favourable ones.
        not_separable_from: Ids of effects that fit as well.
        kept: Share of its contribution (RMS) that the declared model does not imitate; 0 where it cannot be computed.
        reason: Why it is not seen, or only weakly, in one sentence; empty where it is seen.
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


def smallest_sizes(contributions: Sequence[Contribution], least: float, *, falling: bool) -> tuple[float, float]:
    """(smallest, easiest) sizes at which the remainder's RMS reaches `least` [N m]: over most shapes, over any shape.

    For a falling size (a limit) the largest sizes are told; infinite, or 0 for a falling size, where none suffices.
    """
    never = 0.0 if falling else math.inf
    found = []
    for each in contributions:
        rms = each.rms()
        if each.linear:
            found.append(least / float(rms[0]) if rms[0] > 0.0 else never)
            continue
        found.append(_crossing(each.sizes, rms, least, never))
    ordered = sorted(found, reverse=falling)
    place = min(math.ceil(SHAPES_SEEN * len(ordered)), len(ordered)) - 1
    return ordered[place], ordered[0]


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
    target = middle.at(size)
    for each in others.values():
        other = each[0].effect
        if other.id == effect.id or other.degrees_of_freedom > effect.degrees_of_freedom:
            continue
        lower = [p.lower for p in other.coefficients]
        left = max(min(explained_by(phase, shape, lower) for shape in each) for phase in target)
        same = math.hypot(noise.left, left) <= (1.0 + SAME_ERROR) * noise.left
        late = LATE.issuperset((effect.id, other.id)) and left < JOINT.least_removed * noise.floor
        if same or late:
            found[other.id] = None
    return tuple(found)
