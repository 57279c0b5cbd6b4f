"""Which effects are missing: a beam search over sets of effects, on training runs alone."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import minimize

from drake_tc.diagnosis.believable import objection_to_values
from drake_tc.diagnosis.columns import Columns, Term
from drake_tc.diagnosis.evidence import Comparison, compare
from drake_tc.diagnosis.regression import Fit, fit, score
from drake_tc.diagnosis.result import DidNotHold
from drake_tc.effects.base import Context, DriveEffect, Effect
from drake_tc.effects.library import LIBRARY
from drake_tc.types import FloatArray

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class SearchOptions:
    """What counts as a real improvement; calibrated on simulated rigs that lack nothing (drake_tc/diagnosis/README.md).

    Attributes:
        beam: Sets kept at each size. most: largest number of effects added.
        least_gain: Smallest relative drop of the cross-validated RMS that one more effect must bring.
        least_log_evidence: Evidence it must leave after its parameters are paid.
        least_share: Share of block resamples in which it must help.
        least_removed: Smallest RMS it must explain, in noise floors: less is nil in practice.
        promising_gain: Smallest relative drop from which on a second effect is tried beside one that is not real by
            itself: each of two effects can hide the evidence of the other.
        least_of_first: ... and as a share of what the effects before it explain: a smaller remainder is more likely an
            imperfect form of those than a cause of its own.
    """

    beam: int = 6
    most: int = 4
    least_gain: float = 0.05
    least_log_evidence: float = 8.0
    least_share: float = 0.98
    least_removed: float = 0.5
    least_of_first: float = 0.10
    promising_gain: float = 0.02


@dataclass(frozen=True)
class Search:
    """What the search found.

    Attributes:
        baseline, chosen: Fits without and with the missing effects.
        steps: For each effect chosen, in order, what it brought.
        alternatives: Other sets of the chosen size, best first. alone: the best fit of every candidate alone.
        passed_over: Effects that would have been added but for values that are impossible or below the sensor.
    """

    baseline: Fit
    chosen: Fit
    steps: tuple[tuple[str, Comparison], ...]
    alternatives: tuple[Fit, ...]
    alone: tuple[Fit, ...]
    passed_over: tuple[DidNotHold, ...] = field(default=())


def screen(
    columns: Columns, residual: FloatArray, effect: Effect, grid: Sequence[dict[str, float]], keep: int
) -> Iterator[dict[str, float]]:
    """The `keep` shapes whose unfiltered columns correlate most with the residual (N,); all when the grid is short."""
    if len(grid) <= 3 * keep or isinstance(effect, DriveEffect):
        yield from grid
        return
    rows = columns.samples.rows
    step = max(1, rows.size // 6000)
    signals = columns.samples.signals.take(rows[::step])
    r = residual[::step]
    scores = np.empty(len(grid))
    for i, shape in enumerate(grid):
        x = effect.columns(signals, shape)
        x = x - x.mean(axis=0)
        projection, *_ = np.linalg.lstsq(x.T @ x + 1e-9 * np.eye(x.shape[1]), x.T @ r, rcond=None)
        scores[i] = float(projection @ (x.T @ r))
    for i in np.argsort(-scores)[:keep]:
        yield grid[int(i)]


def best_shape(columns: Columns, terms: Sequence[Term], effect: Effect, context: Context, residual: FloatArray) -> Fit:
    """The best fit of `terms` plus one effect over its shape grid."""
    tried = [
        score(columns, [*terms, Term(effect, shape)])
        for shape in screen(columns, residual, effect, effect.shape_grid(context), keep=4)
    ]
    return fit(columns, min(tried, key=lambda s: s.cv_rms).terms)


def refine(columns: Columns, start: Fit, evaluations: int = 60) -> Fit:
    """Refine all shape parameters of a fit together (Nelder-Mead on their logarithms or values)."""
    free = [(i, p) for i, t in enumerate(start.terms) for p in t.effect.shapes]
    if not free:
        return start
    values = np.array([start.terms[i].shape[p.name] for i, p in free])
    steps = np.array([0.004 if p.name == "cycles_per_turn" else 0.15 for _, p in free])
    best, least = start.terms, start.cv_rms

    def shaped(x: FloatArray) -> list[Term]:
        shapes: list[dict[str, float]] = [dict(t.shape) for t in start.terms]
        for (i, p), step, x0, v in zip(free, steps, x, values, strict=True):
            shapes[i][p.name] = float(np.clip(v * np.exp(step * x0), p.lower, p.upper))
        return [Term(t.effect, s) for t, s in zip(start.terms, shapes, strict=True)]

    def cost(x: FloatArray) -> float:
        nonlocal best, least
        candidate = score(columns, shaped(x))
        if candidate.cv_rms < least:
            best, least = candidate.terms, candidate.cv_rms
        return float(np.log(candidate.cv_rms))

    zero = np.zeros(len(free))
    simplex = np.vstack([zero, np.eye(len(free))])
    minimize(
        cost,
        zero,
        method="Nelder-Mead",
        options={"maxfev": evaluations * len(free), "xatol": 0.02, "fatol": 1e-4, "initial_simplex": simplex},
    )
    return start if best is start.terms else fit(columns, best)


SAME = 1.02
"""Fits whose errors differ by less than this factor are as good as each other: the smaller one is taken."""


def ranked(fits: Iterable[Fit]) -> list[Fit]:
    """Fits by error; but the simplest of those as good as the best comes first: by size, then in library order."""
    order = {effect.key: i for i, effect in enumerate(LIBRARY)}
    by_error = sorted(fits, key=lambda f: f.cv_rms)
    good = [f for f in by_error if f.cv_rms <= SAME * by_error[0].cv_rms]
    first = min(good, key=lambda f: (f.size, sum(order[t.effect.key] for t in f.terms)))
    return [first, *(f for f in by_error if f is not first)]


def candidates(
    library: Sequence[Effect], context: Context, declared: Sequence[str]
) -> tuple[list[Effect], list[tuple[str, str]]]:
    """Effects that can be looked for, and for the others why not."""
    usable, obstacles = [], []
    for effect in library:
        if effect.id in declared:
            continue
        obstacle = effect.obstacle(context)
        if not obstacle and not effect.shape_grid(context):
            obstacle = "the motion spans too little of its range"
        if obstacle:
            obstacles.append((effect.key, obstacle))
        else:
            usable.append(effect)
    return usable, obstacles


def search(
    columns: Columns,
    declared: Sequence[Term],
    effects: Sequence[Effect],
    context: Context,
    floor: float,
    options: SearchOptions,
    progress: Progress = lambda text, share: None,
) -> Search:
    """Beam search by cross-validated error; stops when no further effect is a real improvement.

    Args:
        columns: Training rows.
        declared: What the owner models.
        effects: Candidates.
        context: What the logs offer.
        floor: Noise floor [effort].
        options: What counts as real.
        progress: Told how far it is.
    """
    baseline = refine(columns, fit(columns, declared))
    beam, chosen = [baseline], baseline
    steps: list[tuple[str, Comparison]] = []
    alternatives: list[Fit] = []
    alone: list[Fit] = []
    passed_over: dict[str, DidNotHold] = {}
    waited = False  # for a second effect, because the first alone was promising and not real
    for size in range(1, options.most + 1):
        grown: dict[frozenset[str], Fit] = {}
        for number, parent in enumerate(beam):
            taken = {t.effect.id for t in parent.terms}
            for effect in effects:
                names = frozenset({t.effect.key for t in parent.terms} | {effect.key})
                if effect.id in taken or names in grown:
                    continue
                grown[names] = best_shape(columns, parent.terms, effect, context, parent.residual)
            progress(f"sets of {size}", (number + 1) / len(beam))
        if not grown:
            break
        coarse = sorted(grown.values(), key=lambda f: f.cv_rms)
        if coarse[0].cv_rms > (1.0 - 0.2 * options.least_gain) * chosen.cv_rms and size > 1:
            break
        close = [f for f in coarse if f.cv_rms < 1.5 * coarse[0].cv_rms][: options.beam]
        believed, impossible = _believable((refine(columns, f) for f in close), baseline, context, columns)
        least = min((f.cv_rms for f in believed), default=np.inf)
        explained = float(np.sqrt(max(baseline.cv_rms**2 - chosen.cv_rms**2, 0.0)))
        for fitted, objections in impossible:
            if fitted.cv_rms < least and _real(compare(chosen, fitted, columns.samples), floor, explained, options):
                passed_over |= objections
        if not believed:
            break
        refined = ranked(believed)
        if size == 1:
            alone = [*refined, *coarse[len(close) :]]
        comparisons = [compare(chosen, f, columns.samples) for f in refined]
        real = [i for i, c in enumerate(comparisons) if _real(c, floor, explained, options)]
        if real and waited:
            real = [i for i in real if _each_needed(columns, refined[i], chosen, floor, options)]
        if not real:
            if waited or max(c.gain for c in comparisons) < options.promising_gain:
                break
            waited, beam = True, refined[: options.beam]
            continue
        waited = False
        best, comparison = refined[real[0]], comparisons[real[0]]
        added = [t.effect.key for t in best.terms if t.effect.key not in {u.effect.key for u in chosen.terms}]
        steps.append(("+".join(added), comparison))
        chosen, alternatives = best, [f for f in refined if f is not best]
        beam = refined[: options.beam]
    taken = {t.effect.id for t in chosen.terms}
    withdrawn = tuple(d for d in passed_over.values() if d.id not in taken)
    return Search(baseline, chosen, tuple(steps), tuple(alternatives), tuple(alone), withdrawn)


def _believable(
    fits: Iterable[Fit], baseline: Fit, context: Context, columns: Columns
) -> tuple[list[Fit], list[tuple[Fit, dict[str, DidNotHold]]]]:
    """The fits whose added effects all have possible values, and the others with the objections to them."""
    known = {t.effect.key for t in baseline.terms}
    kept: list[Fit] = []
    refused: list[tuple[Fit, dict[str, DidNotHold]]] = []
    for fitted in fits:
        objections = {}
        for term in fitted.terms:
            effect = term.effect
            found = None if effect.key in known else objection_to_values(fitted, term, context, columns.samples)
            if found is not None:
                objections[effect.key] = DidNotHold(effect.key, effect.id, effect.title, found[0], found[1])
        if objections:
            refused.append((fitted, objections))
        else:
            kept.append(fitted)
    return kept, refused


def _each_needed(columns: Columns, pair: Fit, chosen: Fit, floor: float, options: SearchOptions) -> bool:
    """Whether a fit loses a real improvement with any one of the effects that it has beyond `chosen`."""
    known = {t.effect.key for t in chosen.terms}
    for term in pair.terms:
        if term.effect.key not in known:
            without = refine(columns, fit(columns, [t for t in pair.terms if t is not term]), evaluations=20)
            if not _real(compare(without, pair, columns.samples), floor, 0.0, options):
                return False
    return True


def _real(c: Comparison, floor: float, explained: float, options: SearchOptions) -> bool:
    return (
        c.gain >= options.least_gain
        and c.log_evidence >= options.least_log_evidence
        and c.share >= options.least_share
        and c.removed >= options.least_removed * floor
        and c.removed >= options.least_of_first * explained
    )
