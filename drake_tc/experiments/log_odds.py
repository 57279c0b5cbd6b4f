"""Expected log odds of effects from the Fisher information of a joint's rows: from which size an effect is found.

An effect of size s changes the effort by s c. With the whitened rows, the columns X of all that the model without it
has (its terms, ages, tolerances and runs), and their posterior's Hessian H,

    F = c'c/v - (c'X/v) H^-1 (X'c/v)                                              (Fisher information about the size)

v: variance of the noise. The log odds of an effect with k coefficients and shapes, beside those of the model without
it, are half a noncentral chi-squared variable with k degrees of freedom and noncentrality s^2 F, less

    O = 1/2 log|1 + D A D| + sum_j 1/2 log(1 + d_j^2 s^2 S_j) - p log 2 - log prior odds                 (Occam's term)

A: information about the coefficients, D: their prior deviations, S_j and d_j: those of a shape at size 1, p: number of
coefficients of one sign. A diagnosis names the effect if the log odds exceed `ALTERNATIVE` and if it contributes half a
noise floor. The square root of the variable is nearly normal with variance 1 around sqrt(s^2 F + k - 1) (Fisher, 1925).
"""

import math
from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from drake_tc.diagnosis.data.samples import rms
from drake_tc.diagnosis.evidence import Evidence
from drake_tc.diagnosis.linear import Posterior, Products, mode
from drake_tc.diagnosis.noise import NoiseModel
from drake_tc.diagnosis.priors import ALTERNATIVE, NAMED_FLOORS
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.effects.base import Effect
from drake_tc.experiments.effect_columns import EffectColumns, Shapes, Variant
from drake_tc.experiments.fitted import FittedJoint
from drake_tc.experiments.sizes import size_of
from drake_tc.types import FloatArray, IntArray

SHAPES_SEEN = 0.8
"""Share of the shapes of an effect at which the size that counts as found must suffice."""
NUMERICAL = 1e-7
"""Share of a contribution (RMS) that must be left: less of it is the rounding error of an exact identity."""
IMITATED = 0.25
"""Share of a contribution (RMS) up to which the rest of the model imitates it."""
CERTAIN = 1.6448536269514722
"""95 % quantile of the standard normal distribution."""
ROUNDS = 3
"""Of the fixed point of a size and Occam's term, which grows with its logarithm."""


class Remainders:
    """Products of all columns without what a model explains.

    Attributes:
        gram: (P, P) F of each pair of columns. whole: (P,) their squares over the variance of the noise.
        imitated: (m, P) coefficients by which the model imitates each column.
    """

    def __init__(self, evidence: Evidence, columns: FloatArray, terms: Sequence[Term], variance: float) -> None:
        """Of columns (n, P), whitened as the evidence does, beside the terms of a model."""
        design, prior = evidence.design(evidence.model.train, terms)
        weight = evidence.noise.share / variance
        hessian = weight * design.T @ design + np.diag(1.0 / prior.deviation**2)
        inverse = Posterior(np.zeros(len(hessian)), hessian, variance, 0.0).covariance
        crossed = weight * design.T @ columns
        self.imitated = inverse @ crossed
        gram = weight * columns.T @ columns
        self.whole = np.diag(gram).copy()
        self.gram = gram - crossed.T @ self.imitated
        self._columns, self._design = columns, design

    @cached_property
    def left(self) -> FloatArray:
        """(n, P) what the model does not imitate of the columns."""
        return np.asarray(self._columns - self._design @ self.imitated)

    def information(self, places: IntArray, weights: FloatArray) -> float:
        """F of a sum of columns with weights (m,); 0 where rounding is all that is left."""
        found = float(weights @ self.gram[places[:, None], places] @ weights)
        whole = float(np.sum(np.abs(weights) * np.sqrt(self.whole[places]))) ** 2
        return found if found > NUMERICAL**2 * whole else 0.0


class EffectOdds:
    """Expected log odds of effects in the rows of a joint."""

    def __init__(self, fitted: FittedJoint, effects: Sequence[Effect], shapes: Shapes | None = None) -> None:
        """Of these effects beside the most probable set of the joint; at given shapes, or at those of a search."""
        self.fitted, self.model, train = fitted, fitted.evidence.model, fitted.evidence.model.train
        self.sizes = {e.key: size_of(e, fitted.numbers, fitted.context, train.samples.units) for e in effects}
        made = EffectColumns(fitted, shapes or {})
        self.variants: Mapping[str, list[Variant]] = {e.key: made.variants(e, self.sizes[e.key]) for e in effects}
        self._columns = made.all()
        self._variance = fitted.best.posterior.variance
        self._found = frozenset(t.effect.id for t in fitted.found)
        self._known: dict[tuple[frozenset[str], bool], Remainders] = {}
        self._out: dict[str, frozenset[str]] = {}
        self._occam: dict[int, tuple[float, list[float]]] = {}

    def beside(self, effect: Effect) -> Remainders:
        """Remainders beside what is set beside this effect."""
        return self._without(self.out(effect), plain=False)

    def out(self, effect: Effect) -> frozenset[str]:
        """Ids of found effects that are compared with an effect, not set beside it: itself, and what imitates it."""
        if effect.id not in self._out:
            own, rest = frozenset({effect.id}) & self._found, self._found - {effect.id}
            imitated = rest and self.kept(effect, own) < IMITATED
            out = [found for found in rest if imitated and self.kept(effect, own | {found}) >= IMITATED]
            self._out[effect.id] = own.union(out)
        return self._out[effect.id]

    def _without(self, out: frozenset[str], *, plain: bool) -> Remainders:
        """Remainders beside the set without effects that were found; `plain`: of the rows as they are, not whitened."""
        if (out, plain) not in self._known:
            terms = self._terms(out)
            evidence, rows = self.fitted.evidence, self.model.train.rows
            if plain:
                evidence = Evidence(self.model, NoiseModel(), evidence.spread)
            white = rows.whitened(self._columns, evidence.noise)[0]
            self._known[out, plain] = Remainders(evidence, white, terms, self._variance)
        return self._known[out, plain]

    def _terms(self, out: frozenset[str]) -> list[Term]:
        """The most probable set without effects that were found."""
        return [t for t in self.fitted.best.terms if self.model.is_declared(t.effect) or t.effect.id not in out]

    def kept(self, effect: Effect, out: frozenset[str] | None = None) -> float:
        """Share of the contribution of an effect (RMS) that what is set beside it does not imitate; `out` as `left`."""
        variant = self.middle(effect)
        strongest = float(variant.sizes[-1]) if variant.by_shape else 1.0
        return self.left(variant, strongest, out) / max(self._whole(variant, strongest), 1e-300)

    def occam(self, variant: Variant, size: float) -> float:
        """O of a variant at a size."""
        own, shapes = self._parts(variant)
        if variant.by_shape:
            return own + 0.5 * math.log1p(shapes[variant.nearest(size)])
        return own + 0.5 * sum(math.log1p(size**2 * each) for each in shapes)

    def _parts(self, variant: Variant) -> tuple[float, list[float]]:
        """O of the coefficients, and information about each shape at size 1 or at each size, over that of its prior."""
        key = id(variant)
        if key not in self._occam:
            left = self.beside(variant.term.effect).gram
            d = variant.prior.prior.deviation
            scaled = left[np.ix_(variant.places, variant.places)] * np.outer(d, d)
            sign = math.log(2.0) * np.count_nonzero(variant.prior.prior.positive)
            prior = self.fitted.evidence.prior_odds([variant.term])
            own = 0.5 * float(np.linalg.slogdet(np.eye(d.size) + scaled)[1]) - sign - prior
            self._occam[key] = own, (variant.widths**2 * left[variant.slopes, variant.slopes]).tolist()
        return self._occam[key]

    def found_from(self, key: str) -> tuple[float, float]:
        """(size that is found in 95 % of such logs at most shapes, size that is found in 5 % at the best shape).

        For a falling size (a limit) the largest sizes are told. Infinite, or 0 for a falling size, where none is found.
        """
        least = [self._from(v, -CERTAIN) for v in self.variants[key]]
        return self.smallest(key), max(least) if self.sizes[key].falling else min(least)

    def smallest(self, key: str) -> float:
        """The first of these."""
        most = sorted((self._from(v, CERTAIN) for v in self.variants[key]), reverse=self.sizes[key].falling)
        return most[min(math.ceil(SHAPES_SEEN * len(most)), len(most)) - 1]

    def _from(self, variant: Variant, sure: float) -> float:
        """Size from which on a variant is found, with noise for or against it by so many standard deviations."""
        if variant.by_shape:
            return self._from_shape(variant, sure)
        information = self.information(variant, 1.0)
        if not information > 0.0:
            return math.inf
        size = 0.0
        for _ in range(ROUNDS):
            size = math.sqrt(self._needed(variant, size, sure) / information)
        left = self.left(variant, 1.0)
        return max(size, self._least / left + sure / math.sqrt(information)) if left > 0.0 else math.inf

    def _from_shape(self, variant: Variant, sure: float) -> float:
        """The same of a size that is a shape, between two of its grid."""
        margin = []
        for size in variant.sizes.tolist():
            information = self.information(variant, size)
            odds = math.sqrt(max(information, 1e-300) / max(self._needed(variant, size, sure), 1e-12))
            apart = max(1.0 - sure / math.sqrt(max(information, 1e-300)), 1e-9)
            margin.append(min(odds, apart * self.left(variant, size) / self._least))
        return crossing(variant.sizes, np.array(margin))

    def _needed(self, variant: Variant, size: float, sure: float) -> float:
        """Noncentrality that is found so surely."""
        asked = math.sqrt(max(2.0 * (ALTERNATIVE + self.occam(variant, size)), 0.0))
        return max(max(asked + sure, 0.0) ** 2 - (variant.freedom - 1), 1e-6)

    @property
    def _least(self) -> float:
        """RMS contribution below which nothing is named [effort]."""
        return NAMED_FLOORS * self.fitted.floor

    def left(self, variant: Variant, size: float, out: frozenset[str] | None = None) -> float:
        """RMS of what the set without the effect does not take over of its contribution [effort].

        Args:
            variant: The effect.
            size: Of it.
            out: Effects that were found and are left out of the set; None takes those of `out`.
        """
        places, weights = variant.at(size)
        remainders = self._without(self.out(variant.term.effect) if out is None else out, plain=True)
        left = rms(remainders.left[:, places] @ weights)
        return left if left > NUMERICAL * self._whole(variant, size) else 0.0

    def _whole(self, variant: Variant, size: float) -> float:
        """RMS of the contribution itself [effort]."""
        places, weights = variant.at(size)
        return rms(self._columns[:, places] @ weights)

    def imitators(self, variant: Variant, size: float) -> list[str]:
        """Names of what in the model imitates the contribution most, the most important first."""
        places, weights = variant.at(size)
        imitated = self._without(self.out(variant.term.effect), plain=True).imitated[:, places] @ weights
        names, scales = self._named(variant.term.effect)
        sizes = np.abs(imitated[: len(names)]) * scales
        order = [int(i) for i in np.argsort(-sizes) if sizes[i] > 0.2 * max(float(sizes.max()), 1e-300)]
        return list(dict.fromkeys(names[i] for i in order))[:2]

    def _named(self, effect: Effect) -> tuple[list[str], FloatArray]:
        """Names and RMS of the columns of the set without an effect, nuisances after its terms."""
        model, evidence = self.model, self.fitted.evidence
        terms = self._terms(self.out(effect))
        names = ["the drive gain", *(t.effect.title for t in terms for _ in t.effect.coefficients)]
        names += [f"a delay of the {AGES[channel]}" for channel in model.ages]
        design, _ = Evidence(model, NoiseModel(), evidence.spread).design(model.train, terms)
        return names, np.sqrt(np.mean(design[:, : len(names)] ** 2, axis=0))

    def information(self, variant: Variant, size: float) -> float:
        """s^2 F of a variant at a size: the squared distance from the best fit of the set without it."""
        return self.beside(variant.term.effect).information(*variant.at(size))

    def found_by(self, variant: Variant, size: float) -> float:
        """Standard deviations by which a diagnosis names a variant of this size in a typical log."""
        asked = math.sqrt(max(2.0 * (ALTERNATIVE + self.occam(variant, size)), 0.0))
        return math.sqrt(self.information(variant, size) + variant.freedom - 1.0) - asked

    def apart(self, truth: Variant, other: Effect, size: float) -> tuple[float, float]:
        """(log odds by which an effect of this size is more probable than the best fit of another, squared distance).

        The log odds are half the squared distance of the two in units of the noise, less the difference of Occam's
        terms. In one log they vary with the distance as their standard deviation. A diagnosis lists the other effect
        beside this one where they are less than `ALTERNATIVE`.
        """
        remainders = self.beside(truth.term.effect)
        places, weights = truth.at(size)
        information = remainders.information(places, weights)
        gain, explained = max(self._explained(each, remainders, places, weights) for each in self.variants[other.key])
        own = 0.5 * information - self.occam(truth, size)
        return own - gain, max(information - 2.0 * explained, 0.0)

    def _explained(
        self, other: Variant, remainders: Remainders, places: IntArray, weights: FloatArray
    ) -> tuple[float, float]:
        """(log odds that another effect gets from a contribution, the log likelihood in them)."""
        if other.by_shape:
            # between two sizes, and below the weakest one, the change is on the straight line between the two
            along = np.concatenate([[0.0], remainders.gram[np.ix_(other.changes, places)] @ weights])
            gram = np.pad(remainders.gram[np.ix_(other.changes, other.changes)], (1, 0))
            own, inner = np.diag(gram)[:-1], np.diag(gram, 1) - np.diag(gram)[:-1]
            rise, square = np.diff(along), np.diff(np.diag(gram)) - 2.0 * inner
            share = np.clip((rise - inner) / np.maximum(square, 1e-300), 0.0, 1.0)
            each = along[:-1] + share * rise - 0.5 * (own + 2.0 * share * inner + share**2 * square)
            best = int(np.argmax(each))
            near = max(best - int(share[best] < 0.5), 0)
            return float(each[best]) - self.occam(other, float(other.sizes[near])), float(each[best])
        prior = other.prior.prior
        along = remainders.gram[np.ix_(other.places, places)] @ weights
        gram = remainders.gram[np.ix_(other.places, other.places)]
        hessian, beta = gram + np.diag(1.0 / prior.deviation**2), mode(Products(gram, along, 0.0, 0.0), prior, 1.0)
        size = float(np.max(np.abs(beta)) / max(float(np.max(np.abs(other.unit))), 1e-300))
        gain = float(beta @ along - 0.5 * beta @ hessian @ beta)
        return gain - self.occam(other, size), gain

    def confused_with(self, effect: Effect, size: float) -> tuple[str, ...]:
        """Ids of effects that explain this one at a size nearly as well, so that a diagnosis lists them beside it.

        The effect has the middle one of its shapes, and one of the directions that its coefficients may have.
        """
        truths = [v for v in self.variants[effect.key] if v.term is self.middle(effect).term]
        others = [each[0].term.effect for each in self.variants.values()]
        found = [
            other.id
            for other in others
            if other.id != effect.id and any(self.apart(v, other, size)[0] <= ALTERNATIVE for v in truths)
        ]
        return tuple(dict.fromkeys(found))

    def middle(self, effect: Effect) -> Variant:
        """The variant at the middle one of its shapes."""
        each = self.variants[effect.key]
        return each[len(each) // 2]


AGES = {
    "command": "command",
    "inside": "effort in the servo",
    "rate": "rate in the servo",
    "effort": "effort",
    "torque": "torque",
    "position": "position",
}
"""Channels in words."""


def crossing(sizes: FloatArray, margin: FloatArray) -> float:
    """Weakest size of a grid from which on a margin reaches 1, between two sizes in proportion."""
    falling, reached = sizes[0] > sizes[-1], np.maximum.accumulate(np.maximum(margin, 1e-12))
    if reached[-1] < 1.0:
        return 0.0 if falling else math.inf
    if reached[0] >= 1.0:
        return float(sizes[0] if falling else sizes[0] / margin[0])
    return float(np.exp(np.interp(0.0, np.log(reached), np.log(sizes))))
