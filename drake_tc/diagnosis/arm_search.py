"""Which effects a robot's joints lack, on which shaft: forward selection on training rows alone."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from drake_tc.diagnosis.arm_fit import RIDGE, ArmFit, ShaftEffect, grown
from drake_tc.diagnosis.bounded import solve_bounded
from drake_tc.diagnosis.columns import Term
from drake_tc.diagnosis.evidence import Comparison
from drake_tc.diagnosis.search import SearchOptions
from drake_tc.effects.base import Effect
from drake_tc.identification.autocorrelation import correlation_time
from drake_tc.types import FloatArray

FINALISTS = 6
PERIODIC = "cycles_per_turn"
TRIED = 12
"""Shapes of a long grid that are tried with the filters; the others only on unfiltered columns."""
ARM_OPTIONS = SearchOptions(most=30, least_gain=0.02, least_log_evidence=-np.inf, least_share=0.95)
"""Looser than for one joint: the error of a rigid body's sixty parameters is in every cross-validated figure, so
one effect of many lowers it by less."""


@dataclass(frozen=True)
class Step:
    """One effect added: what it brought on the joints that its shaft loads."""

    added: ShaftEffect
    comparison: Comparison


@dataclass(frozen=True, eq=False)
class ArmSearch:
    """The chosen fit, and the steps to it from the declared one."""

    chosen: ArmFit
    steps: tuple[Step, ...]


class _Trial:
    """What a block of columns would explain beside those of a fit, all coefficients in their bounds [sigma^2]."""

    def __init__(self, fit: ArmFit) -> None:
        self.fit = fit
        self.gram, self.moment = fit.grams.sum(0), fit.moments.sum(0)
        self.residual = fit.residual
        self.explained = 2.0 * float(self.moment @ fit.beta) - float(fit.beta @ self.gram @ fit.beta)

        self._loaded: dict[int, FloatArray] = {}

    def loaded(self, axis: int) -> FloatArray:
        """The fit's columns (N, m) as the shaft sees them, in units of sigma^2."""
        if axis not in self._loaded:
            turns = np.array(self.fit.rows.axes[axis].turns)
            hit = np.flatnonzero(turns)
            weight = turns[hit] / self.fit.sigma[hit] ** 2
            self._loaded[axis] = sum(w * self.fit.design[:, j] for w, j in zip(weight, hit, strict=True))
        return self._loaded[axis]

    def gain(self, axis: int, effect: Effect, columns: FloatArray) -> float:
        """Squared error that the columns (N, k) of a shaft remove, refitting all others."""
        fit = self.fit
        turns = np.array(fit.rows.axes[axis].turns)
        hit = np.flatnonzero(turns)
        weight = turns[hit] / fit.sigma[hit]
        own = float(np.sum(weight**2)) * (columns.T @ columns)
        design = self.loaded(axis)
        mixed = design.T @ columns
        moment = columns.T @ (fit.rows.torque[:, hit] / fit.sigma[hit] @ weight)
        if not (np.diag(own) > 0.0).all():
            return 0.0
        gram = np.block([[self.gram, mixed], [mixed.T, own]])
        moments = np.concatenate([self.moment, moment])
        lower = np.concatenate([fit.lower, [p.lower for p in effect.coefficients]])
        upper = np.concatenate([fit.upper, [p.upper for p in effect.coefficients]])
        beta = solve_bounded(gram + RIDGE * np.diag(np.diag(gram)), moments, lower, upper)
        return 2.0 * float(moments @ beta) - float(beta @ gram @ beta) - self.explained


def search_arm(
    baseline: ArmFit,
    effects: Sequence[Effect],
    options: SearchOptions = ARM_OPTIONS,
    progress: Callable[[str, float], None] = lambda text, share: None,
) -> ArmSearch:
    """Add the effect that explains most, shaft by shaft and shape by shape, until none is a real improvement.

    In each round every effect is put on every shaft at each point of its shape grid; the best few are refined
    and cross-validated. The same effect may be on several shafts, and a periodic one on a shaft with several periods.

    Args:
        baseline: Of the declared columns, on the training rows.
        effects: Candidates.
        options: What counts as real; `beam` is not used.
        progress: Told how far it is.
    """
    rows = baseline.rows
    cache: dict[object, FloatArray] = {}
    chosen = baseline
    steps: list[Step] = []

    def columns(axis: int, term: Term) -> FloatArray:
        key = (axis, term.cache_key)
        if key not in cache:
            cache[key] = rows.of(axis, term)
        return cache[key]

    for number in range(options.most):
        trial = _Trial(chosen)
        ranked: list[tuple[float, ShaftEffect]] = []
        for axis in range(len(rows.axes)):
            context = rows.context(axis)
            for effect in effects:
                if _taken(chosen, axis, effect):
                    continue
                tried = [Term(effect, s) for s in _screened(trial, axis, effect, effect.shape_grid(context))]
                gains = [trial.gain(axis, effect, columns(axis, t)) for t in tried]
                if gains:
                    best = int(np.argmax(gains))
                    ranked.append((gains[best], ShaftEffect(axis, tried[best])))
        ranked.sort(key=lambda pair: -pair[0])
        grown_fits = [grown(chosen, _refined(trial, place)) for _, place in ranked[:FINALISTS]]
        judged = [(compare_arms(chosen, f), f) for f in grown_fits]
        real = [(c, f) for c, f in judged if _real(c, options)]
        progress("effects", (number + 1) / options.most)
        if not real:
            break
        comparison, best_fit = max(real, key=lambda pair: pair[0].removed)
        steps.append(Step(best_fit.shaft_effects[-1], comparison))
        chosen = best_fit
    return ArmSearch(chosen, tuple(steps))


def _taken(fit: ArmFit, axis: int, effect: Effect) -> bool:
    there = [p.term.effect for p in fit.shaft_effects if p.axis == axis]
    same = [e for e in there if e.id == effect.id]
    periodic = any(p.name == PERIODIC for p in effect.shapes)
    return len(same) >= (6 if periodic else 1)


def _screened(trial: _Trial, axis: int, effect: Effect, grid: Sequence[dict[str, float]]) -> Sequence[dict[str, float]]:
    """The shapes whose unfiltered columns correlate most with the residual; all of them when the grid is short."""
    if len(grid) <= 2 * TRIED:
        return grid
    fit = trial.fit
    signals = fit.rows.signals[axis].take(fit.rows.rows)
    turns = np.array(fit.rows.axes[axis].turns)
    r = (trial.residual / fit.sigma) @ (turns / fit.sigma)
    scores = np.empty(len(grid))
    for i, shape in enumerate(grid):
        x = effect.columns(signals, shape)
        x = x - x.mean(axis=0)
        m = x.T @ r
        scores[i] = float(m @ np.linalg.solve(x.T @ x + 1e-9 * np.eye(m.size), m))
    return [grid[int(i)] for i in np.argsort(-scores)[:TRIED]]


def _refined(trial: _Trial, place: ShaftEffect) -> ShaftEffect:
    """The shape that explains most, from where the grid left it (Nelder-Mead on logarithms)."""
    effect, shape = place.term.effect, place.term.shape
    names = effect.shapes
    if not names:
        return place
    start = np.array([shape[p.name] for p in names])
    step = np.array([0.004 if p.name == PERIODIC else 0.2 for p in names])

    def at(x: FloatArray) -> Term:
        values = start * np.exp(step * x)
        return Term(effect, {p.name: float(np.clip(v, p.lower, p.upper)) for p, v in zip(names, values, strict=True)})

    def cost(x: FloatArray) -> float:
        return -trial.gain(place.axis, effect, trial.fit.rows.of(place.axis, at(x)))

    zero = np.zeros(len(names))
    found = minimize(
        cost,
        zero,
        method="Nelder-Mead",
        options={
            "maxfev": 25 * len(names),
            "xatol": 0.05,
            "fatol": 1e-3,
            "initial_simplex": np.vstack([zero, np.eye(len(names))]),
        },
    )
    return ShaftEffect(place.axis, at(found.x))


def compare_arms(small: ArmFit, large: ArmFit, seed: int = 0, resamples: int = 400) -> Comparison:
    """What the last effect of `large` brings on the joints that its shaft loads, in units of sigma."""
    turns = np.abs(np.array(large.rows.axes[large.shaft_effects[-1].axis].turns))
    hit = turns > 0
    before, after = (np.sqrt(np.mean((f.held / f.sigma)[:, hit] ** 2)) for f in (small, large))
    lengths = [int(n) for n in np.bincount(large.rows.run) if n]
    residual = (large.held / large.sigma)[:, hit]
    effective = sum(max(r.size / correlation_time(r - r.mean(), lengths), 3.0) for r in residual.T)
    ratio = float(before / max(after, 1e-300))
    extra = large.shaft_effects[-1].term.size
    log_evidence = effective * float(np.log(ratio)) - 0.5 * extra * float(np.log(effective))
    removed = float(np.sqrt(max(before**2 - after**2, 0.0) * hit.sum()))
    difference = small.block_sse(turns) - large.block_sse(turns)
    rng = np.random.default_rng(seed)
    draws = rng.integers(0, difference.size, (resamples, difference.size))
    share = float(np.mean(difference[draws].sum(axis=1) > 0.0))
    return Comparison(1.0 - 1.0 / ratio, removed, log_evidence, share)


def _real(c: Comparison, options: SearchOptions) -> bool:
    return (
        c.gain >= options.least_gain and c.log_evidence >= options.least_log_evidence and c.share >= options.least_share
    )
