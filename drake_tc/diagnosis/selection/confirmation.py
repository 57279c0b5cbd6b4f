"""Does an effect that the search chose hold? It must be possible, help in every run where it acts, and carry over.

An effect of the chosen set is withdrawn when
  1. its values are physically impossible (`effects.plausibility`),
  2. it corrects the encoder by less than the logs resolve,
  3. it is a curve over the position that is mostly a multiple of the known load,
  4. it is a level that noise which wanders as what is left does may have put there (`wander`),
  5. it explains no more than the jumps of a torque on a slower clock leave (`jumps_of_torque`),
  6. some training run speaks against it: fitted on the other runs, it makes the error of that run larger. With two
     training runs the effect alone is fitted on the other run, beside the model of both,
  7. the held-out runs speak against it,
  8. another effect was withdrawn, and without that one it no longer lowers the training error; or none was withdrawn,
     and beside the effects that were chosen after it, the model without it fits as well,
  9. the whole model leaves more than the declared one by the same drive gain, or has a larger mean absolute error on
     training and held-out runs, and this effect explains least.
A run says something about an effect where it has the rows of a regression and the effect acts in it: where its
contribution has an RMS of a quarter of the noise floor or more. A training run speaks against it when its error is
larger with the effect in 98 % of block resamples, which is the certainty that the search asks of an improvement. The
model of a short run, or of one in which other things are missing too, differs from run to run by chance, so a smaller
certainty would withdraw true effects. A held-out run speaks against it when its error is larger, or when its gain may
be chance: less than 90 % of the block resamples have it; the model without the effect is fitted anew. The same is asked
of all held-out runs together, and they also speak against an effect that acts in them at all and makes their error
larger.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np

from drake_tc.diagnosis.problem.bounded import solve_bounded
from drake_tc.diagnosis.problem.columns import Columns, Term, coefficients_by_term
from drake_tc.diagnosis.problem.regression import Fit, bounds_of, fit, fit_without, predict
from drake_tc.diagnosis.problem.sensor_errors import expected_errors
from drake_tc.diagnosis.root_mean_square import mean_absolute, rms
from drake_tc.diagnosis.selection.jumps_of_torque import within_jumps
from drake_tc.diagnosis.selection.known_load import looks_like_known_load
from drake_tc.diagnosis.selection.plausible_values import objection_to_values
from drake_tc.diagnosis.selection.runs_against import heldout_against, speaks_against
from drake_tc.diagnosis.selection.wander import level_over_wander
from drake_tc.diagnosis.selection.withdrawal import (
    DidNotHold,
    ExplainedByOthers,
    LargerThanDeclared,
    LevelWithinWander,
    LittleGainAlone,
    Objection,
    TrainingRunAgainst,
    WithinJumps,
)
from drake_tc.diagnosis.thresholds import FEW_RUNS, LEAST_OVER_WANDER, SAME_ERROR
from drake_tc.effects.base import Context
from drake_tc.types import FloatArray

KEPT_OF_FIT = 1e-3
"""Weight of the fitted coefficients against one run's rows when an effect is fitted on the other run."""


@dataclass(frozen=True)
class Confirmed:
    """Rows that know the final model, the effects that held, fitted anew, and those that did not."""

    train: Columns
    held: Columns
    fit: Fit
    withdrawn: tuple[DidNotHold, ...]


Settle = Callable[[Fit], tuple[Columns, Columns, Fit]]
"""A fit to training rows, held-out rows and the fit itself, once the columns know the fit's coefficients."""


def confirm(settle: Settle, chosen: Fit, baseline: Fit, context: Context, floor: float, least_gain: float) -> Confirmed:
    """Withdraw effects one by one until all that are left hold.

    Args:
        settle: Makes columns know a fit.
        chosen: What the search chose.
        baseline: The declared model's fit. Its terms are not questioned.
        context: What the logs span.
        floor: Noise floor [effort].
        least_gain: Smallest relative drop of the cross-validated error that the search asks of an effect. It is asked
            again once an effect was withdrawn, beside which another one was chosen.
    """
    withdrawn: list[DidNotHold] = []
    declared = baseline.terms
    known = frozenset(t.effect.key for t in declared)
    while True:
        columns, held, chosen = settle(chosen)
        expected = expected_errors(columns, chosen, known, context)
        if expected:  # not worth a word: the model has them anyway
            chosen = fit(columns, [t for t in chosen.terms if t not in expected])
            continue
        added = [t for t in chosen.terms if t.effect.key not in known]
        failed = [f for t in added if (f := _objection(columns, held, chosen, t, declared, context, floor)) is not None]
        if withdrawn and not failed:
            failed = _little(columns, held, chosen, declared, added, partial(LittleGainAlone, least=least_gain))
        if added and not failed and (worse := _worse_than(baseline, columns, held, chosen)):
            failed = [_weakest(columns, held, chosen, added, declared, worse)]
        if not withdrawn and not failed:
            failed = _little(columns, held, chosen, declared, added, partial(ExplainedByOthers, least=SAME_ERROR))
        if not failed:
            return Confirmed(columns, held, chosen, tuple(withdrawn))
        worst = min(failed, key=lambda f: (f.reason != "implausible", f.heldout_gain or 0.0))
        withdrawn.append(worst)
        gone = next(t for t in chosen.terms if t.effect.key == worst.key)
        chosen = fit_without(columns, chosen, gone, declared) if len(added) > 1 else baseline


def _little(
    columns: Columns,
    held: Columns,
    chosen: Fit,
    declared: Sequence[Term],
    added: Sequence[Term],
    objection: Callable[[float], LittleGainAlone | ExplainedByOthers],
) -> list[DidNotHold]:
    """Effects that lower the training error by less than the objection to them asks for."""
    out = []
    for term in added:
        rest = fit_without(columns, chosen, term, declared)
        found = objection(1.0 - chosen.cv_rms / max(rest.cv_rms, 1e-300))
        if found.gain < found.least:
            heldout = 1.0 - rms(predict(held, chosen)) / max(rms(predict(held, rest)), 1e-300)
            out.append(DidNotHold(term.effect.key, term.effect.id, term.effect.title, found, heldout))
    return out


def _worse_than(baseline: Fit, columns: Columns, held: Columns, chosen: Fit) -> LargerThanDeclared | None:
    """What the declared model leaves less of, both by the final drive gain; None where it leaves more of all.

    Each error by its own drive gain is what the search lowers. Where the effects change that gain, the error that the
    report tells may grow all the same. So may the mean absolute error, of training and held-out runs alike: a few rows
    that err much, such as those at which a gear crosses its gap, are then bought with an error of all others.
    """
    parts: tuple[tuple[Columns, Literal["training", "held-out"]], ...] = ((columns, "training"), (held, "held-out"))
    growth = []
    for rows, part in parts:
        left = [(rows.target - rows.design(f.terms) @ f.beta) * chosen.gain for f in (baseline, chosen)]
        root, absolute = (f(left[1]) / max(f(left[0]), 1e-300) - 1.0 for f in (rms, mean_absolute))
        if root > 0.0:
            return LargerThanDeclared(part, root)
        growth.append(absolute)
    return LargerThanDeclared("mean absolute", min(growth)) if min(growth) > 0.0 else None


def _weakest(
    columns: Columns,
    held: Columns,
    chosen: Fit,
    added: Sequence[Term],
    declared: Sequence[Term],
    objection: Objection,
) -> DidNotHold:
    """Withdraws the effect with the smallest held-out gain."""
    rest = {t.effect.key: rms(predict(held, fit_without(columns, chosen, t, declared))) for t in added}
    term = min(added, key=lambda t: rest[t.effect.key])
    effect, gain = term.effect, 1.0 - rms(predict(held, chosen)) / max(rest[term.effect.key], 1e-300)
    return DidNotHold(effect.key, effect.id, effect.title, objection, gain)


def _objection(
    columns: Columns,
    held: Columns,
    chosen: Fit,
    term: Term,
    declared: Sequence[Term],
    context: Context,
    floor: float,
) -> DidNotHold | None:
    rest = fit_without(columns, chosen, term, declared)
    with_it, without_it = predict(held, chosen), predict(held, rest)
    gain = 1.0 - rms(with_it) / max(rms(without_it), 1e-300)
    objection = (
        objection_to_values(chosen, term, context, columns)
        or looks_like_known_load(chosen, term, columns)
        or _within_wander(columns, chosen, rest)
        or _within_jumps(columns, chosen, rest, floor)
        or _training_run_against(columns, chosen, term, rest, floor)
        or heldout_against(held.samples, without_it, with_it, floor)
    )
    if objection is None:
        return None
    return DidNotHold(term.effect.key, term.effect.id, term.effect.title, objection, gain)


def _within_wander(columns: Columns, chosen: Fit, rest: Fit) -> LevelWithinWander | None:
    """That an effect is a level which the wander of the residual may have put there."""
    without_it, with_it = (columns.target - columns.design(f.terms) @ f.beta for f in (rest, chosen))
    ratio = level_over_wander(without_it - with_it, with_it, columns.samples.run, columns.samples.block)
    return LevelWithinWander(ratio, LEAST_OVER_WANDER) if ratio < LEAST_OVER_WANDER else None


def _within_jumps(columns: Columns, chosen: Fit, rest: Fit, floor: float) -> WithinJumps | None:
    """That an effect explains what a torque on a slower clock lacks."""
    without_it, with_it = (columns.target - columns.design(f.terms) @ f.beta for f in (rest, chosen))
    return within_jumps(columns.samples, without_it, with_it, chosen.gain, floor)


def _training_run_against(
    columns: Columns, chosen: Fit, term: Term, rest: Fit, floor: float
) -> TrainingRunAgainst | None:
    """The training run that speaks against an effect; noise that the effect lets through is no error of it."""
    samples = columns.samples
    count = np.unique(samples.run).size
    if count < 2:
        return None  # the cross-validated gain in block resamples is a condition of the search
    if count < FEW_RUNS:
        without_it = columns.target - columns.design(rest.terms) @ rest.beta
        with_it = exchanged(columns, chosen, term)
    else:
        without_it, with_it = (left_out(columns, f.terms) for f in (rest, chosen))
    gain = columns.gain or chosen.gain
    weights = (gain * columns.noise_ratio(f.beta, f.terms) for f in (rest, chosen))
    before, after = (weight * left for weight, left in zip(weights, (without_it, with_it), strict=True))
    run = speaks_against(samples, before, after, floor)
    return TrainingRunAgainst(run) if run else None


def exchanged(columns: Columns, chosen: Fit, term: Term) -> FloatArray:
    """Residual (N,) [N m] of every training run with one effect's coefficients from the other runs.

        theta_r = argmin sum_(k not in r) (e_k + phi_k (theta - theta_fit))^2 + w sum_k (phi_k (theta - theta_fit))^2

    with the residual e of the fit. A small w leaves a level of a curve that the other runs do not reach as fitted. Two
    short runs identify no whole model each, but an effect beside the model of both.

    Args:
        columns: Training rows.
        chosen: Fitted to them.
        term: One of its effects.
    """
    left = columns.target - columns.design(chosen.terms) @ chosen.beta
    theta = next(theta for t, theta in coefficients_by_term(chosen.terms, chosen.beta) if t is term)
    if theta.size == 0:
        return left
    mine, run = columns.of(term), columns.samples.run
    held = KEPT_OF_FIT * mine.T @ mine + 1e-12 * np.trace(mine.T @ mine) * np.eye(theta.size)
    out = left.copy()
    for r in np.unique(run):
        rows, others = run == r, run != r
        gram = mine[others].T @ mine[others] + held
        change = -np.linalg.solve(gram, mine[others].T @ left[others])  # the residual holds + phi theta
        out[rows] += mine[rows] @ change
    return out


def left_out(columns: Columns, terms: Sequence[Term]) -> FloatArray:
    """Residual (N,) [N m] of every training run, predicted from the other runs; shapes stay as they are."""
    x, z, run = columns.design(terms), columns.target, columns.samples.run
    runs = np.unique(run)
    grams = {r: x[run == r].T @ x[run == r] for r in runs}
    moments = {r: x[run == r].T @ z[run == r] for r in runs}
    low, high = bounds_of(terms, columns.declared_gain)
    total, moment = columns.prior(terms).added(sum(grams.values()), sum(moments.values()))
    out = np.empty_like(z)
    for r in runs:
        beta = solve_bounded(total - grams[r], moment - moments[r], low, high)
        out[run == r] = z[run == r] - x[run == r] @ beta
    return out
