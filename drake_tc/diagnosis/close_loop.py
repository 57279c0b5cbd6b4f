"""The main job for one joint: declared model, residual, missing effects, refit, errors before and after, verdict."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from drake_tc.diagnosis.confirmation import confirm
from drake_tc.diagnosis.consistency import consistency
from drake_tc.diagnosis.design import Columns, Fit, Term, fit, predict
from drake_tc.diagnosis.estimates import estimates
from drake_tc.diagnosis.evidence import better_share, compare
from drake_tc.diagnosis.experiments import next_experiment
from drake_tc.diagnosis.noise_colour import correlated_noise
from drake_tc.diagnosis.prepared import Prepared, prepare_joint
from drake_tc.diagnosis.residual_structure import ResidualOptions, assess_residual, features
from drake_tc.diagnosis.result import (
    DataSplit,
    DidNotHold,
    Errors,
    FoundEffect,
    JointResult,
    RejectedEffect,
    Rejection,
    Unexplained,
    Verdict,
)
from drake_tc.diagnosis.run_errors import run_errors
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
    """Thresholds of the search and of the assessment of what is left; `seed` for resampling.

    `assess_residual`: whether what is left is assessed at all, which costs more than all the rest; False calls nothing
    structured.
    """

    search: SearchOptions = field(default_factory=SearchOptions)
    residual: ResidualOptions = field(default_factory=ResidualOptions)
    seed: int = 0
    assess_residual: bool = True


SETTLING_ROUNDS = 4
NOTED = 1.2
"""Noise floor with correlated noise over that without, from which on the report says so."""
UNTESTED_EFFORT = 1.1
"""Largest effort of the held-out runs over that of the training runs, above which a saturation was not tested."""
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

    @property
    def passed_over(self) -> tuple[DidNotHold, ...]:
        """Effects that fitted best and whose values are impossible."""
        return self.found.passed_over


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
    prepared, scout, context = stage.prepared, stage.scout, stage.prepared.context
    ties = indistinguishable(scout, stage.found, context)
    stability = stabilities(stage.found, options.seed)
    found = _refitted(stage)
    known = frozenset(t.effect.key for t in found.baseline.terms)
    confirmed = confirm(
        lambda chosen: _settled(prepared.train, prepared.held, chosen, found.baseline, context),
        found.chosen,
        known,
        context,
        prepared.floor,
    )
    columns, held, chosen = confirmed.train, confirmed.held, confirmed.fit
    progress("what is left", 0.0)
    floor = _floor(columns, chosen)
    splits = _splits(columns, held, found.baseline, chosen)
    unexplained, floor, notes = _unexplained(splits, chosen, floor, context, options)
    effects = _found_effects(columns, held, chosen, known, context, stability)
    kept = {e.id for e in effects}
    ties = tuple(pair for pair in ties if pair[0] in kept)
    return JointResult(
        joint=joint,
        drive=context.drive,
        unit=EFFORT_UNIT[context.drive],
        baseline=found.baseline,
        final=chosen,
        baseline_parameters=estimates(columns, found.baseline, context.drive),
        final_parameters=estimates(columns, chosen, context.drive),
        noise_floor=floor,
        before=Errors(_rms(splits[0].before), _rms(splits[1].before), None),
        after=Errors(_rms(splits[0].after), _rms(splits[1].after), None),
        effects=effects,
        rejected=_rejected(columns, held, found.baseline, chosen, context, options.search, stage.obstacles, floor),
        indistinguishable=ties,
        next_experiment=next_experiment(ties, unexplained, stage.obstacles),
        unexplained=unexplained,
        verdict=verdict_of(unexplained, found=bool(effects)),
        train=splits[0],
        heldout=splits[1],
        did_not_hold=(*stage.passed_over, *confirmed.withdrawn),
        runs=tuple(run_errors(splits)),
        consistency=consistency(columns, chosen),
        notes=(*columns.samples.notes, *held.samples.notes, *notes),
    )


def verdict_of(left: Unexplained, *, found: bool) -> Verdict:
    """The verdict of one joint, which follows from what is left and from whether effects were found."""
    if left.structured:
        return "unexplained_structure"
    if left.excess:
        return "unexplained_residual"
    return "effects_found" if found else "no_missing_effect"


def _refitted(stage: Stage) -> Search:
    """What was found on a subsample, fitted to all training rows."""
    prepared, found = stage.prepared, stage.found
    if stage.scout is prepared.train:
        return found
    baseline, chosen = (fit(prepared.train, f.terms) for f in (found.baseline, found.chosen))
    return replace(found, baseline=baseline, chosen=chosen)


def _floor(columns: Columns, chosen: Fit) -> float:
    """Noise floor [effort] under the final model's coefficients."""
    inertia, at = 0.0, 1
    for term in chosen.terms:
        theta = chosen.beta[at : at + len(term.effect.coefficients)]
        inertia += term.effect.balance_inertia(theta, columns.samples.signals.rotor_inertia)
        at += theta.size
    return chosen.gain * columns.samples.floor.torque(float(chosen.beta[0]), float(chosen.beta[1]), inertia)


def _splits(columns: Columns, held: Columns, baseline: Fit, chosen: Fit) -> tuple[DataSplit, DataSplit]:
    """Residuals before and after on both splits, as effort by the final drive gain."""
    out = []
    for each in (columns, held):
        before, after = ((each.target - each.design(f.terms) @ f.beta) * chosen.gain for f in (baseline, chosen))
        out.append(DataSplit(each.samples, np.asarray(before), np.asarray(after)))
    return out[0], out[1]


def _unexplained(
    splits: tuple[DataSplit, DataSplit], chosen: Fit, floor: float, context: Context, options: DiagnosisOptions
) -> tuple[Unexplained, float, tuple[str, ...]]:
    """What is left, the noise floor [effort] with correlated noise of the torque sensor in it, and notes."""
    if not options.assess_residual:
        return Unexplained(0.0, 0.0, False, 0.0, 0.0, False, ()), floor, ()
    servo = context.drive == "position_servo"
    x = (features(splits[0].samples, chosen.beta, servo=servo), features(splits[1].samples, chosen.beta, servo=servo))
    thresholds = _residual_options(options.residual, chosen)
    left = assess_residual(*splits, x, floor, thresholds, options.seed)
    if left.structured or context.load != "torque":
        return left, floor, ()
    noise = [correlated_noise(s.samples, s.after / chosen.gain) for s in splits]
    levels = [max(floor, n.rms * chosen.gain) if n is not None and n.is_noise else floor for n in noise]
    rms = [_rms(s.after) for s in splits]
    left = left.with_floors(
        rms[1] / levels[1], max(r / f for r, f in zip(rms, levels, strict=True)), thresholds.most_floors
    )
    if levels[1] <= NOTED * floor or noise[1] is None:
        return left, levels[1], ()
    return (
        left,
        levels[1],
        (
            f"The torque noise is correlated over about {1e3 * noise[1].correlation_time:.0f} ms: it leaves "
            f"{levels[1] / floor:.1f} times as much as white noise of the size seen at the highest frequencies.",
        ),
    )


def _settled(
    columns: Columns, held: Columns, chosen: Fit, baseline: Fit, context: Context
) -> tuple[Columns, Columns, Fit]:
    """The fit with columns that know the final model: some effects act through its stiffness and damping."""
    servo, first = context.drive == "position_servo", (columns, held)
    for _ in range(SETTLING_ROUNDS if len(chosen.terms) > len(baseline.terms) else 0):
        columns, held = (c.with_model(chosen.beta, servo=servo, true_torque=true_torque(c, chosen)) for c in first)
        chosen = fit(columns, chosen.terms)
    return columns, held, chosen


def true_torque(columns: Columns, fitted: Fit) -> FloatArray:
    """The measured load (T,) without the additive sensor errors among the fit's terms."""
    signals, at = columns.samples.signals, 1
    for term in fitted.terms:
        theta = fitted.beta[at : at + len(term.effect.coefficients)]
        at += theta.size
        if isinstance(term.effect, TorqueSensorBias | TorqueSensorDrift):
            signals = term.effect.restore(signals, term.effect.physical(theta, term.shape, fitted.gain))
    return signals.load_torque


def _residual_options(options: ResidualOptions, chosen: Fit) -> ResidualOptions:
    """A gear's play or softness is modelled at rest only: three times as much may be left of what it explains."""
    if any(isinstance(t.effect, TransmissionEffect) for t in chosen.terms):
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
    columns: Columns,
    held: Columns,
    chosen: Fit,
    known: frozenset[str],
    context: Context,
    stability: Mapping[str, float],
) -> tuple[FoundEffect, ...]:
    parameters = estimates(columns, chosen, context.drive)
    after = predict(held, chosen)
    out = []
    for term in chosen.terms:
        if term.effect.key in known:
            continue
        residual = predict(held, fit(columns, [t for t in chosen.terms if t is not term]))
        out.append(
            FoundEffect(
                key=term.effect.key,
                id=term.effect.id,
                title=term.effect.title,
                parameters=parameters[term.effect.key],
                heldout_gain=1.0 - _rms(after) / max(_rms(residual), 1e-300),
                stability=stability[term.effect.key],
                contribution=_rms(after - residual),
            )
        )
    return tuple(sorted(out, key=lambda e: -e.heldout_gain))


def _rejected(
    columns: Columns,
    held: Columns,
    baseline: Fit,
    chosen: Fit,
    context: Context,
    options: SearchOptions,
    obstacles: Sequence[tuple[str, str]],
    floor: float,
) -> tuple[RejectedEffect, ...]:
    """Every other effect, tried on top of the final model."""
    taken = {t.effect.id for t in chosen.terms}
    base = _rms(predict(held, chosen))
    best: dict[str, RejectedEffect] = {}
    usable, _ = candidates(LIBRARY, context, sorted(taken | set(context.declared)))
    for member in usable:
        tried = best_shape(columns, chosen.terms, member, context, chosen.residual)
        comparison = compare(chosen, tried, columns.samples)
        gain = 1.0 - _rms(predict(held, tried)) / base
        reason: Rejection = "imperfect_form"
        if comparison.gain < options.least_gain:
            reason = "too_little_gain"
        elif comparison.removed < options.least_removed * floor:
            reason = "below_floor"
        elif comparison.share < options.least_share:
            reason = "unstable"
        if reason == "too_little_gain" and member.id == "saturation" and _faster(columns, held):
            reason = "untested"
        entry = RejectedEffect(member.key, member.id, gain, comparison.gain, reason, share=comparison.share)
        if member.id not in best or entry.train_gain > best[member.id].train_gain:
            best[member.id] = entry
    for key, obstacle in obstacles:
        name = key.split(".")[0]
        if name not in best and name not in taken:
            best[name] = RejectedEffect(key, name, 0.0, 0.0, "cannot_be_looked_for", obstacle)
    return tuple(sorted(best.values(), key=lambda r: -r.train_gain))


def _faster(columns: Columns, held: Columns) -> bool:
    """Whether the held-out runs ask for clearly more effort than the training runs ever did."""
    largest = [float(np.percentile(np.abs(c.samples.signals.effort[c.samples.rows]), 99.9)) for c in (columns, held)]
    return largest[1] > UNTESTED_EFFORT * largest[0]
