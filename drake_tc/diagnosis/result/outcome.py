"""What became of each effect: found, with its parameters and gains, or tried and not added."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.estimates import Estimate
from drake_tc.diagnosis.problem.regression import Fit, fit_without, predict
from drake_tc.diagnosis.result.joint_result import FoundEffect, RejectedEffect, Rejection
from drake_tc.diagnosis.root_mean_square import rms
from drake_tc.diagnosis.selection.comparison import Comparison, explained_by
from drake_tc.diagnosis.selection.engine import compare
from drake_tc.diagnosis.selection.joint_problem import (
    JointProblem,
    Search,
    best_shape,
    candidates,
    share_better,
)
from drake_tc.diagnosis.thresholds import JOINT, UNTESTED_EFFORT, SearchThresholds
from drake_tc.effects.base import Context, Effect
from drake_tc.effects.library import looked_for
from drake_tc.effects.obstacle import Obstacle
from drake_tc.types import FloatArray


def stabilities(found: Search, seed: int) -> dict[str, float]:
    """For each effect: share of block resamples in which no set without it is better by more than 2 %.

    2 % is the difference below which the search takes the simpler set.
    """
    out = {}
    same = 1.0 + JOINT.same
    for term in found.chosen.terms:
        without = [
            fitted
            for fitted in (found.baseline, *found.alternatives)
            if term.effect.id not in {t.effect.id for t in fitted.terms}
        ]
        shares = [share_better(replace(f, block_sse=same**2 * f.block_sse), found.chosen, seed) for f in without]
        out[term.effect.key] = min(shares, default=1.0)
    return out


def found_effects(
    columns: Columns,
    held: Columns,
    chosen: Fit,
    declared: Sequence[Term],
    parameters: Mapping[str, Mapping[str, Estimate]],
    stability: Mapping[str, float],
) -> tuple[FoundEffect, ...]:
    """The effects of the final model that the declared one lacks, by held-out gain."""
    after, known = predict(held, chosen), {t.effect.key for t in declared}
    out = []
    for term in chosen.terms:
        if term.effect.key in known:
            continue
        residual = predict(held, fit_without(columns, chosen, term, declared))
        out.append(
            FoundEffect(
                key=term.effect.key,
                id=term.effect.id,
                title=term.effect.title,
                parameters=parameters[term.effect.key],
                heldout_gain=1.0 - rms(after) / max(rms(residual), 1e-300),
                stability=stability[term.effect.key],
                contribution=rms(after - residual),
            )
        )
    return tuple(sorted(out, key=lambda e: -e.heldout_gain))


def rejected_effects(
    columns: Columns,
    held: Columns,
    chosen: Fit,
    context: Context,
    thresholds: SearchThresholds,
    obstacles: Sequence[tuple[str, Obstacle]],
    floor: float,
    effects: Sequence[Effect] | None = None,
    baseline: Fit | None = None,
    withdrawn: Collection[str] = (),
) -> tuple[RejectedEffect, ...]:
    """Every other effect (of `effects` where they are given), tried on top of the final model.

    Args:
        columns: Training rows.
        held: Held-out rows.
        chosen: The final model.
        context: What the logs offer.
        thresholds: Of the search.
        obstacles: (key, what stands in the way) of effects that cannot be looked for.
        floor: Noise floor [effort].
        effects: Which are tried; None for the library.
        baseline: The declared model, where it is not the final one.
        withdrawn: Ids of effects that the search chose and that did not hold.
    """
    taken = {t.effect.id for t in chosen.terms}
    base = rms(predict(held, chosen))
    best: dict[str, RejectedEffect] = {}
    usable, _ = candidates(looked_for(context, effects), context, sorted(taken | set(context.declared)))
    problem = JointProblem(columns, usable, context, frozenset(), floor)
    explained = explained_by(problem.errors(chosen if baseline is None else baseline), problem.errors(chosen))
    for member in usable:
        tried = best_shape(columns, chosen, member, context, problem.screen)
        comparison = compare(problem, chosen, tried)
        train_gain = float(comparison.gain[0])
        gain = 1.0 - rms(predict(held, tried)) / base
        reason = _reason(comparison, problem, explained, thresholds)
        if reason == "too_little_gain" and member.id == "saturation" and _faster(columns, held):
            reason = "untested"
        elif member.id in withdrawn:
            reason = "withdrawn"
        entry = RejectedEffect(
            member.key,
            member.id,
            gain,
            train_gain,
            reason,
            share=comparison.share,
            least_gain=thresholds.least_gain,
        )
        if member.id not in best or entry.train_gain > best[member.id].train_gain:
            best[member.id] = entry
    for key, obstacle in obstacles:
        name = key.split(".")[0]
        if name not in best and name not in taken:
            best[name] = RejectedEffect(key, name, 0.0, 0.0, obstacle.reason, obstacle.statement)
    return tuple(sorted(best.values(), key=lambda r: -r.train_gain))


def _reason(
    comparison: Comparison, problem: JointProblem, explained: FloatArray, thresholds: SearchThresholds
) -> Rejection:
    """The first condition of an improvement that an effect of this comparison does not meet."""
    if comparison.gain[0] < thresholds.least_gain:
        return "too_little_gain"
    if comparison.removed[0] < thresholds.least_removed * problem.floor[0]:
        return "below_floor"
    if comparison.share < thresholds.least_share:
        return "unstable"
    if comparison.log_evidence.sum() < thresholds.least_log_evidence:
        return "too_little_evidence"
    return "not_chosen" if comparison.is_real(problem.floor, explained, thresholds) else "imperfect_form"


def _faster(columns: Columns, held: Columns) -> bool:
    """Whether the held-out runs ask for clearly more effort than the training runs ever did."""
    largest = [float(np.percentile(np.abs(c.samples.signals.effort[c.samples.rows]), 99.9)) for c in (columns, held)]
    return largest[1] > UNTESTED_EFFORT * largest[0]
