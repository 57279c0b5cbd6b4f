"""Which set of effects: the largest log odds, by a beam over sets that grow, shrink and exchange effects."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.diagnosis.data.samples import rms
from drake_tc.diagnosis.evidence import Evidence, Scored
from drake_tc.diagnosis.linear import Prior, Products, posterior
from drake_tc.diagnosis.priors import ALTERNATIVE, BEAM, DISTORTED, MOST_EFFECTS, NAMED
from drake_tc.diagnosis.problem.columns import Term, drives
from drake_tc.diagnosis.problem.parameters import physical_parameters
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.effects.base import Effect, Signals
from drake_tc.effects.check import implausible
from drake_tc.types import FloatArray

MOST_SCREENED = 6000
"""Samples on which a long grid is screened."""


class ShapeScreen:
    """Which shapes of a long grid have the unfiltered columns that correlate most with a residual.

    score(shape) = m' (X'X)^+ m,   m = X'r,   X: columns of the shape about their means, r: residual

    The columns of a grid are computed once and kept as long as the screen: a search asks for every parent model.
    """

    def __init__(self, signals: Signals) -> None:
        """A screen over the signals (N,) at the rows of the residuals."""
        self._step = max(1, len(signals) // MOST_SCREENED)
        self._signals = signals.take(slice(None, None, self._step))
        self._kept: dict[tuple[object, ...], tuple[FloatArray, FloatArray]] = {}

    def best(
        self, effect: Effect, residual: FloatArray, grid: Sequence[dict[str, float]], keep: int
    ) -> list[dict[str, float]]:
        """The `keep` best shapes for a residual (N,), best first; the whole grid when it is short."""
        if len(grid) <= 3 * keep:
            return list(grid)
        columns, inverse = self._columns(effect, grid)
        moment = (columns.reshape(-1, columns.shape[-1]) @ residual[:: self._step]).reshape(columns.shape[:2])
        scores = np.einsum("si,sij,sj->s", moment, inverse, moment)
        return [grid[int(i)] for i in np.argsort(-scores)[:keep]]

    def _columns(self, effect: Effect, grid: Sequence[dict[str, float]]) -> tuple[FloatArray, FloatArray]:
        """X' (S, k, n) of every shape and (X'X)^+ (S, k, k)."""
        key = (effect.key, *(tuple(shape.values()) for shape in grid))
        if key not in self._kept:
            columns = np.stack([effect.columns(self._signals, shape).T for shape in grid])
            columns -= columns.mean(axis=-1, keepdims=True)
            gram = columns @ columns.transpose(0, 2, 1) + 1e-9 * np.eye(columns.shape[1])
            inverse = np.linalg.pinv(gram, rcond=gram.shape[1] * np.finfo(float).eps, hermitian=True)
            self._kept[key] = columns, np.asarray(inverse, dtype=np.float64)
        return self._kept[key]


WIDE = 12.0
"""Log odds by which the start of a set may be behind: what refining the shapes may gain."""
CONTENDERS = 3
"""Sets of a pass that are compared each under its own noise."""
FEW_ROWS = 200.0
"""Independent rows below which a search does not see weak effects among some forty."""
PASSES = 3
SETTLING, MOST_SETTLING = 2, 8
"""Least and largest number of linearisations of a set."""
STILL = 0.3
"""Step of an age over the standard deviation of its prior, below which it has arrived."""
SHAPES = 4
"""Starting points of a long grid that are tried beside each set, those that correlate most with its residual."""

Progress = Callable[[str, float], None]
Compared = tuple[Evidence, Scored]
"""A set and the evidence by which it was judged."""


@dataclass(frozen=True, eq=False)
class Found:
    """What a search found.

    Attributes:
        evidence: Under the noise of what the best set leaves.
        best: The best set.
        alternatives: Sets nearly as probable, the most probable first.
    """

    evidence: Evidence
    best: Scored
    alternatives: tuple[Scored, ...]


class Sets:
    """Scored sets of one joint under one noise, each computed once."""

    def __init__(self, evidence: Evidence, effects: Sequence[Effect]) -> None:
        """Sets of terms of these effects under this evidence."""
        self.evidence, self.effects = evidence, effects
        samples = evidence.model.train.samples
        self._screen = ShapeScreen(samples.signals.take(samples.rows))
        self._known: dict[tuple[object, ...], Scored] = {}
        self._last: tuple[Scored, tuple[FloatArray, Prior, Products]] | None = None

    def score(self, terms: Sequence[Term]) -> Scored:
        """The set at its most probable shapes; impossible values have no odds."""
        key = tuple(sorted(str(t.cache_key) for t in terms))
        if key not in self._known:
            found = self.evidence.refined(self.evidence.score(terms))
            self._known[key] = found if possible(self.evidence, found) else _impossible(found)
        return self._known[key]

    def children(self, parent: Scored) -> list[Scored]:
        """The best sets with one effect more, by effect, as the linear fit of their starting points has them."""
        residual = self.evidence.residual(self.evidence.model.train, parent)
        ids = {t.effect.id for t in parent.terms}
        trials = [
            (odds, term)
            for effect in self.effects
            if effect.id not in ids
            for odds, term in [self.best_start(parent, effect, residual)]
            if np.isfinite(odds)
        ]
        trials.sort(key=lambda t: -t[0])
        found: list[Scored] = []
        for odds, term in trials:
            if odds < parent.log_odds - WIDE or len(found) > BEAM:
                break
            child = self.score([*parent.terms, term])
            if np.isfinite(child.log_odds):
                found.append(child)
        return found

    def best_start(self, parent: Scored, effect: Effect, residual: FloatArray) -> tuple[float, Term]:
        """(log odds, term) of a set and the best starting point of one effect more, given the set's residual (N,)."""
        grid = effect.shape_grid(self.evidence.model.context)
        if effect.coefficients:
            grid = self._screen.best(effect, residual, grid, SHAPES)
        tried = [(self._odds(parent, Term(effect, shape)), i) for i, shape in enumerate(grid)]
        odds, number = max(tried)
        return odds, Term(effect, grid[number])

    def _odds(self, parent: Scored, term: Term) -> float:
        """Log odds of a set and one term more, from the products of the set's own columns."""
        evidence, split = self.evidence, self.evidence.model.train
        if not drives([term]) and not term.effect.coefficients:
            return evidence.score([*parent.terms, term]).log_odds
        design, prior, products = self._parent(parent)
        share, target = evidence.noise.share, evidence.target(split, parent.terms)
        if drives([term]):  # two drive effects act as the sum of both, to first order
            offset = evidence.drive_offset(split, term)
            square = products.square + share * float(offset @ offset - 2.0 * offset @ target)
            products = Products(products.gram, products.moment - share * (design.T @ offset), square, products.rows)
            target = target - offset
        if term.effect.coefficients:
            columns = evidence.term_columns(split, term)
            weighed = share * columns
            cross = design.T @ weighed
            gram = np.block([[products.gram, cross], [cross.T, columns.T @ weighed]])
            moment = np.concatenate([products.moment, weighed.T @ target])
            products = Products(gram, moment, products.square, products.rows)
            prior = Prior.stacked([prior, evidence.model.block(split, term).prior])
        found = posterior(products, prior, start=parent.posterior.variance)
        jacobian = share * split.log_jacobian([term], float(np.sqrt(found.variance)))
        return evidence.odds(parent.terms, found) + evidence.prior_odds([term]) + jacobian

    def _parent(self, parent: Scored) -> tuple[FloatArray, Prior, Products]:
        """Whitened columns of a set, their prior and products; those of the last set are kept."""
        if self._last is None or self._last[0] is not parent:
            split = self.evidence.model.train
            design, prior = self.evidence.design(split, parent.terms)
            self._last = parent, (design, prior, self.evidence.products(split, parent.terms)[0])
        return self._last[1]


def possible(evidence: Evidence, scored: Scored) -> bool:
    """Whether every asked parameter lies in its physically possible range, see `why_impossible`."""
    fit, model = as_fit(scored), evidence.model
    if not np.isfinite(fit.beta).all():
        return False
    if min(scored.b[0], physical_parameters(fit)["drive"]["gain"]) <= model.least_gain:
        return False
    return not why_impossible(evidence, scored)


def why_impossible(evidence: Evidence, scored: Scored) -> str:
    """Which asked parameter lies outside of its physically possible range, as a sentence; "" where none does.

    The torques that limit it are those of the larger drive gain: without a drive, any load would be possible.
    """
    model, named = evidence.model, physical_parameters(as_fit(scored))
    known = {"gain": max(named["drive"]["gain"], model.gain)} | {
        name: named[name][name] for name in ("viscous", "coulomb") if name in named
    }
    context = replace(model.context, fitted=known)
    asked = [t for t in scored.terms if not model.is_declared(t.effect)]
    return next((why for t in asked if (why := implausible(t.effect, named[t.effect.key], context))), "")


def as_fit(scored: Scored) -> Fit:
    """The set in the form that reports and model files read; without residuals."""
    empty = np.zeros(0)
    return Fit(scored.terms, scored.beta, empty, 0.0, 0.0, empty)


def _impossible(scored: Scored) -> Scored:
    return replace(scored, log_odds=-np.inf)


def find(evidence: Evidence, effects: Sequence[Effect], progress: Progress = lambda text, share: None) -> Found:
    """The most probable set.

    The noise of a model that lacks effects is too large, which hides weak ones, and the effort that it needs is wrong.
    So the search is repeated under the noise and the latent effort of its own result until the result stays the same.
    It begins with as many rows as the residual of the declared model has independent ones; where these are few, because
    an effect that is missing makes this residual slow, with all rows too.
    """
    declared, first = evidence.model.declared, evidence
    best = evidence.score(declared)
    kept = [best]
    for number in range(PASSES):
        progress("effects", 0.1 + 0.25 * number)
        tried, sound = list[Compared](), list[Compared]()  # those of the last pass go before there are new ones
        started = _without_columns(evidence)
        starts = _first(started) if number == 0 else [started]
        before, pools = best.ids, [_pool(Sets(used, effects), kept) for used in starts]
        pool = pools[-1]
        found = pool[0]
        tried, sound = _compared(starts, pools, {s.ids for s in kept})
        evidence, best = _trusted(first, simplest(tried), sound)
        kept = [best, *(s for _, s in as_probable(tried) if s.ids != best.ids)]
        if number and best.ids == before:
            break
    if evidence.distortion(best) > DISTORTED:
        imperfect, own, pool = _imperfect(first, effects)
        found = own
        evidence, best = _trusted(first, (imperfect, own), sound)
    there = next((s.log_odds for s in pool if s.ids == best.ids), found.log_odds)
    near = [s for s in pool if s.ids != best.ids and s.log_odds > there - ALTERNATIVE]
    near.sort(key=lambda s: -s.log_odds)
    own = evidence.refined(evidence.score(best.terms))  # with its own odds, not those at the noise of the loudest
    return Found(evidence, own, tuple(near))


def _first(evidence: Evidence) -> list[Evidence]:
    """Noise under which the search begins; also that in which rows near rest, where dead zones act, count as others."""
    declared = evidence.model.declared
    starts = [evidence.tempered(declared)]
    if starts[0].noise.rest > 0.0:
        starts.append(evidence.tempered(declared, rest=False))
    few = starts[-1].noise.share * evidence.model.train.rows.index.size < FEW_ROWS
    return [*starts, Evidence(evidence.model)] if few else starts


def _without_columns(evidence: Evidence) -> Evidence:
    """The evidence without what has been computed from it: of a long log, all that are compared take gigabytes."""
    model = evidence.model
    bare = replace(model, train=replace(model.train), held=replace(model.held))
    return Evidence(bare, evidence.noise, evidence.spread)


def _compared(
    starts: Sequence[Evidence], pools: Sequence[Sequence[Scored]], kept: Collection[frozenset[str]]
) -> tuple[list[Compared], list[Compared]]:
    """The contenders of all pools, each settled, at equal noise; and those that their noise does not distort.

    An impossible one has no odds. `kept`: ids of the sets that were the most probable ones so far.
    """
    tried, distortions = [], []
    for used, pool in zip(starts, pools, strict=True):
        for contender in _contenders(pool, kept):
            evidence, scored = settled(used, contender)
            distortions.append(evidence.distortion(scored))
            sensible = scored if possible(evidence, scored) else _impossible(scored)
            tried.append((_without_columns(evidence), sensible))
    trusted = [distortion <= DISTORTED for distortion in distortions]
    tried = equally_noisy(tried, trusted)
    return tried, [pair for pair, own in zip(tried, trusted, strict=True) if own]


def _pool(sets: Sets, kept: Sequence[Scored]) -> list[Scored]:
    """Every set that a beam from these sets and the declared one scores, and each delay of a sensor alone, by odds."""
    declared = sets.score(sets.evidence.model.declared)
    delays = [Term(e, {}) for e in sets.effects if e.ages_of and e.coefficients]
    late = [sets.score([*declared.terms, delay]) for delay in delays]
    found = _beam(sets, [*(sets.score(each.terms) for each in kept), declared])
    pool = list({s.ids: s for s in [*found, *late] if np.isfinite(s.log_odds)}.values())
    loud = [s.log_odds > declared.log_odds + NAMED for s in pool]
    alike = equally_noisy([(sets.evidence, s) for s in pool], loud)
    return sorted((s for _, s in alike), key=lambda s: -s.log_odds)


def equally_noisy(
    sets: Sequence[tuple[Evidence, Scored]], trusted: Sequence[bool] | None = None
) -> list[tuple[Evidence, Scored]]:
    """The sets with the odds that they have if all let as much of the sensors' noise through as the loudest one.

    A set that lets less through, by a small drive gain or by noise that cancels, leaves less without explaining more.
    Sets with noise models of their own are compared by their noise under one of these, that of the most probable set:
    each whitening passes another share of it. The noise of a set counts against a part of itself as far as it is in
    what the set leaves, and only if less is left beside it.
    `trusted`: which may count as the loudest one; None takes all of some odds.
    """
    common = max(sets, key=lambda pair: pair[1].log_odds)[0].noise
    left = [s.left / evidence.noise_gain(s, common) for evidence, s in sets]
    noise = [s.passed * n for n, (_, s) in zip(left, sets, strict=True)]
    counts = trusted or [True] * len(sets)
    loud = [
        (s, n, own)
        for n, own, (_, s), yes in zip(left, noise, sets, counts, strict=True)
        if yes and np.isfinite(s.log_odds)
    ]
    out = []
    for variance, own, (evidence, s) in zip(left, noise, sets, strict=True):
        parts = [min(n, its) for t, n, its in loud if s.ids < t.ids and max(n - its, 0.0) <= variance - own]
        others = [its for t, _, its in loud if not s.ids < t.ids] + parts
        rows = evidence.noise.share * evidence.model.train.rows.index.size
        quieter = max(max(others, default=0.0) - own, 0.0)
        less = 0.5 * rows * np.log1p(quieter / variance) + rows * _of_load(evidence, s, [t for t, _, _ in loud])
        out.append((evidence, replace(s, log_odds=float(s.log_odds - less) if np.isfinite(s.log_odds) else -np.inf)))
    return out


def _of_load(evidence: Evidence, scored: Scored, others: Sequence[Scored]) -> float:
    """Log odds for each row by which a set is less probable than a part of it if what that leaves is of the load.

    What no sensor's drawn noise explains may be wander of a torque sensor. A smaller drive gain leaves less of it in
    the effort, as in `Evidence.log_jacobian`, and explains nothing. Not where the drive gain is declared.
    """
    if evidence.model.context.load != "torque" or evidence.model.held_gain is not None:
        return 0.0
    parts = [(t.b[0] / scored.b[0], 1.0 - t.passed) for t in others if t.ids < scored.ids]
    return float(max((unknown * np.log(gain) for gain, unknown in parts if gain > 1.0 and unknown > 0.0), default=0.0))


def _contenders(pool: Sequence[Scored], kept: Collection[frozenset[str]]) -> list[Scored]:
    """The most probable sets of a pool, sorted by odds, and some others.

    These are the best so far, the best of those with fewer effects, and the simplest with each delay of a sensor: its
    odds are those of a first step, whose error other effects take up.
    """
    most, others = pool[:CONTENDERS], pool[CONTENDERS:]
    smaller = [s for s in others if len(s.terms) < min(len(t.terms) for t in most)]
    out = [*most, *smaller[:1], *(s for s in others if s.ids in kept and s not in smaller[:1])]
    fewest = min(pool, key=lambda s: len(s.terms))
    delays = {t.effect.key for s in pool for t in s.terms if t.effect.ages_of and t.effect.coefficients}
    for delay in sorted(delays):
        simple = min((s for s in pool if delay in s.ids), key=lambda s: len(s.terms))
        if simple not in out and simple.log_odds > fewest.log_odds:
            out.append(simple)
    return out


def simplest(settled_sets: Sequence[tuple[Evidence, Scored]]) -> tuple[Evidence, Scored]:
    """The set with the fewest effects, then parameters, of all that the logs cannot tell from the most probable one."""
    return min(
        as_probable(settled_sets),
        key=lambda pair: (len(pair[1].terms), pair[1].coefficients + pair[1].shapes, -pair[1].log_odds),
    )


def as_probable(sets: Sequence[tuple[Evidence, Scored]]) -> list[tuple[Evidence, Scored]]:
    """Those that the logs cannot tell from the most probable one."""
    odds = max(each.log_odds for _, each in sets)
    return [(evidence, each) for evidence, each in sets if each.log_odds >= odds - ALTERNATIVE]


def _trusted(
    first: Evidence, winner: tuple[Evidence, Scored], sound: Sequence[tuple[Evidence, Scored]]
) -> tuple[Evidence, Scored]:
    """The winner, or the most probable sound set where the winner is distorted and no better with rows alike.

    A discrepancy as large as the effort makes a set probable that explains nothing.
    """
    if not sound or winner[0].distortion(winner[1]) <= DISTORTED:
        return winner
    other = simplest(sound)
    return other if other[1].ids == winner[1].ids or _better(first, other[1], winner[1]) else winner


def _better(evidence: Evidence, one: Scored, other: Scored) -> bool:
    """Whether a set is more probable than another where rows count alike, as many as the smaller residual has."""
    plain, train = Evidence(evidence.model), evidence.model.train
    left = {s: rms(plain.residual(train, plain.score(s.terms), runs=True)) for s in (one, other)}
    judge = evidence.tempered(min(left, key=lambda s: left[s]).terms)
    return judge.refined(judge.score(one.terms)).log_odds > judge.refined(judge.score(other.terms)).log_odds


def _imperfect(evidence: Evidence, effects: Sequence[Effect]) -> tuple[Evidence, Scored, list[Scored]]:
    """The most probable set where what every set leaves is no noise.

    The spectrum of what such a model does not explain is not known. A fit that whitens it would trust the fastest parts
    of the log, in which clocks and sensors are worst. Here rows count alike, as many of them as are independent. Where
    the declared model leaves so few that they name nothing, the most probable set on all rows is asked what it leaves.
    """
    declared = evidence.score(evidence.model.declared)
    found = _alike(evidence, effects, declared)
    if found[1].ids == declared.ids:
        full = _pool(Sets(Evidence(evidence.model), effects), [declared])[0]
        if _better(evidence, full, declared):
            return _alike(evidence, effects, full)
    return found


def _alike(evidence: Evidence, effects: Sequence[Effect], best: Scored) -> tuple[Evidence, Scored, list[Scored]]:
    """The most probable set where rows count alike, sought from a set."""
    pool: list[Scored] = []
    for _ in range(PASSES):
        evidence = evidence.tempered(best.terms)
        before, sets = best.ids, Sets(evidence, effects)
        pool = _beam(sets, [sets.score(best.terms), evidence.score(evidence.model.declared)])
        best = max(pool, key=lambda s: s.log_odds)
        evidence = Evidence(evidence.relinearised(best), spread=evidence.spread)
        if best.ids == before:
            break
    evidence = evidence.tempered(best.terms)
    return evidence, evidence.refined(evidence.score(best.terms)), pool


def settled(evidence: Evidence, scored: Scored) -> tuple[Evidence, Scored]:
    """The evidence under the noise and the latent effort that a set means, and the set under it.

    The model is linearised at the coefficients that noise does not bias, if these are possible. In the others, columns
    without noise, such as the age of a command, take over a part of noisy ones, at ages that the log does not have.
    A long age is reached in several steps: there are more while one moves an age on by a part of its prior.
    """
    ages = [evidence.ages(scored)]
    for _ in range(MOST_SETTLING):
        true = evidence.corrected(scored)
        at = true if possible(evidence, true) else scored
        evidence = Evidence(evidence.relinearised(at), evidence.noise, evidence.spread).heard(scored.terms)
        scored = evidence.refined(evidence.score(scored.terms))
        ages.append(evidence.ages(scored))
        if len(ages) > SETTLING and not _on_its_way(ages, evidence.model.ages):
            break
    return evidence, scored


def _on_its_way(ages: Sequence[Mapping[str, float]], priors: Mapping[str, tuple[float, float]]) -> bool:
    """Whether the age that the last step moved most, over its prior, went on in the direction of the step before."""
    last, before = ({c: (b[c] - a[c]) / priors[c][1] for c in b} for a, b in (ages[-2:], ages[-3:-1]))
    most = max(last, key=lambda channel: abs(last[channel]))
    return abs(last[most]) > STILL and last[most] * before[most] > 0.0


def pruned(evidence: Evidence, scored: Scored) -> Compared:
    """The set without the effects that are not probable enough to be named, the least probable one first.

    Each set has its own noise and its own ages, where what is left is noise.
    """
    best = evidence, scored
    while True:
        evidence, scored = best
        asked = [t for t in scored.terms if not evidence.model.is_declared(t.effect)]
        smaller = [evidence.score([t for t in scored.terms if t is not each]) for each in asked]
        own = [settled_if_sound(evidence, evidence.refined(each)) for each in smaller]
        odds = [more_probable(best, each) for each in own]
        if not odds or min(odds) >= ALTERNATIVE:
            return best
        best = own[int(np.argmin(odds))]


def settled_if_sound(evidence: Evidence, scored: Scored) -> Compared:
    """A set under the noise and the latent effort that it means, or as it is where what it leaves is no noise."""
    own = settled(evidence, scored)
    return own if own[0].distortion(own[1]) <= DISTORTED else (evidence, scored)


def more_probable(one: Compared, other: Compared) -> float:
    """Log odds of one set over the other, at equal noise."""
    (_, first), (_, second) = equally_noisy([one, other])
    return first.log_odds - second.log_odds


def worth(evidence: Evidence, best: Scored, term: Term) -> tuple[Compared, float]:
    """A set with one more term, and its log odds over the set without it.

    Each has its own noise where the odds under that of the smaller set would name the effect; where what is left is no
    noise, rows count alike.
    """
    larger = evidence, evidence.refined(evidence.score([*best.terms, term]))
    odds = more_probable(larger, (evidence, best))
    if odds < ALTERNATIVE or not possible(*larger):
        return larger, odds
    larger = settled(*larger)
    if larger[0].distortion(larger[1]) <= DISTORTED:
        return larger, more_probable(larger, settled(evidence, best))
    alike = Evidence(evidence.model).tempered(larger[1].terms)
    with_term, without = (alike.refined(alike.score(s.terms)) for s in (larger[1], best))
    return larger, with_term.log_odds - without.log_odds


def _beam(sets: Sets, starts: Iterable[Scored]) -> list[Scored]:
    """Every set that was scored: each round adds one effect to the best sets and drops what became superfluous."""
    declared = {t.effect.key for t in sets.evidence.model.declared}
    pool = {s.ids: s for s in starts}
    beam, patience = list(pool.values()), 1
    for _ in range(MOST_EFFECTS):
        best = max(s.log_odds for s in pool.values())
        grown: dict[frozenset[str], Scored] = {}
        for parent in beam:
            for child in sets.children(parent):
                if child.ids not in pool and np.isfinite(child.log_odds):
                    grown[child.ids] = child
        for child in sorted(grown.values(), key=lambda s: -s.log_odds)[:BEAM]:
            grown |= {s.ids: s for s in _smaller(sets, child, declared) if s.ids not in pool}
        pool |= grown
        beam = sorted(grown.values(), key=lambda s: -s.log_odds)[:BEAM]
        reached = max((s.log_odds for s in grown.values()), default=-np.inf)
        if reached <= best:
            patience -= 1
        if patience < 0 or not beam or reached < best - 2.0 * ALTERNATIVE:
            break
    return list(pool.values())


def _smaller(sets: Sets, scored: Scored, declared: set[str]) -> list[Scored]:
    """The set without each of its asked effects but the newest."""
    asked = [t for t in scored.terms if t.effect.key not in declared][:-1]
    return [sets.score([t for t in scored.terms if t is not each]) for each in asked]
