"""One joint's effects at its recorded motions: which would be seen, from which size on, and which would be confused."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from drake_tc.diagnosis.data.samples import rms
from drake_tc.diagnosis.priors import NAMED, NAMED_FLOORS
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.effects.base import Effect
from drake_tc.effects.library import looked_for
from drake_tc.effects.obstacle import Obstacle
from drake_tc.experiments.check.reasons import Hidden, MotionFacts, sentence
from drake_tc.experiments.check.visibility import WEAK, Status, Visibility
from drake_tc.experiments.fitted import FittedJoint, fitted_joint
from drake_tc.experiments.log_odds import EffectOdds
from drake_tc.experiments.sizes import JointNumbers, size_of

SEPARABLE_WITHIN = 1.1
"""Ratio to which the size is known from which on an effect is separable."""


@dataclass(frozen=True)
class Noise:
    """What the most probable model leaves.

    Attributes:
        floor: What the sensors' noise alone leaves [N m].
        left: RMS that the model leaves, at least the floor [N m].
        independent: Number of rows that count.
    """

    floor: float
    left: float
    independent: float

    def least(self, parameters: int, sure: float = 0.0) -> float:
        """RMS [N m] that a common effect with so many parameters must explain to be found (`log_odds`)."""
        occam = NAMED + 0.5 * parameters * math.log(max(self.independent, 2.0))
        by_evidence = self.left * (math.sqrt(2.0 * occam) + sure) / math.sqrt(self.independent)
        return max(by_evidence, NAMED_FLOORS * self.floor)


@dataclass(frozen=True, eq=False)
class JointEffects:
    """What a joint's logs show of every effect.

    Attributes:
        fitted: The joint as `close-loop` fits it.
        facts: Of the motion.
        noise: Of the balance.
        effects: One entry for each effect of the library, in its order.
    """

    fitted: FittedJoint
    facts: MotionFacts
    noise: Noise
    effects: tuple[Visibility, ...]

    @property
    def numbers(self) -> JointNumbers:
        """The declared model."""
        return self.fitted.numbers


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
    return JointEffects(fitted, facts, joint_noise(fitted), tuple(found))


def joint_noise(fitted: FittedJoint) -> Noise:
    """What the most probable model of a joint leaves."""
    evidence, floor = fitted.evidence, fitted.floor / fitted.gain
    left = rms(evidence.residual(evidence.model.train, fitted.best)) / fitted.gain
    return Noise(floor, max(left, floor), max(fitted.independent, 3.0))


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
    variant, reason = odds.middle(effect), ""
    strongest = float(variant.sizes[-1]) if variant.by_shape else 1.0
    kept = odds.left(variant, strongest) / max(odds.whole(variant, strongest), 1e-300)
    if status in ("not_seen", "weakly"):
        reason = sentence(effect, _why_hidden(odds, effect, facts, smallest, kept))
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


def _why_hidden(odds: EffectOdds, effect: Effect, facts: MotionFacts, smallest: float, kept: float) -> Hidden:
    size, variant = odds.sizes[effect.key], odds.middle(effect)
    gain = odds.fitted.gain
    typical = odds.left(variant, size.typical) / gain if size.typical > 0.0 else 0.0
    asked = odds.left(variant, smallest) / gain if 0.0 < smallest < math.inf else math.inf
    return Hidden(facts, size, smallest, kept, odds.imitators(variant, max(size.typical, 1e-300)), typical, asked)
