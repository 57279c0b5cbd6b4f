"""One joint's effects at its recorded motions: which would be seen, from which size on, and which would be confused."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from drake_tc.diagnosis.diagnose import candidates
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.effects.base import Effect
from drake_tc.effects.library import looked_for
from drake_tc.experiments.check.contributions import Contribution, ContributionBuilder, imitators
from drake_tc.experiments.check.facts import MotionFacts
from drake_tc.experiments.check.reasons import Evidence, sentence
from drake_tc.experiments.check.visibility import (
    WEAK,
    Noise,
    Status,
    Visibility,
    confused_with,
    separable_from,
    smallest_sizes,
)
from drake_tc.experiments.sizes import JointNumbers, Size, size_of
from drake_tc.identification.autocorrelation import correlation_time


@dataclass(frozen=True, eq=False)
class JointEffects:
    """What a joint's logs show of every effect.

    Attributes:
        numbers: The declared model.
        facts: Of the motion.
        noise: Of the balance.
        effects: One entry for each effect of the library, in its order.
        contributions: Of the effects that a diagnosis looks for, by key.
    """

    numbers: JointNumbers
    facts: MotionFacts
    noise: Noise
    effects: tuple[Visibility, ...]
    contributions: Mapping[str, Sequence[Contribution]] = field(default_factory=dict, repr=False)


def joint_numbers(prepared: Prepared) -> JointNumbers:
    """The declared model of a prepared joint, and the largest values of its rows."""
    columns, context = prepared.train, prepared.context
    builder = ContributionBuilder(prepared, _UNKNOWN)
    fitted = builder.declared
    named = {t.effect.key: i for i, t in enumerate(fitted.terms)}
    beta = {"viscous": 0.0, "coulomb": 0.0, "rotor_inertia": 0.0}
    at = 1
    for term in fitted.terms:
        if term.effect.key in beta and term.effect.key in named:
            beta[term.effect.key] = float(fitted.beta[at])
        at += len(term.effect.coefficients)
    s, rows = columns.samples.signals, columns.samples.rows
    a, tau = s.acceleration[rows], s.load_torque[rows]
    link = s.link_inertia
    if link == 0.0 and np.ptp(tau) > 0.0:
        basis = np.column_stack([a, np.sin(s.position[rows]), np.cos(s.position[rows]), s.velocity[rows]])
        link = max(float(np.linalg.lstsq(basis, tau, rcond=None)[0][0]), 0.0)
    return JointNumbers(
        gain=fitted.gain,
        viscous=max(beta["viscous"], 0.0),
        coulomb=max(beta["coulomb"], 0.0),
        inertia=link + s.rotor_inertia + beta["rotor_inertia"],
        torque=context.effort / fitted.gain,
        effort=context.effort,
        speed=context.max_speed,
        span=float(np.ptp(context.position_span)),
        rotor=s.rotor_inertia + beta["rotor_inertia"],
    )


_UNKNOWN = JointNumbers(1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0)


def joint_effects(
    prepared: Prepared, effects: Sequence[Effect] | None = None, *, links_fitted: bool = False
) -> JointEffects:
    """What the training rows of a prepared joint show of each effect.

    Args:
        prepared: One joint with its declared model.
        effects: In place of the library.
        links_fitted: Whether the diagnosis fits the robot's links, so that it does not look for what these take up.
    """
    numbers = joint_numbers(prepared)
    builder = ContributionBuilder(prepared, numbers)
    context = prepared.context
    searched = replace(context, load="links") if links_fitted else context
    usable, obstacles = candidates(looked_for(context, effects), searched, prepared.declared)
    made: dict[str, list[Contribution]] = {}
    sizes: dict[str, Size] = {}
    for effect in usable:
        sizes[effect.key] = _size(effect, numbers, prepared)
        made[effect.key] = builder.of(effect, sizes[effect.key])
    noise = _noise(prepared, builder, made)
    facts = MotionFacts.of(prepared.train, context, numbers.inertia)
    found = {effect.key: _visibility(effect, sizes[effect.key], made, noise, builder, facts) for effect in usable}
    for effect in looked_for(context, effects):
        obstacle = dict(obstacles).get(effect.key)
        if obstacle is not None:
            size = _size(effect, numbers, prepared)
            never = 0.0 if size.falling else float("inf")
            text = f"It cannot be looked for: {obstacle.statement}."
            found[effect.key] = Visibility(
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
    order = [e.key for e in looked_for(context, effects) if e.key in found]
    return JointEffects(numbers, facts, noise, tuple(found[key] for key in order), made)


def _size(effect: Effect, numbers: JointNumbers, prepared: Prepared) -> Size:
    """`size_of`, in the unit of the effort where nothing fixes the scale of the torques."""
    return size_of(effect, numbers, prepared.context, prepared.train.samples.units)


def _noise(prepared: Prepared, builder: ContributionBuilder, made: dict[str, list[Contribution]]) -> Noise:
    """Floor, and what a model of all effects at all their shapes leaves."""
    floor = prepared.floor / (prepared.train.gain or builder.declared.gain)
    residual = builder.residual()
    spans = [shape.span for each in made.values() for shape in each]
    if sum(span.shape[1] for span in spans) > residual.size / 20:
        spans = [each[len(each) // 2].span for each in made.values()]
    if spans:
        together = np.concatenate(spans, axis=1)
        norms = np.linalg.norm(together, axis=0)
        together = together[:, norms > 1e-12] / norms[norms > 1e-12]
        residual = residual - together @ np.linalg.lstsq(together, residual, rcond=1e-6)[0]
    samples = prepared.train.samples
    step = max(1, -(-samples.rows.size // residual.size))
    lengths = [int(n) for n in np.bincount(samples.run[::step]) if n]
    independent = max(residual.size / correlation_time(residual - residual.mean(), lengths), 3.0)
    left = max(float(np.sqrt(np.mean(residual**2))), floor)
    return Noise(floor, left, independent)


def _visibility(
    effect: Effect,
    size: Size,
    made: dict[str, list[Contribution]],
    noise: Noise,
    builder: ContributionBuilder,
    facts: MotionFacts,
) -> Visibility:
    own = made[effect.key]
    least = noise.least(effect.degrees_of_freedom)
    smallest, easiest = smallest_sizes(own, least, falling=size.falling, margin=noise.margin)
    middle = own[len(own) // 2]
    at = max(size.typical, min(smallest, WEAK * size.typical)) if not size.falling else min(size.typical, smallest)
    asked, given = (size.typical, smallest) if size.falling else (smallest, size.typical)
    status: Status = "seen" if asked <= given else "weakly" if asked <= WEAK * given else "not_seen"
    same: tuple[str, ...] = ()
    if status != "not_seen":
        same = confused_with(own, made, at, noise)
        status = "not_separable" if same else status
    separable: float | None = None
    below: tuple[str, ...] = ()
    if status in ("seen", "weakly") and not size.falling:
        separable, below = separable_from(own, made, (smallest, at), noise)
    whole, rms = float(middle.whole[-1]), float(middle.rms()[-1])
    kept = rms / whole if whole > 0.0 else 0.0
    reason = ""
    if status in ("not_seen", "weakly"):
        remainder = float(np.sqrt(np.mean(middle.at(size.typical) ** 2))) if size.typical > 0.0 else 0.0
        imitating = imitators(builder.declared, builder.design, middle.change)
        tolerated = middle.tolerated if smallest > middle.tolerated else 0.0
        evidence = Evidence(facts, size, kept, imitating, remainder, least, tolerated)
        reason = sentence(effect.id, evidence)
    return Visibility(
        effect.key, effect.id, effect.title, status, size, smallest, easiest, same, kept, reason, separable, below
    )
