"""The main job for one joint, from top to bottom: declared model, missing effects, what is left, verdict."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from drake_tc.diagnosis.ages import with_uncertain_ages
from drake_tc.diagnosis.data.channels import notes_of_joint
from drake_tc.diagnosis.data.preparation import load_scale
from drake_tc.diagnosis.data.samples import rms
from drake_tc.diagnosis.evidence import Evidence, Scored
from drake_tc.diagnosis.held_out import confirmed, timing_holds
from drake_tc.diagnosis.intervals import correlated_parameters, friction_spread, of_runs, parameters_of
from drake_tc.diagnosis.linear import Prior
from drake_tc.diagnosis.model import JointModel
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.priors import (
    ALTERNATIVE,
    CANNOT_TELL,
    DECLARED_CONTRIBUTION,
    NAMED_FLOORS,
    TAKEN_OVER,
)
from drake_tc.diagnosis.problem.columns import Term, coefficients_by_term
from drake_tc.diagnosis.problem.declared import known_values
from drake_tc.diagnosis.problem.parameters import plausible_ranges
from drake_tc.diagnosis.problem.prepared import Prepared, errors_in_joint_units, prepare_joint
from drake_tc.diagnosis.problem.regression import Fit, fit, noise_floor
from drake_tc.diagnosis.residual.over_time import shared_band
from drake_tc.diagnosis.residual.unexplained import DataSplit, next_experiment
from drake_tc.diagnosis.residual.verdict import verdict_of, visible_share, what_is_left
from drake_tc.diagnosis.result.errors import run_errors, without_rows
from drake_tc.diagnosis.result.joint_result import (
    DidNotHold,
    Errors,
    FoundEffect,
    JointResult,
    RejectedEffect,
    Rejection,
    Withdrawal,
)
from drake_tc.diagnosis.search import (
    Found,
    Progress,
    Sets,
    find,
    possible,
    pruned,
    settled_if_sound,
    why_impossible,
    worth,
)
from drake_tc.diagnosis.split import Split, with_needed
from drake_tc.effects.base import Context, Effect
from drake_tc.effects.context import Obstacle
from drake_tc.effects.library import looked_for, uncommon
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig


@errors_in_joint_units
def diagnose_joint(
    train_runs: Sequence[Run],
    held_runs: Sequence[Run],
    rig: Rig,
    joint: str,
    options: DiagnosisOptions,
    progress: Progress = lambda text, share: None,
    executor: Executor | None = None,
) -> JointResult:
    """Diagnose one joint. The held-out runs are looked at only after every choice is made.

    Args:
        train_runs: To fit.
        held_runs: Held-out runs.
        rig: Says drive, load and what is declared.
        joint: Which.
        options: What to do otherwise.
        progress: Told how far it is.
        executor: Assesses what is left in its workers; None does it here.

    Raises:
        IdentificationError: the training runs cannot identify even the declared model.
    """
    progress("filtering", 0.0)
    prepared = prepare_joint(train_runs, held_runs, rig, joint, command_held=options.command_held)
    model = joint_model(prepared)
    asked = asked_of(prepared, options)
    found = find(Evidence(model).heard(model.declared, spread=False), asked.usable, progress)
    return joint_result(decided(found, asked.usable), asked, rig, joint, options, progress, executor)


@dataclass(frozen=True)
class Asked:
    """Effects that are looked for, and of the others the key and what stands in the way."""

    usable: Sequence[Effect]
    obstacles: Sequence[tuple[str, Obstacle]]


def candidates(
    library: Sequence[Effect], context: Context, declared: Sequence[str]
) -> tuple[list[Effect], list[tuple[str, Obstacle]]]:
    """Effects that can be looked for, and of the others the key and what stands in the way."""
    usable, obstacles = [], []
    for effect in library:
        if effect.id in declared:
            continue
        obstacle = effect.unavailable(context)
        if obstacle is None:
            usable.append(effect)
        else:
            obstacles.append((effect.key, obstacle))
    return usable, obstacles


@dataclass(frozen=True, eq=False)
class Decided:
    """A search's result after all decisions.

    Attributes:
        found: What the search found; its evidence is that of the set.
        best: The set.
        dropped: Terms that did not hold, and why.
        floor: Noise floor [effort].
        tried: What other effects would be worth beside the set.
    """

    found: Found
    best: Scored
    dropped: tuple[tuple[Term, Withdrawal], ...]
    floor: float
    tried: tuple[RejectedEffect, ...] = ()


def asked_of(prepared: Prepared, options: DiagnosisOptions) -> Asked:
    """What is looked for in a joint."""
    context = prepared.context
    rare = uncommon(context) if options.effects is None else ()
    return Asked(*candidates([*looked_for(context, options.effects), *rare], context, prepared.declared))


def decided(found: Found, effects: Sequence[Effect]) -> Decided:
    """The most probable set whose effects all hold, and beside which none of the other `effects` does."""
    decision, gone = _held(found), dict[str, tuple[Term, Withdrawal]]()
    while True:
        gone |= {term.effect.key: (term, why) for term, why in decision.dropped}
        named = {t.effect.id for t in decision.best.terms}
        others = [e for e in effects if e.id not in named and e.key not in gone]
        more, tried = _beside(decision, others, gone)
        if more is None:
            dropped = tuple(each for each in gone.values() if each[0].effect.id not in named)
            return replace(decision, dropped=dropped, tried=tried)
        decision = more


def _beside(
    decision: Decided, effects: Sequence[Effect], gone: dict[str, tuple[Term, Withdrawal]]
) -> tuple[Decided | None, tuple[RejectedEffect, ...]]:
    """What holds of the set with an effect more that is asked for beside it, and the effects that are not asked for.

    Either this effect does, or beside it one of the set does not. `gone` takes effects that are asked for and do not
    hold.
    """
    evidence, best = decision.found.evidence, decision.best
    sets, residual = Sets(evidence, effects), evidence.residual(evidence.model.train, best)
    left, tried = rms(evidence.residual(evidence.model.held, best)), []
    each = [(effect, *worth(evidence, best, sets.best_start(best, effect, residual)[1])) for effect in effects]
    for effect, larger, odds in sorted(each, key=lambda one: -one[2]):
        impossible = odds >= ALTERNATIVE and not possible(*larger)
        if odds >= ALTERNATIVE and not impossible:
            held = _held(Found(*larger, ()))
            dropped = {t.effect.key for t, _ in held.dropped}
            if effect.key in held.best.ids or dropped & best.ids:
                return held, ()
            gone |= {t.effect.key: (t, why) for t, why in held.dropped if t.effect.key == effect.key}
        if effect.key not in gone:
            gain = 1.0 - rms(larger[0].residual(larger[0].model.held, larger[1])) / max(left, 1e-300)
            reason: Rejection = "not_possible" if impossible else "too_little_evidence"
            why = why_impossible(*larger).rstrip(".") if impossible else ""
            tried.append(RejectedEffect(effect.key, effect.id, reason, why, odds, gain))
    return None, tuple(tried)


def _held(found: Found) -> Decided:
    """The set without effects that do not hold, and without those that are too small."""
    evidence, best = pruned(found.evidence, found.best)
    without, noisy = timing_holds(evidence, best)
    if noisy:
        evidence, best = pruned(*settled_if_sound(evidence, without))
    without, dropped = confirmed(evidence, best)
    if dropped:
        evidence, best = pruned(*settled_if_sound(evidence, without))
    floor = noise_floor(evidence.model.train.recorded, _fit(evidence, evidence.model.train, best))
    without, small = _large_enough(evidence, best, floor)
    if small:
        evidence, best = settled_if_sound(evidence, without)
    why: dict[Withdrawal, Sequence[Term]] = {
        "noise_of_one_channel": noisy,
        "worse_on_held_out": dropped,
        "below_floor": small,
    }
    return Decided(
        replace(found, evidence=evidence),
        best,
        tuple((term, word) for word, terms in why.items() for term in terms),
        floor,
    )


def joint_result(
    decision: Decided,
    asked: Asked,
    rig: Rig,
    joint: str,
    options: DiagnosisOptions,
    progress: Progress = lambda text, share: None,
    executor: Executor | None = None,
) -> JointResult:
    """What is told of a joint after its search, and what is left."""
    found, (evidence, best) = decision.found, without_attenuation(decision)
    model = evidence.model
    context = model.context
    floor = rms(model.train.as_recorded(best.terms, np.full(model.train.samples.rows.size, decision.floor)))
    plain = evidence.refined(evidence.score(model.declared))
    declared = with_uncertain_ages(evidence, plain, evidence.corrected(plain))
    progress("what is left", 0.9)
    baseline, chosen = (_fit(evidence, model.train, s) for s in (declared, best))
    spread = friction_spread(evidence, best)
    splits = (
        _split(evidence, model.train, declared, best, spread),
        _split(evidence, model.held, declared, best, spread),
    )
    unexplained, floor, notes = what_is_left(splits, chosen, floor, context, options, executor)
    effects = _effects(evidence, best, found)
    visible = visible_share(evidence, best, decision.floor)
    verdict = verdict_of(unexplained, found=bool(effects))
    if verdict == "no_missing_effect" and visible > CANNOT_TELL:
        verdict = "cannot_tell"
    alternatives = _indistinguishable(found, best)
    parameters, correlation = correlated_parameters(evidence, best)
    return JointResult(
        joint=joint,
        drive=context.drive,
        unit=context.units.effort,
        units=model.train.samples.units,
        baseline=baseline,
        final=chosen,
        baseline_parameters=parameters_of(evidence, declared),
        final_parameters=parameters,
        correlation=correlation,
        run_spread=evidence.spread.friction,
        noise_floor=floor,
        before=Errors(rms(splits[0].before), rms(splits[1].before), None),
        after=Errors(rms(splits[0].after), rms(splits[1].after), None),
        effects=effects,
        rejected=_rejected(decision, asked),
        indistinguishable=alternatives,
        next_experiment=next_experiment(alternatives, unexplained, among_joints=len(rig.joints) > 1),
        unexplained=unexplained,
        verdict=verdict,
        train=splits[0],
        heldout=splits[1],
        held=known_values(rig, joint),
        did_not_hold=_did_not_hold(decision.dropped),
        runs=tuple(run_errors(splits)),
        plausible=plausible_ranges(chosen, context),
        shared_band=shared_band(*splits),
        load_notes=load_scale(rig, joint).notes,
        notes=(
            *load_scale(rig, joint).notes,
            *notes_of_joint((*model.train.samples.notes, *model.held.samples.notes), joint, rig.joints),
            *notes,
            *without_rows((model.train.samples, model.held.samples)),
        ),
    )


def joint_model(prepared: Prepared) -> JointModel:
    """The joint's model, its needed effort that of the declared fit."""
    columns = prepared.train
    plain = fit(prepared.train, prepared.terms)
    measured = prepared.context.load == "torque"
    most = DECLARED_CONTRIBUTION * rms(columns.effort(())) / max(rms(columns.target), 1e-300)
    beta = plain.beta * max(1.0, 1.0 / (most * float(plain.beta[0])))  # a fit without a drive gain has 1/K = 0
    train, held = (with_needed(c, plain.terms, beta, measured=measured) for c in (columns, prepared.held))
    size = {t.effect.key: float(v[0]) for t, v in coefficients_by_term(plain.terms, beta) if v.size}
    return JointModel(
        train,
        held,
        prepared.terms,
        prepared.context,
        columns.declared_gain,
        1.0 / float(beta[0]),
        max(size.get("coulomb", 0.0), 0.0),
        max(size.get("viscous", 0.0), 0.0),
    )


def without_attenuation(decision: Decided) -> tuple[Evidence, Scored]:
    """The set without what noise takes off its coefficients, linearised there where it is as probable there.

    The ages of channels are uncertain. The set itself where what is left of it is physically impossible.
    """
    evidence, best = decision.found.evidence, decision.best
    first = evidence.corrected(best)
    if first is not best:
        there = Evidence(evidence.relinearised(first), evidence.noise, evidence.spread)
        moved = there.refined(there.score(best.terms))
        if moved.log_odds > best.log_odds - ALTERNATIVE:
            evidence, best, first = there, moved, there.corrected(moved)
    for each in (with_uncertain_ages(evidence, best, first), first):
        if possible(evidence, each):
            return evidence, each
    return decision.found.evidence, decision.best


def _fit(evidence: Evidence, split: Split, scored: Scored) -> Fit:
    residual = evidence.residual(split, scored)
    return Fit(scored.terms, scored.beta, residual, rms(residual), rms(residual), np.zeros(1))


def _split(evidence: Evidence, split: Split, before: Scored, after: Scored, spread: float) -> DataSplit:
    residuals = [evidence.residual(split, s) for s in (before, after)]
    first, second = (split.as_recorded(s.terms, r) for s, r in zip((before, after), residuals, strict=True))
    own = split.as_recorded(after.terms, of_runs(evidence, split, after, residuals[1], spread))
    return DataSplit(split.recorded.samples, first, second, of_runs=own)


def _large_enough(evidence: Evidence, scored: Scored, floor: float) -> tuple[Scored, tuple[Term, ...]]:
    """The set without effects that contribute less than half a noise floor to training and to held-out rows."""
    small: list[Term] = []
    model = evidence.model
    while True:
        each = [contributions(evidence, split, scored) for split in (model.train, model.held)]
        sizes = [max(train, held) for (_, train), (_, held) in zip(*each, strict=True)]
        if not sizes or min(sizes) >= NAMED_FLOORS * floor:
            return scored, tuple(small)
        worst = each[0][int(np.argmin(sizes))][0]
        small.append(worst)
        scored = evidence.refined(evidence.score([t for t in scored.terms if t is not worst]))


def contributions(evidence: Evidence, split: Split, scored: Scored) -> list[tuple[Term, float]]:
    """RMS [effort] of what each asked effect adds that the other terms do not take over, see `TAKEN_OVER`."""
    model, out = evidence.model, []
    for term in scored.terms:
        if model.is_declared(term.effect):
            continue
        rest = [t for t in scored.terms if t is not term]
        blocks = model.blocks(split, rest)
        prior = Prior.stacked([block.prior for block in blocks])
        values = np.concatenate([block.values for block in blocks], axis=1)
        whole = np.concatenate([block.values for block in model.blocks(split, scored.terms)], axis=1) @ scored.b
        added = whole - split.target(scored.terms) + split.target(rest) - values @ prior.mean
        columns = values * prior.deviation
        turn, root = np.linalg.qr(columns)
        taken = lsq_linear(root, turn.T @ added, (-TAKEN_OVER, TAKEN_OVER)).x
        out.append((term, rms(added - columns @ taken)))
    return out


def _effects(evidence: Evidence, best: Scored, found: Found) -> tuple[FoundEffect, ...]:
    held = evidence.model.held
    after, named = evidence.residual(held, best), parameters_of(evidence, best)
    sizes = {t.effect.key: size for t, size in contributions(evidence, held, best)}
    out = []
    for term in best.terms:
        if evidence.model.is_declared(term.effect):
            continue
        rest = evidence.score([t for t in best.terms if t is not term])
        gain = 1.0 - rms(after) / max(rms(evidence.residual(held, rest)), 1e-300)
        odds = best.log_odds - evidence.refined(rest).log_odds
        out.append(
            FoundEffect(
                key=term.effect.key,
                id=term.effect.id,
                title=term.effect.title,
                parameters=named[term.effect.key],
                heldout_gain=gain,
                stability=float(1.0 / (1.0 + np.exp(-np.clip(odds, -50.0, 50.0)))),
                contribution=sizes[term.effect.key],
            )
        )
    return tuple(sorted(out, key=lambda e: -e.heldout_gain))


def _rejected(decision: Decided, asked: Asked) -> tuple[RejectedEffect, ...]:
    """Effects that are neither in the set nor were withdrawn, each id in its most probable form."""
    told = {t.effect.id for t in (*decision.best.terms, *(term for term, _ in decision.dropped))}
    out: dict[str, RejectedEffect] = {}
    for each in sorted(decision.tried, key=lambda tried: -tried.log_odds):
        if each.id not in told:
            out.setdefault(each.id, each)
    for key, obstacle in asked.obstacles:
        name = key.split(".")[0]
        if name not in out and name not in told:
            out[name] = RejectedEffect(key, name, obstacle.reason, obstacle.statement)
    return tuple(out.values())


def _did_not_hold(dropped: Sequence[tuple[Term, Withdrawal]]) -> tuple[DidNotHold, ...]:
    return tuple(DidNotHold(t.effect.key, t.effect.id, t.effect.title, why) for t, why in dropped)


def _indistinguishable(found: Found, best: Scored) -> tuple[tuple[str, str], ...]:
    """Pairs of ids: an effect of the best set, and one that takes its place in a set nearly as probable."""
    out: dict[tuple[str, str], None] = {}
    ids = {t.effect.id for t in best.terms}
    for other in found.alternatives:
        theirs = {t.effect.id for t in other.terms}
        if len(ids - theirs) == 1 and len(theirs - ids) == 1:
            out[next(iter(ids - theirs)), next(iter(theirs - ids))] = None
    return tuple(out)
