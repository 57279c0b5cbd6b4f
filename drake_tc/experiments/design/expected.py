"""What an experiment is expected to bring, in numbers and in sentences: of the logs so far, a sinusoid and the design.

All of it is read off posteriors: of the logs so far, and of the logs that the experiments would give (`next_log`).

Whether a position servo follows a designed motion, or its stiffness and the joint's inertia resonate with it: a servo
of stiffness 1/K that is commanded to q_d moves the joint, but for dry friction and gravity, as

    J q'' + F_v q' = (q_d - q)/K,   H(w) = 1/(1 - K J w^2 + i K F_v w)                              (following)

with the rotor's and the load's inertia J. The motion that the joint then makes is H applied to the designed one.

And which limit stands in the way of a goal: the criterion of rough motions, each limit in turn twice as wide.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.experiments.design.criteria import AllEffects, Criterion, Discrimination, Parameters
from drake_tc.experiments.design.forms import EffectForm
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.motions import JointLimits, MotionBasis, motion_basis, scaled
from drake_tc.experiments.design.search import random_start, sharp_value, single_waves
from drake_tc.experiments.fitted import FittedJoint
from drake_tc.experiments.log_odds import EffectOdds, Variant
from drake_tc.types import FloatArray

TOLD = 0.8
"""Probability of separating a pair of effects, below which the page says which limit prevents it."""


@dataclass(frozen=True)
class Expected:
    """What one quantity is worth before the experiment, with a growing sinusoid, and with the designed motion.

    Attributes:
        name, unit: Of the quantity.
        before: With the logs so far; NaN without logs.
        default: With a growing sinusoid of the same length and limits alone.
        after: With the designed motion alone.
    """

    name: str
    unit: str
    before: float
    default: float
    after: float


@dataclass(frozen=True, eq=False)
class Worth:
    """What one experiment is worth.

    Attributes:
        values: By quantity, its name and unit, in an order that all experiments share.
        total: One number, larger for a better experiment.
        scale: Logarithm of the smallest distance, or of one over the typical interval or size.
    """

    values: tuple[tuple[str, str, float], ...]
    total: float
    scale: float

    def gain_over(self, other: "Worth") -> float:
        """Factor by which distances are larger, or intervals and sizes smaller; infinite where the other has none."""
        apart = self.scale - other.scale
        return math.exp(apart) if apart < 50.0 else math.inf


def worth_of(criterion: Criterion, fitted: FittedJoint | None) -> Worth:
    """What a log is worth for a goal; nothing where it does not identify the joint.

    Args:
        criterion: Of the goal.
        fitted: The log.
    """
    if isinstance(criterion, Discrimination):
        return _of_discrimination(criterion, fitted)
    if isinstance(criterion, Parameters):
        return _of_parameters(criterion, fitted)
    if isinstance(criterion, AllEffects):
        return _of_everything(criterion, fitted)
    return Worth((), -math.inf, -math.inf)


def _of_discrimination(criterion: Discrimination, fitted: FittedJoint | None) -> Worth:
    forms = tuple(dict.fromkeys(form for order in criterion.orders for form in order))
    odds = None if fitted is None else _odds(fitted, forms)
    apart, probable, distances = [], [], []
    for truth, other in criterion.orders:
        name = f"error if {truth.effect.key} is fitted by {other.effect.key}, in standard deviations"
        found = [odds.apart(v, other.effect, truth.strength) for v in _variants(odds, truth)] if odds else [(0.0, 0.0)]
        apart.append(min(each[0] for each in found))
        distances.append((name, "-", math.sqrt(min(each[1] for each in found))))
        if odds:
            each = [odds.apart_probability(v, other.effect, truth.strength) for v in _variants(odds, truth)]
            probable.append(min(each))
    seen = []
    for form in forms:
        each = [odds.expected(v, form.strength) for v in _variants(odds, form)] if odds else [-math.inf]
        if odds:
            probable.append(min(odds.found_probability(v, form.strength) for v in _variants(odds, form)))
        information = min(
            (odds.beside(form.effect).information(*v.at(form.strength)) for v in _variants(odds, form)) if odds else [0]
        )
        apart.append(min(each))
        seen.append(
            (f"error if {form.effect.key} is not modelled, in standard deviations", "-", math.sqrt(information))
        )
    probability = ("probability that the runs distinguish them", "-", min(probable, default=0.0))
    least = min(distance for *_, distance in distances)
    return Worth((probability, *distances, *seen), min(apart), math.log(least) if least > 0.0 else -math.inf)


def _odds(fitted: FittedJoint, forms: Sequence[EffectForm]) -> EffectOdds:
    """Of the forms at the shapes that the goal has, whatever the log."""
    return EffectOdds(fitted, [form.effect for form in forms], {form.effect.key: form.shapes for form in forms})


def _variants(odds: EffectOdds | None, form: EffectForm) -> list[Variant]:
    return [] if odds is None else odds.variants[form.effect.key]


def _of_parameters(criterion: Parameters, fitted: FittedJoint | None) -> Worth:
    halves = [math.inf] * len(criterion.names)
    if fitted is not None:
        gain = fitted.parameters["drive"]["gain"]
        halves = [] if criterion.joint.gain_held else [0.5 * (gain.ci95[1] - gain.ci95[0]) / gain.value**2]
        for term in criterion.joint.declared:
            for p in term.effect.coefficients:
                found = fitted.parameters.get(term.effect.key, {}).get(p.name)
                halves.append(math.nan if found is None else 0.5 * (found.ci95[1] - found.ci95[0]))
        odds = _odds(fitted, criterion.forms) if criterion.forms else None
        halves += [1.96 * _deviation(odds, form) for form in criterion.forms if odds]
    names = zip(criterion.names, criterion.unit_names, halves, strict=True)
    relative = np.log(np.maximum(np.array(halves) / criterion.units, 1e-300))
    total = -float(np.nanmax(relative) if criterion.smallest else np.nanmean(relative))
    return Worth(tuple((f"{name}, half 95 % interval", unit, half) for name, unit, half in names), total, total)


def _deviation(odds: EffectOdds, form: EffectForm) -> float:
    """Standard deviation of the size of an effect that is estimated along, at the middle one of its shapes."""
    variant = odds.middle(form.effect)
    remainders = odds.beside(form.effect)
    if variant.by_shape:
        near = int(np.argmin(np.abs(np.log(variant.sizes / form.strength))))
        information = float(remainders.gram[variant.slopes[near], variant.slopes[near]])
    else:
        information = 1.0 / max(float(np.linalg.pinv(remainders.gram[np.ix_(variant.places, variant.places)])[0, 0]), 0)
        information *= float(variant.unit[0]) ** 2
    return 1.0 / math.sqrt(information) if information > 0.0 else math.inf


def _of_everything(criterion: AllEffects, fitted: FittedJoint | None) -> Worth:
    odds = None if fitted is None else _odds(fitted, criterion.forms)
    values, gains = [], []
    for form in criterion.forms:
        size = odds.found_from(form.effect.key)[0] if odds else math.inf
        size = size if size > 0.0 else math.inf
        word = "largest" if form.size.falling else "smallest"
        values.append((f"{word} {form.effect.key} that is found", form.size.unit, size))
        ratio = size / form.strength if form.size.falling else form.strength / size
        gains.append(-math.log1p(min(max(ratio if math.isfinite(ratio) else 0.0, 1e-6) ** -2, 1e12)))
    total = float(np.mean(gains)) if gains else -math.inf
    return Worth(tuple(values), total, 0.5 * total)


def expected_of(
    criterion: Criterion, before: Worth | None, default: Worth, designed: Worth, noun: str = "designed motion"
) -> tuple[tuple[Expected, ...], tuple[str, ...]]:
    """What an experiment is worth, and the same in sentences.

    Args:
        criterion: Of the goal.
        before: Of the logs so far; None where there are none.
        default: Of a growing sinusoid.
        designed: Of the experiment.
        noun: What a sentence calls the experiment.
    """
    given = [math.nan] * len(designed.values) if before is None else [value for *_, value in before.values]
    rows = tuple(
        Expected(name, unit, own, other, value)
        for (name, unit, value), (*_, other), own in zip(designed.values, default.values, given, strict=True)
    )
    if isinstance(criterion, Discrimination):
        return rows, _told_apart(criterion, rows, noun)
    if isinstance(criterion, Parameters):
        ratios: FloatArray = np.array([row.after / row.default for row in rows])
        text = (
            f"The 95 % intervals after the {noun} are {float(np.nanmedian(ratios)):.2f} times as wide as those after a "
            "growing sinusoid of the same length and limits (median over the parameters)."
        )
        return rows, (text,)
    return rows, _all_shown(criterion, rows, noun) if isinstance(criterion, AllEffects) else ()


def _told_apart(criterion: Discrimination, rows: tuple[Expected, ...], noun: str) -> tuple[str, ...]:
    names = " and ".join(
        f"{form.effect.key} ({form.strength:.3g} {form.size.unit})".replace(" -)", ")") for form in criterion.orders[0]
    )
    text = f"The {noun} distinguishes {names} with a probability of {100.0 * rows[0].after:.0f} %"
    text += f"; a growing sinusoid of the same length and limits does so with {100.0 * rows[0].default:.0f} %."
    more = [
        f"Where {truth} alone is the cause, no motion rules {other} out, which is the same function while the joint "
        f"slides: {proof}."
        for truth, other, proof in criterion.contained
    ]
    return (text, *more)


def _all_shown(criterion: AllEffects, rows: tuple[Expected, ...], noun: str) -> tuple[str, ...]:
    pairs = list(zip(criterion.forms, rows, strict=True))

    def shown(form: EffectForm, size: float) -> bool:
        return math.isfinite(size) and (size >= form.strength if form.size.falling else size <= form.strength)

    by_design, by_default = (sum(shown(f, getattr(r, name)) for f, r in pairs) for name in ("after", "default"))
    text = (
        f"Of {len(rows)} effects of typical size, the {noun} shows {by_design}; a growing sinusoid of the same length "
        f"and limits shows {by_default}."
    )
    never = [form.effect.key for form, row in pairs if math.isinf(row.after)]
    return (text, *((f"The {noun} shows {', '.join(never)} at no size (∞).",) if never else ()))


FOLLOWED = 1.05
"""Largest |H| up to which the servo is said to follow, and largest speed and acceleration over their limits."""


def followed_up_to(joint: DesignJoint) -> float:
    """Frequency [Hz] up to which |H| <= `FOLLOWED`; infinite where the servo does not resonate, or is none."""
    n = joint.numbers
    if joint.context.drive != "position_servo" or not n.inertia > 0.0:
        return math.inf
    # |H|^-2 = (1 - x)^2 + d x with x = K J w^2 and d = K F_v^2/J
    damping = n.gain * n.viscous**2 / n.inertia
    half, end = 1.0 - 0.5 * damping, 1.0 - FOLLOWED**-2
    if half <= 0.0 or half**2 <= end:
        return math.inf
    x = half - math.sqrt(half**2 - end)
    return math.sqrt(x / (n.gain * n.inertia)) / (2.0 * math.pi)


def followed(joint: DesignJoint, motion: FloatArray, step: float) -> FloatArray:
    """Motion (4, T) of the joint under a periodic designed motion (4, T), by (following).

    Args:
        joint: With a position servo.
        motion: One period.
        step: Time between its samples [s].
    """
    n, size = joint.numbers, motion.shape[1]
    w = 2.0 * np.pi * np.fft.rfftfreq(size, step)
    response = 1.0 / (1.0 - n.gain * n.inertia * w**2 + 1j * n.gain * n.viscous * w)
    return np.asarray(np.fft.irfft(np.fft.rfft(motion, axis=1) * response, size, axis=1))


def tracking_warning(joint: DesignJoint, limits: JointLimits, motion: FloatArray, step: float) -> tuple[str, ...]:
    """One sentence where the servo's resonance takes the joint beyond its limits; none where it does not."""
    highest = followed_up_to(joint)
    if not highest < limits.bandwidth_hz:
        return ()
    made = followed(joint, motion, step)
    speed, acceleration = (float(np.abs(row).max()) for row in made[1:3])
    if speed <= FOLLOWED * limits.velocity and acceleration <= FOLLOWED * limits.acceleration:
        return ()
    text = (
        f"The position servo's stiffness and the inertia resonate: as its logs are fitted, the joint would reach "
        f"{speed:.3g} rad/s and {acceleration:.3g} rad/s² where the limits are {limits.velocity:.3g} rad/s and "
        f"{limits.acceleration:.3g} rad/s². Design the motion with --bandwidth {highest:.2g}, up to which the servo "
        "follows its command."
    )
    return (joint.context.units.text(text),)


TRIES = 8
"""Random motions within each set of limits."""


def what_limits(joint: DesignJoint, limits: JointLimits, criterion: Criterion, basis: MotionBasis, seed: int) -> str:
    """One sentence: the limit whose doubling brings most, by the best of the same random motions and single waves.

    Args:
        joint: The joint.
        limits: That were kept.
        criterion: log of a squared distance.
        basis: Kind, period and step of the motion.
        seed: Of the random motions.
    """
    before = _best(joint, limits, criterion, basis, seed)
    low, high = limits.position
    half = 0.5 * (high - low)
    wider = {
        "the position limits": replace(limits, position=(low - half, high + half)),
        "the speed": replace(limits, velocity=2.0 * limits.velocity),
        "the acceleration": replace(limits, acceleration=2.0 * limits.acceleration),
        "the bandwidth": replace(limits, bandwidth_hz=2.0 * limits.bandwidth_hz),
        "acceleration, torque and bandwidth together": replace(
            limits,
            acceleration=2.0 * limits.acceleration,
            torque=2.0 * limits.torque,
            bandwidth_hz=2.0 * limits.bandwidth_hz,
        ),
    }
    gains = {name: _best(joint, each, criterion, basis, seed) - before for name, each in wider.items()}
    name, gain = max(gains.items(), key=lambda pair: pair[1])
    if not gain > np.log(1.2):
        return (
            "Twice as wide limits would not bring the two much further apart; the distance grows with the square root "
            "of the length of the experiment."
        )
    return (
        f"The limits, and not the search, keep the two close: of all limits, doubling {name} helps most and makes the "
        f"distance {float(np.exp(0.5 * gain)):.2g} times as large."
    )


def _best(joint: DesignJoint, limits: JointLimits, criterion: Criterion, basis: MotionBasis, seed: int) -> float:
    """The largest value of rough motions within limits; minus infinity where none keeps them."""
    rng = np.random.default_rng(seed)
    step = min(basis.step, 0.02 / limits.bandwidth_hz)
    own = scaled(motion_basis(basis.kind, basis.period, step, limits.bandwidth_hz), limits)
    found = -np.inf
    try:
        motions = [random_start(joint, own, limits, rng) for _ in range(TRIES)] + single_waves(joint, own, limits)
        for x in motions:
            found = max(found, sharp_value(joint, criterion, own, x))
    except ParamsError:
        pass
    return found
