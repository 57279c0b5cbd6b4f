"""The main job for one joint: declared model, residual, missing effects, refit, errors before and after, verdict."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial

from drake_tc.diagnosis.data.channels import notes_of_joint
from drake_tc.diagnosis.data.link_prior import LinkPrior
from drake_tc.diagnosis.data.load_scale import load_scale
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.joint_errors import errors_in_joint_units
from drake_tc.diagnosis.notes import ChargedIntegrator, GapCrossings, GearBetweenEncoders, Sticking
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.columns import Columns, coefficients_by_term
from drake_tc.diagnosis.problem.declared import known_values
from drake_tc.diagnosis.problem.drive_gain import at_reverse_regression, require_drive_gain, with_drive_gain
from drake_tc.diagnosis.problem.prepared import Prepared, prepare_joint
from drake_tc.diagnosis.problem.regression import Fit, fit, noise_floor
from drake_tc.diagnosis.problem.sensor_errors import errors_in, weighed
from drake_tc.diagnosis.problem.unknown_load import with_fitted_load
from drake_tc.diagnosis.residual.age_of_command import may_be_age_of_command
from drake_tc.diagnosis.residual.band import shared_band
from drake_tc.diagnosis.residual.unexplained import DataSplit, Unexplained
from drake_tc.diagnosis.residual.verdict import compared, verdict_of, what_is_left
from drake_tc.diagnosis.result.break_away_note import sticking
from drake_tc.diagnosis.result.consistency import consistency, friction_differs, loads_differ
from drake_tc.diagnosis.result.drive_notes import (
    age_note,
    drive_notes,
    gain_note,
    late_note,
    scale_alternatives,
    viscous_age_note,
    zero_of_effort,
)
from drake_tc.diagnosis.result.experiments import next_experiment
from drake_tc.diagnosis.result.gear_note import gear_between_encoders
from drake_tc.diagnosis.result.joint_result import Errors, JointResult
from drake_tc.diagnosis.result.late_command import late_command
from drake_tc.diagnosis.result.outcome import found_effects, rejected_effects, stabilities
from drake_tc.diagnosis.result.plausible_ranges import plausible_ranges
from drake_tc.diagnosis.result.run_errors import run_errors, without_rows
from drake_tc.diagnosis.result.widening import parameters_of
from drake_tc.diagnosis.root_mean_square import rms
from drake_tc.diagnosis.searches import Stage, of_its_gear, searched
from drake_tc.diagnosis.selection.charged_integrator import charged_integrator
from drake_tc.diagnosis.selection.confirmation import confirm
from drake_tc.diagnosis.selection.engine import Progress
from drake_tc.diagnosis.selection.indistinguishable import indistinguishable
from drake_tc.diagnosis.selection.joint_problem import Search
from drake_tc.diagnosis.selection.lag_or_noise import LATE
from drake_tc.diagnosis.selection.recorded_late import position_recorded_late, recorded_late, torque_recorded_late
from drake_tc.diagnosis.selection.sampling_instants import age_of_samples, error_of_age, sampled_late
from drake_tc.diagnosis.timing_notes import UnknownAge
from drake_tc.effects.base import Context
from drake_tc.effects.torque_sensor_bias import TorqueSensorBias
from drake_tc.effects.torque_sensor_drift import TorqueSensorDrift
from drake_tc.effects.within_tolerance import WithinTolerance
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray

SETTLING_ROUNDS = 4


@errors_in_joint_units
def diagnose_joint(
    train_runs: Sequence[Run],
    held_runs: Sequence[Run],
    rig: Rig,
    joint: str,
    options: DiagnosisOptions,
    progress: Progress = lambda text, share: None,
    link_prior: LinkPrior | None = None,
    executor: Executor | None = None,
) -> JointResult:
    """Diagnose one joint. The held-out runs are looked at only after every choice is made.

    Args:
        train_runs: To fit.
        held_runs: Held-out runs.
        rig: Says drive, load and what is declared.
        joint: Which.
        options: Thresholds and seed.
        progress: Told how far it is.
        link_prior: Of the links' columns that the runs hold; None where they hold none.
        executor: Refines proposals and assesses what is left in its workers; None does it here.

    Raises:
        IdentificationError: the training runs cannot identify even the declared model.
    """
    progress("filtering", 0.0)
    prepare: Callable[..., Prepared] = partial(
        prepare_joint,
        *(train_runs, held_runs, rig, joint),
        link_prior=link_prior,
        width_s=options.width_s,
        common=options.common,
        command_held=options.command_held,
        sampled_late=options.effort_age,
    )
    stage, prepare = of_its_gear(prepare, options, progress, executor)
    if charged := charged_integrator(prepare, stage.prepared, stage.found.chosen.terms):
        prepare = partial(prepare, centred=True)
        stage = searched(charged, options, progress, executor)
    first, terms = stage.prepared, stage.found.chosen.terms
    if moved := (position_recorded_late(prepare, first, terms) or torque_recorded_late(prepare, first, terms)):
        stage = searched(moved, options, progress, executor, without=LATE)
    elif (late := sampled_late(rig.command_hold, first, terms)) > 0.0:
        stage = searched(prepare(sampled_late=late), options, progress, executor, without=LATE)
    elif moved := age_of_samples(rig.command_hold, prepare, first, terms) or recorded_late(prepare, first, terms):
        stage = searched(moved, options, progress, executor, without=LATE)
    prepared, subsample, context = stage.prepared, stage.subsample, stage.prepared.context
    alternatives = indistinguishable(subsample, stage.found, context, prepared.floor, options.effects)
    stability = stabilities(stage.found, options.seed)
    found = _refitted(stage)
    confirmed = confirm(
        lambda chosen: _settled(prepared.train, prepared.held, chosen, found.baseline, context),
        found.chosen,
        found.baseline,
        context,
        prepared.floor,
        options.search.least_gain,
    )
    columns, held, chosen = confirmed.train, confirmed.held, confirmed.fit
    require_drive_gain(columns, chosen, rig, joint, context.load)
    baseline = with_drive_gain(columns, found.baseline, chosen)
    progress("what is left", 0.0)
    floor = noise_floor(columns, chosen)
    splits = compared(columns, held, baseline, chosen)
    unexplained, floor, notes = what_is_left(splits, chosen, floor, context, options, executor)
    final_parameters = parameters_of(columns, chosen, context.drive)
    effects = found_effects(columns, held, chosen, baseline.terms, final_parameters, stability)
    kept = {e.id for e in effects}
    did_not_hold = (*stage.passed_over, *confirmed.withdrawn)
    load_notes = (
        *load_scale(rig, joint).notes,
        *drive_notes(rig, joint, final_parameters, chosen.gain),
        *gain_note(final_parameters, context.drive),
        *age_note(columns.samples, context.drive),
        *viscous_age_note(
            rig.command_hold,
            columns.samples,
            final_parameters,
            context.drive,
            partial(error_of_age, prepare, first, prepared, chosen.terms),
        ),
        *late_note(final_parameters, columns.samples),
        *(late_command(columns, chosen) if context.drive == "position_servo" else ()),
        *_unknown_age(unexplained, splits[1], floor, context),
        *_gear(columns, context),
        *zero_of_effort(effects, alternatives, chosen.gain, context),
    )
    alternatives = (
        *(pair for pair in scale_alternatives(rig, joint, final_parameters) if pair[0] in kept),
        *(pair for pair in alternatives if pair[0] in kept),
    )
    by_condition = consistency(columns, chosen, context.drive)
    return JointResult(
        joint=joint,
        drive=context.drive,
        unit=context.units.effort,
        units=columns.samples.units,
        baseline=baseline,
        final=chosen,
        baseline_parameters=parameters_of(columns, baseline, context.drive),
        final_parameters=final_parameters,
        held=known_values(rig, joint),
        noise_floor=floor,
        before=Errors(rms(splits[0].before), rms(splits[1].before), None),
        after=Errors(rms(splits[0].after), rms(splits[1].after), None),
        effects=effects,
        rejected=rejected_effects(
            columns,
            held,
            chosen,
            context,
            options.search,
            stage.obstacles,
            floor,
            options.effects,
            baseline,
            {each.id for each in did_not_hold},
        ),
        indistinguishable=alternatives,
        next_experiment=next_experiment(
            alternatives,
            unexplained,
            [each.reason for each in did_not_hold],
            loads_differ=loads_differ(by_condition),
            load_measured=context.load == "torque",
            friction_differs=friction_differs(by_condition) and not columns.samples.signals.has("temperature"),
            among_joints=len(rig.joints) > 1,
        ),
        unexplained=unexplained,
        verdict=verdict_of(unexplained, found=bool(effects)),
        train=splits[0],
        heldout=splits[1],
        did_not_hold=did_not_hold,
        runs=tuple(run_errors(splits)),
        consistency=by_condition,
        plausible=plausible_ranges(chosen, context),
        shared_band=shared_band(*splits),
        load_notes=load_notes,
        notes=(
            *load_notes,
            *notes_of_joint((*columns.samples.notes, *held.samples.notes), joint, rig.joints),
            *notes,
            *without_rows((columns.samples, held.samples)),
            *_open_gap(columns.samples),
            *((ChargedIntegrator(),) if columns.samples.centred else ()),
            *_sticking(columns, chosen, context),
        ),
    )


def _sticking(columns: Columns, chosen: Fit, context: Context) -> tuple[Sticking, ...]:
    found = None if context.load in ("robot", "links", "unknown") else sticking(columns, chosen)
    return () if found is None else (found,)


def _unknown_age(left: Unexplained, held: DataSplit, floor: float, context: Context) -> tuple[UnknownAge, ...]:
    open_question = context.drive == "position_servo" and (left.structured or left.excess)
    return (UnknownAge(held.samples.signals.period),) if open_question and may_be_age_of_command(held, floor) else ()


def _open_gap(samples: Samples) -> tuple[GapCrossings, ...]:
    return (GapCrossings(samples.open_within),) if samples.open_within > 0.0 else ()


def _gear(columns: Columns, context: Context) -> tuple[GearBetweenEncoders, ...]:
    found = None if context.drive == "position_servo" else gear_between_encoders(columns)
    note = None if found is None else found.note(columns.samples.resolution.position_step)
    return () if note is None else (note,)


def _refitted(stage: Stage) -> Search:
    """What was found on a subsample, fitted to all training rows."""
    prepared, found = stage.prepared, stage.found
    if stage.subsample is prepared.train:
        return found
    baseline, chosen = (fit(prepared.train, f.terms) for f in (found.baseline, found.chosen))
    baseline = at_reverse_regression(prepared.train, baseline, prepared.context.drive)
    return replace(found, baseline=baseline, chosen=chosen)


def _settled(
    columns: Columns, held: Columns, chosen: Fit, baseline: Fit, context: Context
) -> tuple[Columns, Columns, Fit]:
    """The fit with columns that know the final model: some effects act through its stiffness and damping."""
    servo, first = context.drive == "position_servo", (columns, held)
    for _ in range(SETTLING_ROUNDS if len(chosen.terms) > len(baseline.terms) else 0):
        columns, held = (
            with_fitted_load(
                c.with_model(chosen.terms, chosen.beta, servo=servo, true_torque=true_torque(c, chosen)), chosen
            )
            for c in first
        )
        chosen = fit(columns, chosen.terms)
    if errors_in(chosen.terms):
        columns, held = (weighed(each, columns, chosen) for each in (columns, held))
        chosen = fit(columns, chosen.terms)
    return columns, held, chosen


def true_torque(columns: Columns, fitted: Fit) -> FloatArray:
    """The measured load (T,) without the additive sensor errors among the fit's terms."""
    signals = columns.samples.signals
    for term, theta in coefficients_by_term(fitted.terms, fitted.beta):
        members = term.effect.members if isinstance(term.effect, WithinTolerance) else (term.effect,)
        for sensor in members:
            if isinstance(sensor, TorqueSensorBias | TorqueSensorDrift):
                signals = sensor.restore(signals, term.effect.physical(theta, term.shape, fitted.gain))
    return signals.load_torque
