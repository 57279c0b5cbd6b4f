"""What logs show of one effect, and effects that cannot be looked for, by the reason.

One joint's effects at its recorded motions: which would be seen, from which size on, and which would be confused.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.effects.base import Effect
from drake_tc.effects.context import Obstacle
from drake_tc.effects.library import looked_for
from drake_tc.experiments.check.reasons import MotionFacts, why_hidden
from drake_tc.experiments.fitted import FittedJoint, fitted_joint
from drake_tc.experiments.log_odds import EffectOdds
from drake_tc.experiments.sizes import Size, size_of

Status = Literal["seen", "weakly", "not_seen", "not_separable"]
WEAK = 4.0
"""Smallest size over the typical size, up to which an effect is called weakly seen."""


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
        kept: Share of its contribution (RMS) that the rest of the model does not imitate; 0 where it cannot be
            computed.
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
            return self.reason or f"below {self.size.text(self.separable)} not separable from {names}"
        return self.reason


Reasons = dict[str, tuple[str, ...]]
"""By reason, keys of effects."""


def by_reason(effects: Sequence[Visibility]) -> Reasons:
    """Effects of one joint that cannot be looked for, in the order of the library."""
    found: dict[str, list[str]] = {}
    for each in effects:
        if each.obstacle:
            found.setdefault(each.obstacle, []).append(each.key)
    return {reason: tuple(keys) for reason, keys in found.items()}


def shared_and_own(joints: Mapping[str, Sequence[Visibility]]) -> tuple[Reasons, dict[str, Reasons]]:
    """What no joint can show for the same reason, and what is left by joint. A single joint shares nothing.

    Args:
        joints: By joint, its effects.
    """
    each = {joint: by_reason(effects) for joint, effects in joints.items()}
    if len(each) < 2:
        return {}, each
    first, *others = each.values()
    shared = {reason: keys for reason, keys in first.items() if all(o.get(reason) == keys for o in others)}
    own = {joint: {r: k for r, k in reasons.items() if r not in shared} for joint, reasons in each.items()}
    return shared, own


SEPARABLE_WITHIN = 1.1
"""Ratio to which the size is known from which on an effect is separable."""


@dataclass(frozen=True, eq=False)
class JointEffects:
    """What a joint's logs show of every effect.

    Attributes:
        fitted: The joint as `close-loop` fits it.
        facts: Of the motion.
        effects: One entry for each effect of the library, in its order.
    """

    fitted: FittedJoint
    facts: MotionFacts
    effects: tuple[Visibility, ...]


def joint_effects(
    prepared: Prepared, effects: Sequence[Effect] | None = None, *, links_fitted: bool = False
) -> JointEffects:
    """What the training rows of a prepared joint show of each effect.

    Args:
        prepared: One joint with its declared model.
        effects: In place of the library.
        links_fitted: Whether the diagnosis fits the robot's links, so that it does not look for what these take up.
    """
    fitted = fitted_joint(prepared, effects, links_fitted=links_fitted)
    listed = looked_for(fitted.context, effects)
    usable = {e.key for e in fitted.usable}
    odds = EffectOdds(fitted, [e for e in listed if e.key in usable])
    facts = MotionFacts.of(prepared.train, fitted.context, fitted.numbers.inertia)
    found = [
        _visibility(effect, odds, facts)
        if effect.key in usable
        else _hidden(effect, fitted, fitted.obstacles[effect.key])
        for effect in listed
        if effect.key in usable or effect.key in fitted.obstacles
    ]
    return JointEffects(fitted, facts, tuple(found))


def _hidden(effect: Effect, fitted: FittedJoint, obstacle: Obstacle) -> Visibility:
    """An effect that cannot be looked for."""
    size = size_of(effect, fitted.numbers, fitted.context, fitted.prepared.train.samples.units)
    never = 0.0 if size.falling else math.inf
    text = f"It cannot be looked for: {obstacle.statement}."
    return Visibility(
        effect.key,
        effect.id,
        effect.title,
        "not_seen",
        size,
        never,
        never,
        reason=text,
        obstacle=obstacle.statement,
    )


def _visibility(effect: Effect, odds: EffectOdds, facts: MotionFacts) -> Visibility:
    size = odds.sizes[effect.key]
    smallest, easiest = odds.found_from(effect.key)
    asked, given = (size.typical, smallest) if size.falling else (smallest, size.typical)
    status: Status = "seen" if asked <= given else "weakly" if asked <= WEAK * given else "not_seen"
    at = max(size.typical, min(smallest, WEAK * size.typical)) if not size.falling else min(size.typical, smallest)
    same: tuple[str, ...] = ()
    separable, below = None, same
    if status != "not_seen":
        same = odds.confused_with(effect, at)
        if not same and not size.falling:
            separable, below = _separable(effect, odds, (smallest, at))
        status = "not_separable" if same else status
    kept, reason = odds.kept(effect), ""
    if status in ("not_seen", "weakly"):
        reason = why_hidden(effect, odds, facts, smallest, kept)
    return Visibility(
        effect.key, effect.id, effect.title, status, size, smallest, easiest, same, kept, reason, separable, below
    )


def _separable(effect: Effect, odds: EffectOdds, sizes: tuple[float, float]) -> tuple[float | None, tuple[str, ...]]:
    """(size, ids): below the size an effect that is found fits as well as these effects.

    The difference of two effects grows with their size, so that an effect that is confused with none at its typical
    size may be confused with one at the smallest size that is found.
    """
    low, high = sizes
    same = odds.confused_with(effect, low)
    if not same or not low < high < math.inf:
        return None, ()
    while high > SEPARABLE_WITHIN * low:
        middle = math.sqrt(low * high)
        found = odds.confused_with(effect, middle)
        low, high, same = (middle, high, found) if found else (low, middle, same)
    return high, same
