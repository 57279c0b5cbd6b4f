"""Log odds of a set of terms on the training rows, and its posterior."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from drake_tc.diagnosis.data.samples import rms
from drake_tc.diagnosis.linear import Posterior, Prior, Products, log_determinant, posterior
from drake_tc.diagnosis.model import Block, JointModel, RunSpread, Split, drives
from drake_tc.diagnosis.noise import NoiseModel, fitted_noise, independent_share
from drake_tc.diagnosis.priors import ALTERNATIVE, COMMON, DISTORTED, HELD_GAIN, LINEAR, ORDER, RUN_SPREADS, UNCOMMON
from drake_tc.diagnosis.problem.columns import Term, coefficients_by_term
from drake_tc.diagnosis.problem.parameters import shape_places, with_shapes
from drake_tc.effects.library import UNCOMMON as UNCOMMON_EFFECTS
from drake_tc.effects.library import place
from drake_tc.types import FloatArray, IntArray

HEARINGS = 4
"""Rounds of the fixed point of noise and coefficients."""
STEP = 1e-3
"""Relative step of a difference quotient over a shape parameter."""


@dataclass(frozen=True, eq=False)
class Scored:
    """A set of terms with its posterior.

    Attributes:
        terms: Declared ones first.
        log_odds: log Z + log prior odds, comparable under one noise model.
        posterior: Of [K, b ..., shapes ..., ages ..., runs ...].
        coefficients: Number of [K, b ...]; shapes: number of shape parameters that follow.
    """

    terms: tuple[Term, ...]
    log_odds: float
    posterior: Posterior
    coefficients: int
    shapes: int = 0

    @property
    def b(self) -> FloatArray:
        """(1 + k,) [K, K theta ...]."""
        return self.posterior.beta[: self.coefficients]

    @property
    def beta(self) -> FloatArray:
        """(1 + k,) [1/K, theta ...]."""
        return np.concatenate([[1.0], self.b[1:]]) / float(self.b[0])

    @property
    def ids(self) -> frozenset[str]:
        """Keys of the terms."""
        return frozenset(t.effect.key for t in self.terms)


@dataclass(eq=False)
class Evidence:
    """Scores sets of terms of one joint under one noise model.

    Attributes:
        model: The joint.
        noise: Of its residual.
        spread: From run to run.
    """

    model: JointModel
    noise: NoiseModel = field(default_factory=NoiseModel)
    spread: RunSpread = field(default_factory=RunSpread)
    _whitened: dict[tuple[object, ...], FloatArray] = field(default_factory=dict)

    def _white(self, split: Split, key: tuple[object, ...], values: FloatArray) -> FloatArray:
        place = (split is self.model.train, *key)
        if len(self._whitened) > 4000:
            self._whitened.clear()
        if place not in self._whitened:
            self._whitened[place] = split.rows.whitened(values, self.noise)[0]
        return self._whitened[place]

    @cached_property
    def _log_determinant(self) -> float:
        rows = self.model.train.rows
        return rows.whitened(np.zeros((rows.samples.rows.size, 1)), self.noise)[1]

    def design(self, split: Split, terms: Sequence[Term]) -> tuple[FloatArray, Prior]:
        """Whitened columns (n, m) of the drive gain, terms, ages and runs, and their prior."""
        parts, priors = [], []
        keys = [("gain",), *(("term", *t.cache_key) for t in terms if t.effect.coefficients)]
        for key, block in zip(keys, self.model.blocks(split, terms), strict=True):
            parts.append(self._white(split, key, block.values))
            priors.append(block.prior)
        held = self.model.held_ages(terms)
        for number, block in enumerate(self._others(split)):
            parts.append(self._white(split, ("other", number, self.spread), block.values))
            priors.append(block.prior.held_at_zero(HELD_GAIN) if number in held else block.prior)
        return np.concatenate(parts, axis=1), Prior.stacked(priors)

    def _others(self, split: Split) -> list[Block]:
        kept = self._other_blocks.get(split is self.model.train)
        if kept is None:
            kept = [*self.model.nuisances(split), *self.model.of_runs(split, self.spread)]
            self._other_blocks[split is self.model.train] = kept
        return kept

    @cached_property
    def _other_blocks(self) -> dict[bool, list[Block]]:
        return {}

    def target(self, split: Split, terms: Sequence[Term]) -> FloatArray:
        """Whitened target (n,) of a set of terms."""
        key = ("target", *(k for t in drives(terms) for k in t.cache_key))
        return self._white(split, key, split.target(terms)[:, None])[:, 0]

    def drive_offset(self, split: Split, term: Term) -> FloatArray:
        """Whitened (n,) what one drive effect takes off the recorded effort."""
        key = ("offset", *term.cache_key)
        place = (split is self.model.train, *key)
        if place not in self._whitened:
            values = split.target([]) - split.target([term])
            return self._white(split, key, values[:, None])[:, 0]
        return self._whitened[place][:, 0]

    def products(self, split: Split, terms: Sequence[Term]) -> tuple[Products, Prior]:
        """Products of the whitened rows of a set of terms."""
        design, prior = self.design(split, terms)
        return Products.of(design, self.target(split, terms), self.noise.share), prior

    def prior_odds(self, terms: Sequence[Term]) -> float:
        """Log prior odds of a set of terms over the declared one."""
        order = sum(ORDER * place(t.effect.key) for t in terms if not self.model.is_declared(t.effect))
        rare = {e.key for e in UNCOMMON_EFFECTS} | {"delay.position_sensor", "delay.torque_sensor"}
        asked = [t for t in terms if not self.model.is_declared(t.effect)]
        return sum(UNCOMMON if t.effect.key in rare else COMMON for t in asked) - order

    def score(self, terms: Sequence[Term], variance: float | None = None) -> Scored:
        """Log odds with the shapes held; each shape costs what its starting points count."""
        products, prior = self.products(self.model.train, terms)
        found = posterior(products, prior, variance)
        size = 1 + sum(len(t.effect.coefficients) for t in terms)
        return self._scored(terms, found, size, 0)

    def _scored(self, terms: Sequence[Term], found: Posterior, size: int, shapes: int) -> Scored:
        least = self.model.least_gain
        if found.beta[0] < least:  # else physical parameters, which are over K, would be infinite
            found = replace(found, beta=np.concatenate([[least], found.beta[1:]]))
        return Scored(tuple(terms), self.odds(terms, found), found, size, shapes)

    def odds(self, terms: Sequence[Term], found: Posterior) -> float:
        """Log odds of a posterior of the terms: the determinants of whitening and drive, and the prior odds."""
        b = found.beta[1 : 1 + sum(len(t.effect.coefficients) for t in terms)]
        jacobian = self.noise.share * self.model.train.log_jacobian(terms, float(np.sqrt(found.variance)), b)
        return found.log_evidence - 0.5 * self._log_determinant + self.prior_odds(terms) + jacobian

    def tangents(self, split: Split, terms: Sequence[Term], b: FloatArray) -> FloatArray:
        """Whitened (n, s) change of the prediction less the target with each shape parameter."""
        where, values = shape_places(terms)
        out = np.zeros((split.samples.rows.size, len(where)))
        sizes = np.cumsum([1, *(len(t.effect.coefficients) for t in terms)])
        for j, ((i, name), value) in enumerate(zip(where, values, strict=True)):
            term, step = terms[i], STEP * abs(value) + 1e-9
            moved = Term(term.effect, {**term.shape, name: value + step})
            own = b[sizes[i] : sizes[i + 1]]
            change = (split.clean.of(moved) - split.clean.of(term)) @ own if own.size else out[:, j]
            if drives([term]):
                others = [moved if t is term else t for t in terms]
                change = change - (split.target(others) - split.target(terms))
            out[:, j] = change / step
        return split.rows.whitened(out, self.noise)[0] if where else np.zeros((split.rows.index.size, 0))

    def refined(self, scored: Scored, rounds: int = 6) -> Scored:
        """The set at its most probable shapes, by Gauss-Newton steps, with the evidence of the shapes.

        The shapes stand beside the coefficients as columns of their tangents, with a uniform prior over their range.
        """
        terms, where = scored.terms, shape_places(scored.terms)[0]
        current, step = self._with_shapes(scored)
        if not where:
            return current
        held = scored.log_odds
        for _ in range(rounds):
            values = shape_places(current.terms)[1]
            if np.all(np.abs(step) <= 1e-3 * np.abs(values) + 1e-12):
                break
            for share in (1.0, 0.4, 0.1):
                moved = self._bounded(terms, where, values, share * step)
                trial = self.score(with_shapes(terms, where, moved))
                if trial.log_odds > held + 1e-2:
                    (current, step), held = self._with_shapes(trial), trial.log_odds
                    break
            else:
                break
        return current

    def _bounded(
        self, terms: Sequence[Term], where: Sequence[tuple[int, str]], values: FloatArray, step: FloatArray
    ) -> FloatArray:
        out = values + np.clip(step, -0.5 * np.abs(values), np.maximum(np.abs(values), 1e-9))
        for j, (i, name) in enumerate(where):
            p = next(p for p in terms[i].effect.shapes if p.name == name)
            out[j] = np.clip(out[j], p.lower, p.upper)
        return out

    def with_shapes(self, scored: Scored) -> Scored:
        """The same set, the uncertainty of its shapes in its posterior and evidence."""
        return self._with_shapes(scored)[0]

    def _with_shapes(self, scored: Scored) -> tuple[Scored, FloatArray]:
        """The same set and shapes, the shapes' uncertainty in its posterior and evidence, and the Gauss-Newton step."""
        where, _ = shape_places(scored.terms)
        if not where:
            return scored, np.zeros(0)
        design, prior = self.design(self.model.train, scored.terms)
        slopes = self.tangents(self.model.train, scored.terms, scored.b)
        size, k = scored.coefficients, len(where)
        ranges = np.array([self.model.shape_range(scored.terms[i].effect, name) for i, name in where])
        deviation = ranges / np.sqrt(2.0 * np.pi)  # at the middle of a Gaussian, 1/range is the uniform's density
        none = np.zeros(k, dtype=bool)
        shaped = Prior(np.zeros(k), deviation, none)
        parts = [prior.part(s) for s in (slice(None, size), slice(size, None))]
        joined = np.concatenate([design[:, :size], slopes, design[:, size:]], axis=1)
        products = Products.of(joined, self.target(self.model.train, scored.terms), self.noise.share)
        found = posterior(products, Prior.stacked([parts[0], shaped, parts[1]]), scored.posterior.variance)
        held = scored.posterior
        beta = np.concatenate([held.beta[:size], np.zeros(k), held.beta[size:]])
        evidence = held.log_evidence - float(np.sum(np.log(deviation)))
        evidence -= 0.5 * (log_determinant(found.hessian) - log_determinant(held.hessian))
        laplace = Posterior(beta, found.hessian, held.variance, evidence)
        return self._scored(scored.terms, laplace, size, k), found.beta[size : size + k]

    def heard(self, terms: Sequence[Term], *, spread: bool = True) -> "Evidence":
        """The evidence under the noise that these terms leave, and what they show to differ from run to run.

        Noise and coefficients depend on each other. The fixed point is sought from the present noise and from white
        noise, and the more probable one is taken.
        """
        found = [self._heard(Evidence(self.model, start, self.spread), terms) for start in (self.noise, NoiseModel())]
        best = max(found, key=lambda e: e.rank(e.score(terms)))
        return with_run_spread(best, terms) if spread else best

    def rank(self, scored: Scored) -> tuple[bool, float]:
        """Whether the noise of a set leaves its fit undistorted, and its log odds.

        A discrepancy as large as the effort would explain it without any physics, and would be the more probable where
        the load is noisier than the effort.
        """
        return self.distortion(scored) <= DISTORTED, scored.log_odds

    def distortion(self, scored: Scored) -> float:
        """RMS that a set leaves under this noise, over that which it leaves where all rows count alike.

        Both estimates of the coefficients are right if the model is, whatever the noise (Hausman, 1978).
        """
        alike, train = NoiseModel(rest=self.noise.rest), self.model.train
        plain = Evidence(self.model, alike, self.spread)
        errors = (self.residual(train, scored, runs=True), plain.residual(train, plain.score(scored.terms), runs=True))
        own, least = (rms(train.rows.weighed(each, alike)) for each in errors)
        return own / max(least, 1e-300)

    def tempered(self, terms: Sequence[Term], *, rest: bool = True) -> "Evidence":
        """The evidence for models that leave much: white noise, as many independent rows as the residual itself has.

        Under a discrepancy that holds whole effects, a fit would not see what is as slow as it. `rest`: whether rows
        near rest may have noise of their own.
        """
        rows, white = self.model.train.rows, Evidence(self.model, NoiseModel(), self.spread)
        if rest:
            white = self._heard(white, terms, slow=False)
        residual, alike = white.residual(self.model.train, white.score(terms), runs=True), white.noise
        share = independent_share(rows, rows.weighed(residual, alike))
        return with_run_spread(Evidence(self.model, replace(alike, share=share), self.spread), terms)

    @staticmethod
    def _heard(found: "Evidence", terms: Sequence[Term], *, slow: bool = True) -> "Evidence":
        for _ in range(HEARINGS):
            residual = found.residual(found.model.train, found.score(terms), runs=True)
            noise = fitted_noise(found.model.train.rows, residual, slow=slow)
            if noise == found.noise:
                break
            found = Evidence(found.model, noise, found.spread)
        return found

    def ages(self, scored: Scored) -> dict[str, float]:
        """Ages of the channels [s] of a set."""
        at = scored.coefficients + scored.shapes
        out = {channel: float(scored.posterior.beta[at + i]) for i, channel in enumerate(self.model.ages)}
        for term, theta in coefficients_by_term(scored.terms, scored.beta):
            for channel, share in term.effect.ages_of.items() if theta.size else ():
                out[channel] += share * float(theta[0])
        return out

    def relinearised(self, scored: Scored) -> JointModel:
        """The joint linearised at a set: at the effort that it needs, and at the ages that are not linear.

        What an age does is linear where its curvature is far below the noise. To first order the ages of command and
        inside and the viscous friction are often one sum; at needless ages, curvature would tell them apart.
        """
        gain, train = float(scored.b[0]), self.model.train
        noise = rms(self.residual(train, scored, runs=True))
        bent = {
            channel: age
            for channel, age in self.ages(scored).items()
            if channel in train.channels and train.curvature(channel, age) > LINEAR * noise
        }
        return self.model.relinearised(scored.terms, scored.b[1:] / gain, gain, bent)

    def residual(self, split: Split, scored: Scored, *, runs: bool = False) -> FloatArray:
        """(N,) recorded effort less the prediction on all rows [effort]; `runs`: with what differs from run to run."""
        blocks = self.model.blocks(split, scored.terms)
        out = split.target(scored.terms) - np.concatenate([b.values for b in blocks], axis=1) @ scored.b
        at = scored.coefficients + scored.shapes
        others = self._others(split) if runs else self.model.nuisances(split)
        for block in others:
            out = out - block.values @ scored.posterior.beta[at : at + block.values.shape[1]]
            at += block.values.shape[1]
        return np.asarray(out)

    def predictive(self, terms: Sequence[Term], variance: float) -> float:
        """Log p(held-out rows | training rows, terms) under this noise; what differs between runs is each run's own."""
        train, prior = self.products(self.model.train, terms)
        held, _ = self.products(self.model.held, terms)
        own = [sum(b.values.shape[1] for b in self.model.of_runs(s, self.spread)) for s in self._splits]
        shared, size = train.moment.size - own[0], train.moment.size + own[1]
        first, second = np.arange(train.moment.size), np.r_[np.arange(shared), size - own[1] + np.arange(own[1])]
        more = self.design(self.model.held, terms)[1]
        joined = Prior.stacked([prior, more.part(slice(more.mean.size - own[1], None))])
        before, after = placed(train, first, size), placed(held, second, size)
        both = posterior(before + after, joined, variance)
        b = both.beta[1 : 1 + sum(len(t.effect.coefficients) for t in terms)]
        jacobian = self.noise.share * self.model.held.log_jacobian(terms, float(np.sqrt(variance)), b)
        return both.log_evidence - posterior(before, joined, variance).log_evidence + jacobian

    @property
    def _splits(self) -> tuple[Split, Split]:
        return self.model.train, self.model.held


def placed(products: Products, places: IntArray, size: int) -> Products:
    """Products whose columns stand at these places among `size`."""
    gram, moment = np.zeros((size, size)), np.zeros(size)
    gram[np.ix_(places, places)], moment[places] = products.gram, products.moment
    return replace(products, gram=gram, moment=moment)


def with_run_spread(evidence: Evidence, terms: Sequence[Term]) -> Evidence:
    """The evidence with the least that differs from run to run of what the logs cannot tell from the most probable."""
    if len(evidence.model.train.samples.runs) < 2:
        return evidence
    model = replace(evidence.model, common_zero=True)  # what all runs share is no spread
    first = Evidence(model, evidence.noise)
    best = RunSpread()
    for name in ("zero", "friction"):
        tried = [replace(best, **{name: size}) for size in RUN_SPREADS]
        odds = [replace(first, spread=spread).score(terms).log_odds for spread in tried]
        best = next(spread for spread, own in zip(tried, odds, strict=True) if own >= max(odds) - ALTERNATIVE)
    return Evidence(evidence.model, evidence.noise, best)
