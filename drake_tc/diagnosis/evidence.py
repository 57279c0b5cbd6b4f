"""Log odds of a set of terms on the training rows, and its posterior."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from drake_tc.diagnosis.data.samples import rms
from drake_tc.diagnosis.linear import Posterior, Prior, Products, log_determinant, mode, posterior
from drake_tc.diagnosis.model import Block, JointModel, RunSpread
from drake_tc.diagnosis.noise import NoiseModel, fitted_noise, independent_share
from drake_tc.diagnosis.priors import (
    ALTERNATIVE,
    COMMON,
    DISTORTED,
    HELD_GAIN,
    LINEAR,
    NOISE_LEVEL,
    ORDER,
    RUN_SPREADS,
    UNCOMMON,
)
from drake_tc.diagnosis.problem.columns import Term, coefficients_by_term, drives
from drake_tc.diagnosis.problem.parameters import shape_places, with_shapes
from drake_tc.diagnosis.split import Split, starts_unknown
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
        passed: Sensors' noise that it lets through over what it leaves, mean squares; above 1 if it is overestimated.
        left: Variance of what it leaves at the coefficients that noise does not bias, over `Evidence.by_load` and the
            share that its filters pass.
    """

    terms: tuple[Term, ...]
    log_odds: float
    posterior: Posterior
    coefficients: int
    shapes: int = 0
    passed: float = 0.0
    left: float = 0.0

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

    def _white(self, split: Split, key: tuple[object, ...], values: Callable[[], FloatArray]) -> FloatArray:
        """(n, k) whitened rows of what `values` computes, (N, k), each key once."""
        place = (split is self.model.train, *key)
        if len(self._whitened) > 4000:
            self._whitened.clear()
        if place not in self._whitened:
            self._whitened[place] = split.rows.whitened(values(), self.noise)[0]
        return self._whitened[place]

    def term_columns(self, split: Split, term: Term) -> FloatArray:
        """Whitened columns (n, k) of a term."""
        return self._white(split, ("term", *term.cache_key), lambda: self.model.block(split, term).values)

    @cached_property
    def _log_determinant(self) -> float:
        rows = self.model.train.rows
        return rows.whitened(np.zeros((rows.samples.rows.size, 1)), self.noise)[1]

    def noise_gain(self, scored: Scored, noise: NoiseModel) -> float:
        """Mean square of the sensors' noise in what a set leaves, whitened as here, over that whitened for `noise`."""
        if noise == self.noise:
            return 1.0
        size, shapes = scored.coefficients, scored.shapes
        b = np.concatenate([scored.b, scored.posterior.beta[size + shapes :]])
        own, other = (each._noise_left(scored.terms, b) for each in (self, Evidence(self.model, noise, self.spread)))
        return own / other if other > 0.0 else 1.0

    def _noise_left(self, terms: Sequence[Term], b: FloatArray) -> float:
        """Mean square of the sensors' whitened noise in what a set leaves at coefficients b (m,)."""
        gram, moment, square = self.noise_products(terms)
        rows = self.noise.share * self.model.train.rows.index.size
        return max(float(b @ gram @ b - 2.0 * b @ moment + square), 0.0) / rows

    def design(self, split: Split, terms: Sequence[Term], spread: RunSpread | None = None) -> tuple[FloatArray, Prior]:
        """Whitened columns (n, m) of the drive gain, terms, ages and runs, and their prior; `spread` of the runs."""
        spread = spread or self.spread.of(terms)
        parts, priors = [], []
        keys = [("gain",), *(("term", *t.cache_key) for t in terms if t.effect.coefficients)]
        for key, block in zip(keys, self.model.blocks(split, terms), strict=True):
            parts.append(self._white(split, key, partial(np.asarray, block.values)))
            priors.append(block.prior)
        held = self.model.held_ages(terms)
        for number, block in enumerate(self._others(split, spread)):
            parts.append(self._white(split, ("other", number, spread), partial(np.asarray, block.values)))
            priors.append(block.prior.held_at_zero(HELD_GAIN) if number in held else block.prior)
        return np.concatenate(parts, axis=1), Prior.stacked(priors)

    def _others(self, split: Split, spread: RunSpread) -> list[Block]:
        key = split is self.model.train, spread
        if key not in self._other_blocks:
            self._other_blocks[key] = [*self.model.nuisances(split), *self.model.of_runs(split, spread)]
        return self._other_blocks[key]

    @cached_property
    def _other_blocks(self) -> dict[tuple[bool, RunSpread], list[Block]]:
        return {}

    def target(self, split: Split, terms: Sequence[Term]) -> FloatArray:
        """Whitened target (n,) of a set of terms."""
        key = ("target", *(k for t in drives(terms) for k in t.cache_key))
        return self._white(split, key, lambda: split.target(terms)[:, None])[:, 0]

    def drive_offset(self, split: Split, term: Term) -> FloatArray:
        """Whitened (n,) what one drive effect takes off the recorded effort."""
        values = self._white(
            split, ("offset", *term.cache_key), lambda: (split.target([]) - split.target([term]))[:, None]
        )
        return values[:, 0]

    def products(self, split: Split, terms: Sequence[Term], spread: RunSpread | None = None) -> tuple[Products, Prior]:
        """Products of the whitened rows of a set of terms."""
        design, prior = self.design(split, terms, spread)
        return Products.of(design, self.target(split, terms), self.noise.share), prior

    def prior_odds(self, terms: Sequence[Term]) -> float:
        """Log prior odds of a set of terms over the declared one."""
        order = sum(ORDER * place(t.effect.key) for t in terms if not self.model.is_declared(t.effect))
        rare = {e.key for e in UNCOMMON_EFFECTS} | {"delay.position_sensor", "delay.torque_sensor"}
        asked = [t for t in terms if not self.model.is_declared(t.effect)]
        return sum(UNCOMMON if t.effect.key in rare else COMMON for t in asked) - order

    def score(self, terms: Sequence[Term], variance: float | None = None, spread: RunSpread | None = None) -> Scored:
        """Log odds with the shapes held; each shape costs what its starting points count."""
        products, prior = self.products(self.model.train, terms, spread)
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
        jacobian = self.log_jacobian(self.model.train, terms, found)
        return found.log_evidence - 0.5 * self._log_determinant + self.prior_odds(terms) + jacobian

    def log_jacobian(self, split: Split, terms: Sequence[Term], found: Posterior) -> float:
        """Of the recorded effort and load over what a set leaves of them: that of the drive effects, and n l log K.

        With the share l of the sensors' noise that is of a measured load, and grows with K, the density of both is

            log p(u, tau) = log p(u | tau) + n l log K + const

        whatever the spectrum of the effort without noise. That of the effort alone is the larger the less of the load
        it needs; for an exact effort, l = 1, the sum is that of the load.
        """
        of_drives = split.log_jacobian(terms, float(np.sqrt(found.variance)))
        of_load = 0.5 * split.rows.index.size * float(np.log(self.by_load(float(found.beta[0]))))
        return self.noise.share * (of_drives + of_load)

    def by_load(self, gain: float) -> float:
        """(K/K_0)^(2 l): by how much a measured load's noise grows with K, `gain`."""
        return float((max(gain, self.model.least_gain) / self.model.gain) ** (2.0 * self.model.of_load))

    def tangents(self, split: Split, terms: Sequence[Term], b: FloatArray) -> FloatArray:
        """Whitened (n, s) change of the prediction less the target with each shape parameter."""
        return split.rows.whitened(shape_slopes(split, terms, b), self.noise)[0]

    def refined(self, scored: Scored, rounds: int = 6) -> Scored:
        """The set at its most probable shapes, by Gauss-Newton steps, with the evidence of the shapes.

        The shapes stand beside the coefficients as columns of their tangents, with a uniform prior over their range.
        """
        terms, where = scored.terms, shape_places(scored.terms)[0]
        current, step = self._with_shapes(scored)
        if not where:
            return self.with_unbiased_odds(current)
        held = scored.log_odds
        for _ in range(rounds):
            values = shape_places(current.terms)[1]
            if np.all(np.abs(step) <= 1e-3 * np.abs(values) + 1e-12):
                break
            for share in (1.0, 0.4, 0.1):
                moved = self.bounded(terms, where, values, share * step)
                trial = self.score(with_shapes(terms, where, moved))
                if trial.log_odds > held + 1e-2:
                    (current, step), held = self._with_shapes(trial), trial.log_odds
                    break
            else:
                break
        return self.with_unbiased_odds(current)

    def with_unbiased_odds(self, scored: Scored) -> Scored:
        """The set with the odds that it has at the coefficients that noise in its columns does not bias.

        Less of a noisy column leaves less noise, and another column that has none then takes its place: half the drive
        gain beside a payload. The rows do not tell these apart (`Products.without_noise`).
        """
        products, prior = self.products(self.model.train, scored.terms)
        gram, moment, square = self.noise_products(scored.terms)
        taken, variance = products.without_noise(gram, moment), scored.posterior.variance
        true = mode(taken, prior, variance)
        if products.rss(true) <= 0.0:  # a dead zone or a limit that leaves nothing of the effort
            return replace(scored, log_odds=-np.inf)
        if true[0] <= self.model.least_gain:  # noise is all of the load
            true = np.concatenate([scored.b, scored.posterior.beta[scored.coefficients + scored.shapes :]])
        left = products.rss(true)
        passed = float(true @ gram @ true - 2.0 * true @ moment + square) / left
        whole = posterior(taken.leaving(left, true), prior)
        shapes = scored.log_odds - self.score(scored.terms).log_odds if scored.shapes else 0.0
        own = whole.variance / self.by_load(float(true[0])) / np.exp(self.model.train.log_passed(scored.terms))
        return replace(scored, passed=passed, left=own, log_odds=self.odds(scored.terms, whole) + shapes)

    def corrected(self, scored: Scored) -> Scored:
        """The set with coefficients that noise does not attenuate; how well the noise is known widens their covariance.

        Shapes stay, and so does what differs from run to run: residuals are told without it. The set itself where noise
        is all of the load, so that nothing would be left of the drive gain.
        """
        train, held = self.model.train, scored.posterior
        products, prior = self.products(train, scored.terms)
        gram, moment, _ = self.noise_products(scored.terms)
        size, shapes = scored.coefficients, scored.shapes
        places = np.r_[:size, size + shapes : held.beta.size]
        b = held.beta[places]
        of_runs = sum(block.values.shape[1] for block in self.model.of_runs(train, self.spread.of(scored.terms)))
        moved, kept = np.arange(b.size - of_runs), np.arange(b.size - of_runs, b.size)
        own = products.at(moved)
        own = replace(own, moment=own.moment - products.gram[np.ix_(moved, kept)] @ b[kept])
        true = own.without_noise(gram[np.ix_(moved, moved)], moment[moved])
        after = b.copy()
        after[moved] = mode(true, prior.part(moved), held.variance)
        if after[0] <= self.model.least_gain:
            return scored
        louder = products.rss(after) / products.rss(b)
        shift = np.zeros(held.beta.size)
        shift[places] = after - b
        hessian, at = held.hessian.copy(), np.arange(held.beta.size - of_runs)
        before, told = self._with_shape_columns(scored, at, places[moved], gram) if shapes else (own, true)
        hessian[np.ix_(at, at)] += (told.gram - before.gram) / held.variance
        covariance = louder * Posterior(held.beta, hessian, held.variance, 0.0).covariance
        covariance += NOISE_LEVEL**2 * np.outer(shift, shift)
        return replace(scored, posterior=replace(held, beta=held.beta + shift).with_covariance(covariance))

    def _with_shape_columns(
        self, scored: Scored, at: IntArray, noisy: IntArray, gram: FloatArray
    ) -> tuple[Products, Products]:
        """Products of columns `at` of a set and its shapes, and without the noise `gram` (k, k) of those at `noisy`."""
        columns = self.columns_with_shapes(scored)[:, at]
        products = Products.of(columns, self.target(self.model.train, scored.terms), self.noise.share)
        whole = np.zeros((at.size, at.size))
        whole[np.ix_(noisy, noisy)] = gram[: noisy.size, : noisy.size]
        return products, products.without_noise(whole, np.zeros(at.size))

    def noise_products(self, terms: Sequence[Term]) -> tuple[FloatArray, FloatArray, float]:
        """E[dX'dX] (m, m), E[dX'du] (m,), E[du'du]: whitened noise dX of the columns of `design`, du of the target."""
        train, acting = self.model.train, drives(terms)
        parts: list[Term | str] = ["gain", *(t for t in terms if t.effect.coefficients), "ages"]
        size = self.design(train, terms)[0].shape[1]
        gram, moment, square = np.zeros((size, size)), np.zeros(size), 0.0
        for number, noisy in enumerate(train.noisy):
            columns = np.concatenate([self._noise_of(number, part) for part in parts], axis=1)
            key = ("noise", number, "target", *(k for t in acting for k in t.cache_key))
            change = self._white(train, key, partial(_change, noisy, train, terms))
            k = columns.shape[1]
            gram[:k, :k] += self.noise.share * columns.T @ columns
            moment[:k] += self.noise.share * columns.T @ change[:, 0]
            square += self.noise.share * float(change[:, 0] @ change[:, 0])
        return gram, moment, square

    def _noise_of(self, number: int, part: Term | str) -> FloatArray:
        """(n, k) whitened noise of a channel in the columns of a term, of the drive gain, or of the ages."""
        train = self.model.train
        noisy = train.noisy[number]

        def values() -> FloatArray:
            if isinstance(part, Term):
                return noisy.of(part) - train.of(part)
            if part == "gain":
                return (noisy.recorded.target - train.recorded.target)[:, None]
            return self.model.noise_of_ages(number)

        key = part.cache_key if isinstance(part, Term) else (part,)
        return self._white(train, ("noise", number, *key), values)

    def bounded(
        self, terms: Sequence[Term], where: Sequence[tuple[int, str]], values: FloatArray, step: FloatArray
    ) -> FloatArray:
        """Shapes (s,) at these places after a step (s,), within their bounds and at most by their own size."""
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
        prior = self.design(self.model.train, scored.terms)[1]
        size, k, shaped = scored.coefficients, len(where), self.model.shape_prior(scored.terms)
        parts = [prior.part(s) for s in (slice(None, size), slice(size, None))]
        joined = self.columns_with_shapes(scored)
        products = Products.of(joined, self.target(self.model.train, scored.terms), self.noise.share)
        found = posterior(products, Prior.stacked([parts[0], shaped, parts[1]]), scored.posterior.variance)
        held = scored.posterior
        beta = np.concatenate([held.beta[:size], np.zeros(k), held.beta[size:]])
        evidence = held.log_evidence - float(np.sum(np.log(shaped.deviation)))
        evidence -= 0.5 * (log_determinant(found.hessian) - log_determinant(held.hessian))
        laplace = Posterior(beta, found.hessian, held.variance, evidence)
        return self._scored(scored.terms, laplace, size, k), found.beta[size : size + k]

    def columns_with_shapes(self, scored: Scored) -> FloatArray:
        """Whitened training columns (n, k): of [K, b ..., shapes ..., ages ..., runs ...], shapes by their tangents."""
        train, size = self.model.train, scored.coefficients
        design = self.design(train, scored.terms)[0]
        slopes = self.tangents(train, scored.terms, scored.b)
        return np.concatenate([design[:, :size], slopes, design[:, size:]], axis=1)

    def heard(self, terms: Sequence[Term], *, spread: bool = True) -> "Evidence":
        """The evidence under the noise that these terms leave, and what they show to differ from run to run.

        Noise and coefficients depend on each other. The fixed point is sought from the present noise and from white
        noise, and the more probable one is taken.
        """
        known: dict[NoiseModel, tuple[Evidence, NoiseModel]] = {}
        own, other = (
            _heard(Evidence(self.model, start, self.spread), terms, known) for start in (self.noise, NoiseModel())
        )
        best = own if own is other else max((own, other), key=lambda e: e.rank(e.score(terms)))
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
        alike, train = NoiseModel(rest=self.noise.rest, moving=self.noise.moving), self.model.train
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
            white = _heard(white, terms, {}, slow=False)
        residual, alike = white.residual(self.model.train, white.score(terms), runs=True), white.noise
        share = independent_share(rows, rows.weighed(residual, alike))
        return with_run_spread(Evidence(self.model, replace(alike, share=share), self.spread), terms)

    def places_of_ages(self, scored: Scored) -> slice:
        """Of the ages in a posterior."""
        at = scored.coefficients + scored.shapes
        return slice(at, at + len(self.model.ages))

    def age_cost(self, scored: Scored) -> float:
        """How much less probable the ages of a set are than their means, as log prior density."""
        own = scored.posterior.beta[self.places_of_ages(scored)]
        mean, deviation = np.array(list(self.model.ages.values())).T
        held = np.isin(np.arange(own.size), sorted(self.model.held_ages(scored.terms)))
        return float(0.5 * np.sum(np.where(held, 0.0, (own - mean) / deviation) ** 2))

    def ages(self, scored: Scored) -> dict[str, float]:
        """Ages of the channels against the position [s] of a set."""
        own = scored.posterior.beta[self.places_of_ages(scored)]
        channels = [channel for channel in self.model.ages if channel != "position"]
        out = {channel: float(self.model.against_position(channel) @ own) for channel in channels}
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
        """(N,) recorded effort less the prediction on all rows [effort].

        `runs`: with what differs from run to run, and friction near rest from its law, which no model file has. What an
        unknown state at the start of a run adds is taken off either way.
        """
        out, at = split.target(scored.terms), 0
        for block in self.model.blocks(split, scored.terms):
            own = scored.b[at : at + block.values.shape[1]]
            at += own.size
            out = out - block.values @ own
        at = scored.coefficients + scored.shapes
        spread = self.spread.of(scored.terms) if runs else RunSpread()
        for block in self._others(split, spread):
            own = scored.posterior.beta[at : at + block.values.shape[1]]
            at += own.size
            if runs or block.of_log:
                out = out - block.values @ own
        if starts_unknown(scored.terms) and not runs:
            zeros = split.run_columns[-1]
            out = out - zeros @ (zeros.T @ out / np.maximum(zeros.sum(axis=0), 1.0))
        return np.asarray(out)

    def predictive(self, terms: Sequence[Term], variance: float, fitted: "Evidence", of_fit: float) -> float:
        """Log p(held-out rows | training rows, terms) of a fit; what differs between runs is each run's own.

        Args:
            terms: The set.
            variance: Of the held-out rows under this noise.
            fitted: The evidence under whose noise the training rows are fitted.
            of_fit: Variance of the training rows under it.
        """
        train, prior = fitted.products(self.model.train, terms)
        train = train.times(variance / of_fit)
        held, _ = self.products(self.model.held, terms)
        sides = (self.model.train, fitted), (self.model.held, self)
        own = [sum(b.values.shape[1] for b in self.model.of_runs(s, e.spread.of(terms))) for s, e in sides]
        shared, size = train.moment.size - own[0], train.moment.size + own[1]
        first, second = np.arange(train.moment.size), np.r_[np.arange(shared), size - own[1] + np.arange(own[1])]
        more = self.design(self.model.held, terms)[1]
        joined = Prior.stacked([prior, more.part(slice(more.mean.size - own[1], None))])
        before, after = placed(train, first, size), placed(held, second, size)
        both = posterior(before + after, joined, variance)
        jacobian = self.log_jacobian(self.model.held, terms, both)
        return both.log_evidence - posterior(before, joined, variance).log_evidence + jacobian


def _heard(
    found: Evidence,
    terms: Sequence[Term],
    known: dict[NoiseModel, tuple[Evidence, NoiseModel]],
    *,
    slow: bool = True,
) -> Evidence:
    """The evidence at a fixed point of the noise; `known`: by noise, the evidence and the noise of what it leaves."""
    for _ in range(HEARINGS):
        if found.noise not in known:
            residual = found.residual(found.model.train, found.corrected(found.score(terms)), runs=True)
            known[found.noise] = found, fitted_noise(found.model.train.rows, residual, slow=slow)
        found, noise = known[found.noise]
        if noise == found.noise:
            break
        found = known[noise][0] if noise in known else Evidence(found.model, noise, found.spread)
    return found


def shape_slopes(split: Split, terms: Sequence[Term], b: FloatArray) -> FloatArray:
    """(N, s) change of the prediction less the target with each shape parameter, at b (1 + k,) = [K, K theta ...]."""
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
    return out


def _change(one: Split, other: Split, terms: Sequence[Term]) -> FloatArray:
    """(N, 1) difference of the targets of two splits."""
    return (one.target(terms) - other.target(terms))[:, None]


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

    def least(tried: Sequence[RunSpread]) -> RunSpread:
        odds = [replace(first, spread=spread).score(terms).log_odds for spread in tried]
        return next(spread for spread, own in zip(tried, odds, strict=True) if own >= max(odds) - ALTERNATIVE)

    of_zeros = least([RunSpread(zero=size) for size in RUN_SPREADS])
    both = least([replace(of_zeros, friction=size) for size in RUN_SPREADS])
    return Evidence(evidence.model, evidence.noise, both)
