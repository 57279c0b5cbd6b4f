"""What an experiment is expected to bring, in numbers and in sentences: of the logs so far, a sinusoid and the design.

All of it is read off posteriors: of the logs so far, and of the logs that the experiments would give (`next_log`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.experiments.design.criteria import AllEffects, Criterion, Discrimination, Parameters
from drake_tc.experiments.design.forms import EffectForm
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
        name = f"{truth.effect.key} fitted by {other.effect.key}: distance in standard deviations"
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
        seen.append((f"{form.effect.key} not modelled: distance in standard deviations", "-", math.sqrt(information)))
    probability = ("probability that these runs alone distinguish them", "-", min(probable, default=0.0))
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
        f"Of {len(rows)} effects of typical size the {noun} shows {by_design}, a growing sinusoid of the same length "
        f"and limits {by_default}."
    )
    never = [form.effect.key for form, row in pairs if math.isinf(row.after)]
    return (text, *((f"The {noun} shows no size (∞) of {', '.join(never)}.",) if never else ()))
