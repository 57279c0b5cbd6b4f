"""What an experiment is worth for a goal, read off the posterior of its log.

A search maximises these criteria on rough logs of the motions that it tries (`next_log.rough_log`), and the stated
figures are those of the simulated log of the motion that it finds (`next_log.next_log`).

    parameters:  -log det C, or -log lambda_max(C)                                   (D- and E-optimality)
    tell:        the least standard deviation by which a diagnosis names either effect, and rules the other one out
    all:         mean over all effects of -log(1 + (r_least/r)^2)

C is the posterior covariance of the parameters in units of their typical sizes, and r_least the size from which on an
effect is found (`log_odds`). In `tell` each effect is taken for the truth in turn, at each of its shapes and signs, and
is compared with the best fit of the other one (T-optimality; Atkinson and Fedorov, Biometrika 62, 1975, eq. 2). The
smallest of the standard deviations is that of the stated probability.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.linalg import block_diag
from scipy.stats import norm

from drake_tc.diagnosis.intervals import CRITICAL
from drake_tc.diagnosis.priors import ALTERNATIVE
from drake_tc.effects.base import Effect
from drake_tc.effects.library import effect
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.fitted import FittedJoint
from drake_tc.experiments.log_odds import EffectOdds
from drake_tc.experiments.sizes import Size, size_of
from drake_tc.report.numbers import pretty_unit
from drake_tc.types import FloatArray

MOST_SHAPES = 3
WIDEST = 1e6
"""Standard deviation over the typical size of a parameter that counts as unknown."""


@dataclass(frozen=True, eq=False)
class EffectForm:
    """One effect as it takes part in a goal.

    Attributes:
        effect: The effect. size: What tells its strength.
        strength: Size that is put in.
        shapes: Values of its shape parameters that are tried.
    """

    effect: Effect
    size: Size
    strength: float
    shapes: tuple[Mapping[str, float], ...]


def form_of(joint: DesignJoint, key: str, strength: float | None = None) -> EffectForm:
    """An effect at its typical size, or at a strength, with a few of its shapes."""
    member = effect(key)
    size = size_of(member, joint.numbers, joint.context)
    shapes: tuple[Mapping[str, float], ...] = ({},)
    if not size.in_shape:
        grid = member.shape_grid(joint.context)
        shapes = tuple(grid[:: max(1, -(-len(grid) // MOST_SHAPES))])
    return EffectForm(member, size, size.typical if strength is None else strength, shapes)


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
        apart = 0.0 if self.scale == other.scale else self.scale - other.scale
        return math.exp(apart) if apart < 50.0 else math.inf


class Criterion(ABC):
    """A goal of a design.

    Attributes:
        quantity: That tells how well the goal is reached. better, worse: of a change of it.
    """

    quantity: ClassVar[str]
    better: ClassVar[str] = "smaller"
    worse: ClassVar[str] = "larger"

    @abstractmethod
    def worth(self, fitted: FittedJoint | None) -> Worth:
        """What a log is worth; nothing where it does not identify the joint."""

    @abstractmethod
    def sentences(self, rows: Sequence[Expected], noun: str, gain: float) -> tuple[str, ...]:
        """What an experiment, which a sentence calls `noun`, is worth in words; `gain`: over a growing sinusoid."""


def expected_of(before: Worth | None, default: Worth, designed: Worth) -> tuple[Expected, ...]:
    """What an experiment is worth beside the logs so far, if there are some, and a growing sinusoid."""
    given = [math.nan] * len(designed.values) if before is None else [value for *_, value in before.values]
    return tuple(
        Expected(name, unit, own, other, value)
        for (name, unit, value), (*_, other), own in zip(designed.values, default.values, given, strict=True)
    )


def _odds(fitted: FittedJoint | None, forms: Sequence[EffectForm]) -> EffectOdds | None:
    """Of the forms at the shapes that the goal has, whatever the log."""
    if fitted is None or not forms:
        return None
    return EffectOdds(fitted, [form.effect for form in forms], {form.effect.key: form.shapes for form in forms})


@dataclass(frozen=True, eq=False)
class Parameters(Criterion):
    """D- or E-optimality for the declared parameters and for the sizes of further effects.

    Attributes:
        joint: The joint. forms: Effects that are estimated along.
        smallest: E- instead of D-optimality.
    """

    quantity = "the standard error (geometric mean)"
    joint: DesignJoint
    forms: tuple[EffectForm, ...] = ()
    smallest: bool = False

    @property
    def _declared(self) -> list[tuple[str, str, float, tuple[str, str]]]:
        """(name, unit, typical size, place in a report) of each declared parameter.

        A typical size is a tenth of a fitted drive's torque per effort and of friction.
        """
        n, units = self.joint.numbers, self.joint.context.units
        part = 0.05 * n.torque
        typical = {
            "viscous": 0.1 * max(n.viscous, part / max(n.speed, 1e-9)),
            "coulomb": 0.1 * max(n.coulomb, 0.2 * part),
            "rotor_inertia": 0.1 * max(n.inertia, 1e-9),
        }
        gain = ("1/drive gain", units.of("N*m/effort"), 0.1 / n.gain, ("drive", "gain"))
        own = [
            (p.name, units.of(p.unit), typical.get(term.effect.key, part), (term.effect.key, p.name))
            for term in self.joint.declared
            for p in term.effect.coefficients
        ]
        return own if self.joint.gain_held else [gain, *own]

    def worth(self, fitted: FittedJoint | None) -> Worth:
        """Half intervals of all parameters."""
        rows = [(name, unit, size) for name, unit, size, _ in self._declared]
        rows += [(f"{f.effect.key}: {f.size.name}", f.size.unit, f.strength) for f in self.forms]
        halves, total = [math.inf] * len(rows), -math.inf
        if fitted is not None:
            odds = _odds(fitted, self.forms)
            deviations = [_deviation(odds, form) for form in self.forms if odds]
            halves = [self._half(fitted, place) for *_, place in self._declared]
            halves += [CRITICAL * each for each in deviations]
            total = self._optimality(fitted, np.array(deviations) / [form.strength for form in self.forms])
        values = tuple(
            (f"{name}, half 95 % interval", unit, half) for (name, unit, _), half in zip(rows, halves, strict=True)
        )
        return Worth(values, total, 0.5 * total / (1 if self.smallest else len(rows)))

    @staticmethod
    def _half(fitted: FittedJoint, place: tuple[str, str]) -> float:
        found = fitted.parameters.get(place[0], {}).get(place[1])
        if found is None:
            return math.nan
        half = 0.5 * (found.ci95[1] - found.ci95[0])
        return half / found.value**2 if place == ("drive", "gain") else half

    def _optimality(self, fitted: FittedJoint, effects: FloatArray) -> float:
        """-log det C or -log lambda_max(C); `effects`: their deviations beside the declared parameters, in units.

        With b = [K, K theta] of the posterior, d(1/K) = -dK/K^2 and d theta = db/K - theta dK/K.
        """
        scored = fitted.final[1]
        size = scored.coefficients
        turn = np.eye(size) / scored.b[0]
        turn[:, 0] = -scored.beta / scored.b[0]
        names = [("drive", "gain"), *((t.effect.key, p.name) for t in scored.terms for p in t.effect.coefficients)]
        units = {place: typical for _, _, typical, place in self._declared}
        told = [i for i, name in enumerate(names) if name in units]
        turn = turn[told] / np.array([[units[names[i]]] for i in told])
        declared = turn @ scored.posterior.covariance[:size, :size] @ turn.T
        eigen = np.linalg.eigvalsh(block_diag(declared, *np.minimum(effects, WIDEST) ** 2))
        logs = np.log(np.maximum(eigen, 1e-300))
        return -float(logs.max() if self.smallest else logs.sum())

    def sentences(self, rows: Sequence[Expected], noun: str, gain: float) -> tuple[str, ...]:
        """The ratio of the standard errors, as the criterion has it, and which single intervals are wider."""
        mean = "largest one" if self.smallest else "geometric mean"
        wider = [row.name.partition(",")[0] for row in rows if row.after > 1.1 * row.default]
        alone = f"The growing sinusoid gives a narrower interval of {', '.join(wider)}, taken alone."
        return (
            f"Along the axes of the confidence ellipsoid of all parameters, the standard error ({mean}) after the "
            f"{noun} is {1.0 / gain:.2g} times that after a growing sinusoid of the same length and limits.",
            *([alone] if wider else []),
        )


def _deviation(odds: EffectOdds, form: EffectForm) -> float:
    """Standard deviation of the size of an effect that is estimated along, at the middle one of its shapes."""
    variant = odds.middle(form.effect)
    remainders = odds.beside(form.effect)
    if variant.by_shape:
        near = variant.slopes[variant.nearest(form.strength)]
        information = float(remainders.gram[near, near])
    else:
        inverse = float(np.linalg.pinv(remainders.gram[np.ix_(variant.places, variant.places)])[0, 0])
        information = float(variant.unit[0]) ** 2 / inverse if inverse > 0.0 else 0.0
    return 1.0 / math.sqrt(information) if information > 0.0 else math.inf


@dataclass(frozen=True, eq=False)
class Discrimination(Criterion):
    """T-optimality for two effects, each taken for the truth in turn.

    Attributes:
        orders: (truth, other), in both orders. An order is left out if the other model contains the truth or has more
            parameters: of two models that fit equally well, a diagnosis takes the one with fewer parameters.
        contained: (truth, other, proof) of an order in which the other model contains the truth.
    """

    quantity, better, worse = "the smallest distance", "larger", "smaller"
    orders: tuple[tuple[EffectForm, EffectForm], ...]
    contained: tuple[tuple[str, str, str], ...] = ()

    @property
    def forms(self) -> tuple[EffectForm, ...]:
        """Both effects."""
        return tuple(dict.fromkeys(form for order in self.orders for form in order))

    def worth(self, fitted: FittedJoint | None) -> Worth:
        """Probability that the log distinguishes both, and distances in standard deviations."""
        odds, sure, distances, seen = _odds(fitted, self.forms), [], [], []
        for truth, other in self.orders:
            name = f"error if {truth.effect.key} is fitted by {other.effect.key}, in standard deviations"
            variants = odds.variants[truth.effect.key] if odds else ()
            found = [odds.apart(v, other.effect, truth.strength) for v in variants if odds]
            sure += [(own - ALTERNATIVE) / math.sqrt(d) if d > 0.0 else -math.inf for own, d in found]
            distances.append((name, "-", math.sqrt(min((d for _, d in found), default=0.0))))
        for form in self.forms:
            name = f"error if {form.effect.key} is not modelled, in standard deviations"
            variants = odds.variants[form.effect.key] if odds else ()
            sure += [odds.found_by(v, form.strength) for v in variants if odds]
            whole = min((odds.information(v, form.strength) for v in variants if odds), default=0.0)
            seen.append((name, "-", math.sqrt(whole)))
        total, least = min(sure, default=-math.inf), min(distance for *_, distance in distances)
        probability = ("probability that the runs distinguish them", "-", float(norm.cdf(total)))
        return Worth((probability, *distances, *seen), total, math.log(least) if least > 0.0 else -math.inf)

    def sentences(self, rows: Sequence[Expected], noun: str, gain: float) -> tuple[str, ...]:
        """Both probabilities, and what no motion rules out."""
        sizes = [f"{form.strength:.3g} {pretty_unit(form.size.unit)}".strip() for form in self.orders[0]]
        names = " and ".join(f"{f.effect.key} ({size})" for f, size in zip(self.orders[0], sizes, strict=True))
        text = (
            f"The {noun} distinguishes {names} with a probability of {100.0 * rows[0].after:.0f} %; a growing sinusoid "
            f"of the same length and limits does so with {100.0 * rows[0].default:.0f} %."
        )
        more = [
            f"Where {truth} alone is the cause, no motion rules {other} out, which is the same function while the "
            f"joint slides: {proof}."
            for truth, other, proof in self.contained
        ]
        return (text, *more)


@dataclass(frozen=True, eq=False)
class AllEffects(Criterion):
    """As much as possible of every effect beside the declared model.

    Attributes:
        forms: Effects.
    """

    quantity = "the smallest size that is found (geometric mean)"
    forms: tuple[EffectForm, ...]

    def worth(self, fitted: FittedJoint | None) -> Worth:
        """Size from which on each effect is found."""
        odds = _odds(fitted, self.forms)
        values, gains = [], []
        for form in self.forms:
            size = (odds.smallest(form.effect.key) if odds else 0.0) or math.inf
            word = "largest" if form.size.falling else "smallest"
            values.append((f"{word} {form.effect.key} that is found", form.size.unit, size))
            ratio = size / form.strength if form.size.falling else form.strength / size
            gains.append(-math.log1p(min(max(ratio if math.isfinite(ratio) else 0.0, 1e-6) ** -2, 1e12)))
        total = float(np.mean(gains)) if gains else -math.inf
        return Worth(tuple(values), total, 0.5 * total)

    def sentences(self, rows: Sequence[Expected], noun: str, gain: float) -> tuple[str, ...]:
        """How many effects of typical size are shown, and which ones at no size."""
        pairs = list(zip(self.forms, rows, strict=True))

        def shown(form: EffectForm, size: float) -> bool:
            return math.isfinite(size) and (size >= form.strength if form.size.falling else size <= form.strength)

        after, default = (sum(shown(f, getattr(r, name)) for f, r in pairs) for name in ("after", "default"))
        text = (
            f"Of {len(rows)} effects of typical size, the {noun} shows {after}; a growing sinusoid of the same length "
            f"and limits shows {default}. The smallest sizes that are found are {1.0 / gain:.2g} times as large "
            "(geometric mean, in which sizes far below the typical ones count less)."
        )
        never = [form.effect.key for form, row in pairs if math.isinf(row.after)]
        return (text, *((f"The {noun} shows {', '.join(never)} at no size (∞).",) if never else ()))
