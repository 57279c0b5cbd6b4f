"""The main job for one joint: declared model, residual, missing effects, refit, errors before and after, verdict."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from drake_tc.diagnosis.ceiling import StructureOptions, judge
from drake_tc.diagnosis.design import Columns, Fit, Term, fit, predict
from drake_tc.diagnosis.estimates import estimates
from drake_tc.diagnosis.evidence import better_share, compare
from drake_tc.diagnosis.experiments import next_experiment
from drake_tc.diagnosis.prepared import Prepared, prepare_joint
from drake_tc.diagnosis.result import (
    Errors,
    FoundEffect,
    JointResult,
    RejectedEffect,
    Side,
    Unexplained,
    Verdict,
)
from drake_tc.diagnosis.search import Progress, Search, SearchOptions, best_shape, candidates, search
from drake_tc.diagnosis.ties import indistinguishable
from drake_tc.effects.base import EFFORT_UNIT, Context, TransmissionEffect
from drake_tc.effects.elasticity import Elasticity
from drake_tc.effects.library import LIBRARY
from drake_tc.effects.torque_sensor_bias import TorqueSensorBias
from drake_tc.effects.torque_sensor_drift import TorqueSensorDrift
from drake_tc.effects.torque_sensor_gain import TorqueSensorGain
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray


@dataclass(frozen=True)
class DiagnosisOptions:
    """Thresholds of the search and of the judgement of what is left; `seed` for resampling.

    `judged`: whether what is left is judged at all, which costs more than all the rest; False calls nothing structured.
    """

    search: SearchOptions = field(default_factory=SearchOptions)
    structure: StructureOptions = field(default_factory=StructureOptions)
    seed: int = 0
    judged: bool = True


SETTLING_ROUNDS = 4
SOFTER = 0.97
SCOUT_SAMPLES = 200_000


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@dataclass(frozen=True)
class Stage:
    """One search: what it looked at and what it found."""

    prepared: Prepared
    scout: Columns
    obstacles: tuple[tuple[str, str], ...]
    found: Search


def _looked_for(prepared: Prepared, options: DiagnosisOptions, progress: Progress) -> Stage:
    usable, obstacles = candidates(LIBRARY, prepared.context, prepared.declared)
    scout = columns = prepared.train
    if len(columns.samples.signals) > SCOUT_SAMPLES:
        scout = Columns(columns.samples.scout(SCOUT_SAMPLES), columns.gain, columns.floor)
    found = search(scout, prepared.terms, usable, prepared.context, prepared.floor, options.search, progress)
    return Stage(prepared, scout, tuple(obstacles), found)


def _has_elasticity(found: Search) -> bool:
    return any(isinstance(t.effect, Elasticity) for t in found.chosen.terms)


def _wind_up(stage: Stage) -> float:
    """The compliance [rad/(N m)] of a gear that may wind up between the servo's encoder and the logged one, or 0.

    Elasticity and a torque sensor that reads too little scale the load alike. They differ in when the motor sticks:
    under a soft gear the link still moves. So when either was found, the rows are chosen anew as a soft gear has them.
    """
    gain = next((t for t in stage.found.chosen.terms if isinstance(t.effect, TorqueSensorGain)), None)
    if gain is None and not _has_elasticity(stage.found):
        return 0.0
    soft = Elasticity()
    if soft.obstacle(stage.prepared.context):
        return 0.0
    tried = fit(stage.scout, [*stage.found.baseline.terms, Term(soft)])
    return soft.physical(tried.beta[-2:], {}, tried.gain)["compliance"]


def diagnose_joint(
    train_runs: Sequence[Run],
    held_runs: Sequence[Run],
    rig: Rig,
    joint: str,
    options: DiagnosisOptions,
    progress: Progress = lambda text, share: None,
) -> JointResult:
    """Diagnose one joint. The held-out runs are looked at only after every choice is made.

    Raises:
        IdentificationError: the training runs cannot identify even the declared model.
    """
    progress("filtering", 0.0)
    stage = _looked_for(prepare_joint(train_runs, held_runs, rig, joint), options, progress)
    compliance = _wind_up(stage)
    if compliance > 0.0:
        soft = _looked_for(prepare_joint(train_runs, held_runs, rig, joint, compliance), options, progress)
        if _has_elasticity(soft.found) and soft.found.chosen.cv_rms < SOFTER * stage.found.chosen.cv_rms:
            stage = soft
    prepared, scout, found, obstacles = stage.prepared, stage.scout, stage.found, stage.obstacles
    columns, held_columns, context, floor = prepared.train, prepared.held, prepared.context, prepared.floor
    ties = indistinguishable(scout, found, context)
    stability = stabilities(found, options.seed)
    if scout is not columns:
        found = replace(found, baseline=fit(columns, found.baseline.terms), chosen=fit(columns, found.chosen.terms))
    before_residual = predict(held_columns, found.baseline)
    columns, held_columns, found = _settled(columns, held_columns, found, context)
    progress("judging", 0.0)
    after_residual = predict(held_columns, found.chosen)
    sides = (
        Side(columns.samples, found.baseline.residual, found.chosen.residual),
        Side(held_columns.samples, before_residual, after_residual),
    )
    unexplained = Unexplained(0.0, False, ())
    if options.judged:
        unexplained = judge(*sides, floor, _structure_options(options.structure, found), options.seed)
    effects = _found_effects(columns, held_columns, found, context, stability)
    verdict: Verdict = "effects_found" if effects else "no_missing_effect"
    if unexplained.structured:
        verdict = "unexplained_structure"
    before = estimates(columns, found.baseline, context.drive)
    after = estimates(columns, found.chosen, context.drive)
    return JointResult(
        joint=joint,
        drive=context.drive,
        unit=EFFORT_UNIT[context.drive],
        baseline=found.baseline,
        final=found.chosen,
        baseline_parameters=before,
        final_parameters=after,
        noise_floor=floor,
        before=Errors(found.baseline.rms, _rms(before_residual), None),
        after=Errors(found.chosen.rms, _rms(after_residual), None),
        effects=effects,
        rejected=_rejected(columns, held_columns, found, context, options.search, obstacles, floor),
        indistinguishable=ties,
        next_experiment=next_experiment(ties, unexplained, obstacles),
        unexplained=unexplained,
        verdict=verdict,
        train=sides[0],
        heldout=sides[1],
        notes=(*columns.samples.notes, *held_columns.samples.notes),
    )


def _settled(columns: Columns, held: Columns, found: Search, context: Context) -> tuple[Columns, Columns, Search]:
    """The same with columns that know the final model: some effects act through its stiffness and damping."""
    servo = context.drive == "position_servo"
    chosen, first = found.chosen, (columns, held)
    for _ in range(SETTLING_ROUNDS if len(chosen.terms) > len(found.baseline.terms) else 0):
        columns, held = (c.with_model(chosen.beta, servo=servo, true_torque=true_torque(c, chosen)) for c in first)
        chosen = fit(columns, chosen.terms)
    return columns, held, replace(found, chosen=chosen)


def true_torque(columns: Columns, fitted: Fit) -> FloatArray:
    """The measured load (T,) without the additive sensor errors among the fit's terms."""
    signals, at = columns.samples.signals, 1
    for term in fitted.terms:
        theta = fitted.beta[at : at + len(term.effect.coefficients)]
        at += theta.size
        if isinstance(term.effect, TorqueSensorBias | TorqueSensorDrift):
            signals = term.effect.restore(signals, term.effect.physical(theta, term.shape, fitted.gain))
    return signals.load_torque


def _structure_options(options: StructureOptions, found: Search) -> StructureOptions:
    """A gear's play or softness is modelled at rest only: three times as much may be left of what it explains."""
    if any(isinstance(t.effect, TransmissionEffect) for t in found.chosen.terms):
        return replace(options, least_of_before=3.0 * options.least_of_before)
    return options


def stabilities(found: Search, seed: int) -> dict[str, float]:
    """For each effect: share of block resamples in which the chosen set beats every rival set without it."""
    out = {}
    for term in found.chosen.terms:
        rivals = [r for r in (found.baseline, *found.rivals) if term.effect.id not in {t.effect.id for t in r.terms}]
        out[term.effect.key] = min((better_share(r, found.chosen, seed) for r in rivals), default=1.0)
    return out


def _found_effects(
    columns: Columns, held: Columns, found: Search, context: Context, stability: Mapping[str, float]
) -> tuple[FoundEffect, ...]:
    parameters = estimates(columns, found.chosen, context.drive)
    with_all = _rms(predict(held, found.chosen))
    known = {t.effect.key for t in found.baseline.terms}
    out = []
    for term in found.chosen.terms:
        if term.effect.key in known:
            continue
        rest = fit(columns, [t for t in found.chosen.terms if t is not term])
        residual = predict(held, rest)
        out.append(
            FoundEffect(
                key=term.effect.key,
                id=term.effect.id,
                title=term.effect.title,
                parameters=parameters[term.effect.key],
                heldout_gain=1.0 - with_all / max(_rms(residual), 1e-300),
                stability=stability[term.effect.key],
                contribution=_rms(predict(held, found.chosen) - residual),
            )
        )
    return tuple(sorted(out, key=lambda e: -e.heldout_gain))


def _rejected(
    columns: Columns,
    held: Columns,
    found: Search,
    context: Context,
    options: SearchOptions,
    obstacles: Sequence[tuple[str, str]],
    floor: float,
) -> tuple[RejectedEffect, ...]:
    """Every other effect, tried on top of the final model."""
    chosen = {t.effect.id for t in found.chosen.terms}
    base = _rms(predict(held, found.chosen))
    best: dict[str, RejectedEffect] = {}
    usable, _ = candidates(LIBRARY, context, sorted(chosen | set(context.declared)))
    for member in usable:
        tried = best_shape(columns, found.chosen.terms, member, context, found.chosen.residual)
        comparison = compare(found.chosen, tried, columns.samples)
        gain = 1.0 - _rms(predict(held, tried)) / base
        if comparison.gain < options.least_gain:
            drop, least = 100 * comparison.gain, 100 * options.least_gain
            why = f"lowers the cross-validated error by {drop:.1f} %, below {least:g} %"
        elif comparison.removed < options.least_removed * floor:
            why = "explains less than the sensors resolve"
        elif comparison.share < options.least_share:
            why = f"helps in {100 * comparison.share:.0f} % of the resamples only"
        else:
            why = "small beside what the chosen effects explain: more likely their imperfect form"
        entry = RejectedEffect(member.key, member.id, gain, comparison.gain, why)
        if member.id not in best or entry.train_gain > best[member.id].train_gain:
            best[member.id] = entry
    for key, obstacle in obstacles:
        name = key.split(".")[0]
        if name not in best and name not in chosen:
            best[name] = RejectedEffect(key, name, 0.0, 0.0, f"cannot be looked for here: {obstacle}")
    return tuple(sorted(best.values(), key=lambda r: -r.train_gain))
