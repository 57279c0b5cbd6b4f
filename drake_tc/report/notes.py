"""What the reader of a result must know beside its numbers, as sentences: notes, warnings, and the next experiment.

What the logs of an arm say against its rig file and robot file is told with what to change there.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any, assert_never

import numpy as np

from drake_tc.config.joint_units import EFFORT_UNIT, TURNING, JointUnits
from drake_tc.config.quoted import json_value
from drake_tc.diagnosis.notes import (
    CorrelatedTorqueNoise,
    FreeRunDiverges,
    FreeRunObstacle,
    LoadInAllRuns,
    LogRemark,
    NoFreeRun,
    NoiseOfRecordedEffort,
    Note,
    RunNote,
    RunsDiffer,
    RunsWithoutMotion,
    ScaleNote,
    ScaleOfRotorInertia,
    ScatteringTimes,
    SilentEffort,
    TorqueAsCommanded,
    TorqueAsEffort,
)
from drake_tc.diagnosis.residual.unexplained import (
    CoverRange,
    FindPeriodicSource,
    NextExperiment,
    RepeatRun,
    RepeatUnchanged,
    TellApart,
    VarySignals,
)
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.models import MODEL_FILE
from drake_tc.diagnosis.result.rig_result import SET_UP_ERRORS, SetUpCheck, SetUpError
from drake_tc.effects.library import effect
from drake_tc.logs.record import distinct_notes
from drake_tc.report.numbers import percent, pretty_unit, significant
from drake_tc.report.words import capital, joined, mostly_unexplained, signal_name, signal_range, title_of

NO_FREE_RUN: Mapping[FreeRunObstacle, str] = {
    "load_beyond_gear": "an effect of the model depends on the load torque at the gear, and the fitted smooth load "
    "does not pass through the simulated gear.",
    "no_fitted_inertia": "the fitted inertia is 0, so no torque could accelerate the joint.",
    "no_inertia": "the model has no inertia that a torque could accelerate. The rig file can declare `rotor_inertia`.",
    "nothing_to_simulate": "no held-out run has a stretch that can be simulated.",
}


def note_sentences(notes: Sequence[Note], units: JointUnits = TURNING) -> tuple[str, ...]:
    """One text a note, in their order and in the units of the joint; what runs have in common is told once."""
    out: list[str] = []
    for of_runs, group in groupby(notes, key=lambda note: isinstance(note, RunNote)):
        if of_runs:
            out += distinct_notes((n.run, _run_sentence(n)) for n in group if isinstance(n, RunNote))
        else:
            out += [note_sentence(note) for note in group]
    return tuple(map(units.text, out))


def note_sentence(note: Note) -> str:
    """One to three sentences."""
    match note:
        case LogRemark() | SilentEffort():
            return f"{note.run}: {_run_sentence(note)}"
        case TorqueAsCommanded() | ScaleOfRotorInertia() | TorqueAsEffort():
            return _scale_sentence(note)
        case NoiseOfRecordedEffort("position_servo", ratio):
            return (
                "The recorded goal scatters from sample to sample, as it does if the instants at which it is written "
                f"and logged drift against each other. With this scatter, the noise floor is {ratio:.1f} times that of "
                "the sensors."
            )
        case NoiseOfRecordedEffort(drive, ratio):
            name = {"current": "current", "voltage": "voltage"}.get(drive, "torque command")
            return (
                f"With the white noise of the recorded {name}, the noise floor is {ratio:.1f} times that of the "
                "sensors."
            )
        case ScatteringTimes(scatter, speed, noise):
            return (
                f"The instants of the samples scatter by {1e6 * scatter:.3g} us (RMS) about their time stamps. At the "
                f"fastest motion, {speed:.3g} rad/s, positions therefore err by {scatter * speed:.3g} rad; at rest, by "
                f"{noise:.3g} rad. The noise floor includes this, and it grows with the speed."
            )
        case LoadInAllRuns(link, mass, own):
            return (
                f"The mass that was found at {link}, {mass:.3g} kg, is larger than the link's own ({own:.3g} kg). A "
                "tool or a load that the arm carries in all logs acts in this way, at another place and with another "
                "mass: add it to the URDF, or fit it as a part of the links with `load: {robot: fitted}`."
            )
        case CorrelatedTorqueNoise(ratio, correlation_time):
            return (
                f"The noise of the torque is correlated over about {1e3 * correlation_time:.0f} ms. The noise floor is "
                f"therefore {ratio:.1f} times that of white noise of the size seen at the highest frequencies."
            )
        case RunsDiffer(ratio):
            return (
                "Friction differs from run to run. In the held-out runs it differs from that of the training runs by "
                "no more than the training runs differ from each other. The noise floor contains this difference and "
                f"is therefore {ratio:.1f} times that of the sensors."
            )
        case RunsWithoutMotion(runs, window):
            return (
                f"Runs without a stretch of motion as long as the filter window ({1e3 * window:.3g} ms) take no part: "
                f"{', '.join(runs)}."
            )
        case NoFreeRun() | FreeRunDiverges():
            return _free_run_sentence(note)
        case _:
            assert_never(note)


def _run_sentence(note: RunNote) -> str:
    match note:
        case LogRemark(_, statement):
            return statement
        case SilentEffort(_, column, share):
            return (
                f"Column {column} is exactly 0 in {100 * share:.0f} % of the samples in which the joint moves: its "
                "recorded values have a dead zone, which no model of the joint explains."
            )
        case _:
            assert_never(note)


def _scale_sentence(note: ScaleNote) -> str:
    """What fixes the scale of the torques of an unknown load."""
    match note:
        case TorqueAsCommanded():
            return "The load is unknown, so the drive is assumed to produce the commanded torque (drive_gain: 1)."
        case ScaleOfRotorInertia(rotor_inertia):
            return (
                f"The load is unknown; the declared rotor inertia of {rotor_inertia:.4g} kg m^2 fixes the scale of the "
                "torques, and the load is taken to have no inertia of its own."
            )
        case TorqueAsEffort(drive, declares_inertia):
            unit = EFFORT_UNIT[drive]
            beside = " The declared rotor inertia does not fix it: the unknown inertia of the load adds to it."
            return (
                f"Torques are reported as effort [{unit}]: the drive gain is set to 1 {unit} per N*m, because nothing "
                "in the rig fixes the scale of an unknown load; declare drive_gain to get N*m."
                f"{beside if declares_inertia else ''}"
            )
        case _:
            assert_never(note)


def _free_run_sentence(note: NoFreeRun | FreeRunDiverges) -> str:
    match note:
        case NoFreeRun(reason):
            return f"There is no free run: {NO_FREE_RUN[reason]}"
        case FreeRunDiverges(model, runs):
            name = "The refined model" if model == "refined" else f"The model {model}"
            return f"{name} has no free-run error, because its free run diverges on {', '.join(runs)}."
        case _:
            assert_never(note)


LARGER = 1.02
"""Ratio of two position errors from which on the first one is called larger."""


def warnings(joint: JointResult) -> Sequence[str]:
    """What the reader must not overlook, one sentence each."""
    out = [
        f"These logs cannot distinguish {title_of(a)} from {title_of(b)}; both fit equally well."
        for a, b in joint.indistinguishable
    ]
    for key, group in joint.final_parameters.items():
        out += [
            f"{capital(title_of(key))}: the parameter {name.replace('_', ' ')} lies at a bound of its range, so its "
            "95 % interval is not valid."
            for name, estimate in group.items()
            if estimate.at_bound
        ]
    if not joint.gain_identified:
        gain = joint.final_parameters["drive"]["gain"]
        out.append(
            f"These logs do not identify the drive gain: its 95 % interval reaches from {significant(gain.ci95[0])} "
            f"to {significant(gain.ci95[1])} {pretty_unit(gain.unit)}."
        )
    if joint.effects and joint.after.heldout > joint.before.heldout:
        out.append("The held-out error did not fall: do not use the model after without looking at the plots.")
    if mostly_unexplained(joint):
        share = percent(joint.after.heldout / joint.before.heldout)
        out.append(
            f"With the effects found, {share} of the held-out error is left. While so much is unexplained, an effect "
            "may imitate the missing cause: confirm its kind and its parameters by another experiment."
        )
    before, after = joint.before.free_run_heldout, joint.after.free_run_heldout
    changed = bool(joint.effects) or not joint.links_fitted  # else the models differ by what the links' fit rounds
    if changed and before is not None and after is not None and np.isfinite(before) and after > LARGER * before:
        out.append(
            "The position error of the free run on the held-out runs is larger with the model after than with the "
            "model before: look at the free-run plots before you simulate with the model after."
        )
    refinement = joint.refinement
    refined = refinement.free_run_heldout if refinement is not None and refinement.accepted else None
    if after is not None and refined is not None and refined > LARGER * after:
        out.append(
            f"The position error of the free run on the held-out runs is larger with {MODEL_FILE} than with the model "
            "after, although it is smaller on the training runs: prefer the model after."
        )
    return out


COMMON = 1.1
"""Factor within which the drive gains of several joints are wrong by the same factor."""
TESTED = (
    "reversed joints, positions and efforts, exchanged columns and efforts, other zeros, drive gains and mountings, "
    "gears that couple two joints, and payloads"
)


def set_up_sentences(check: SetUpCheck | None) -> tuple[str, ...]:
    """One text a line: what is wrong and what to change; a single one where nothing that was tried explains it.

    Empty where the declared model leaves little of every effort.
    """
    if check is None:
        return ()
    joint = _worst(check)
    of_joint = f"of the effort of {joint}"
    before, after = percent(check.before[joint]), percent(check.after.get(joint, math.nan))
    if not check.errors:
        return (
            f"The declared model leaves {before} {of_joint}. Errors of the set-up were tried: {TESTED}. "
            "None of them explains it.",
        )
    lines = ["The logs contradict the rig file or the URDF.", *(_error(error) for error in check.errors)]
    if check.alternatives:
        others = "; ".join(_error(error) for error in check.alternatives)
        lines.append(f"These logs cannot distinguish the last point from another one: {others}")
    changes = "this change" if len(check.errors) == 1 else "these changes"
    lines.append(
        f"With {changes}, the declared model leaves {after} {of_joint} instead of {before}. No effects were looked "
        "for, because a wrong set-up imitates them. Correct the files and run the command again."
    )
    return tuple(lines)


def _worst(check: SetUpCheck) -> str:
    """The joint whose error is largest, or falls by the largest factor where errors were found."""
    if not check.errors:
        return max(check.before, key=lambda joint: check.before[joint])
    return max(check.after, key=lambda joint: check.before[joint] / max(check.after[joint], 1e-12))


def _error(error: SetUpError) -> str:
    names = joined(error.joints)
    if error.kind == "gravity":
        return _gravity(error)
    if error.kind == "drive_gain":
        return _gains(error.gains)
    if error.kind == "payload":
        return _payload(error)
    if error.kind == "coupled":
        motor, other = error.joints
        turns = f"{error.turns:.3g}"  # as YAML reads it
        return (
            f"The motor of {motor} also turns with {other}, by {turns} for 1: a gear couples the two joints. State "
            f"`coupled: {{{motor}: {{{other}: {turns}}}}}` in the rig file."
        )
    if error.kind == "columns_exchanged":
        return f"The columns of {names} are exchanged: exchange them under `columns:` in the rig file."
    if error.kind == "efforts_exchanged":
        return (
            f"The efforts of {names} are exchanged, and the positions are not: exchange the effort columns under "
            "`columns:` in the rig file."
        )
    if error.kind == "zero":
        return (
            f"The position of {names} reads {significant(error.zero)} rad ({math.degrees(error.zero):.1f} deg) at the "
            "zero of the URDF: subtract this angle from the column."
        )
    entries = ", ".join(f"{column}: {unit}" for column, unit in error.units.items())
    change = f"change the rig file to `units: {{{entries}}}`"
    if error.kind == "position_reversed":
        return f"The recorded position of {names} has the wrong sign: {change}."
    if error.kind == "effort_reversed":
        return f"The recorded effort of {names} has the wrong sign: {change}."
    verb = "has its axis" if len(error.joints) == 1 else "have their axes"
    return f"{names} {verb} in the direction opposite to that in the URDF: {change}."


def _gains(gains: Mapping[str, tuple[float, float]]) -> str:
    factors = [fitted / declared for fitted, declared in gains.values()]
    low, high = min(factors), max(factors)
    by = f"{significant(float(np.median(factors)))} times"
    entries = ", ".join(f"{joint}: {significant(fitted)}" for joint, (fitted, _) in gains.items())
    change = f"change `drive_gain` to {{{entries}}}"
    if high > COMMON * low:  # joints with little load tell their gain only roughly
        by, change = f"{significant(low)} to {significant(high)} times", "leave `drive_gain` out, so that it is fitted"
    return (
        f"The recorded effort of {joined(list(gains))} is {by} as large as `drive_gain` says. Its unit may be another "
        "one, such as mA or percent of a rated torque, or the torque constant is wrong: correct `units`, or "
        f"{change}."
    )


def _payload(error: SetUpError) -> str:
    body = f"{error.carrier} carries about {significant(error.mass)} kg that"
    if not error.runs:
        return (
            f"{body} the URDF does not have: add it there, or write `load: {{robot: fitted}}` in the rig file, so that "
            "the links are fitted."
        )
    names, logs = ", ".join(error.runs), "the log" if len(error.runs) == 1 else "the logs"
    if error.held_out:
        return (
            f"In the held-out log {names}, {body} it does not carry in the training logs. Hold out a log with the same "
            "load as in training."
        )
    entry = f"unknown_payload: [{names}]"
    change = f"add `{entry}` to `load`" if error.links_fitted else f"write `load: {{robot: fitted, {entry}}}`"
    return (
        f"In {logs} {names}, {body} it does not carry in the other logs: {change} in the rig file, or leave "
        f"{'it' if logs == 'the log' else 'them'} out."
    )


def _gravity(error: SetUpError) -> str:
    """By the angles of the fixed joint between `mount` and the base that `docs/whole_arm.md` describes."""
    up = -np.array(error.gravity)
    pitch, roll = math.asin(float(np.clip(-up[0], -1.0, 1.0))), math.atan2(float(up[1]), float(up[2]))
    if math.hypot(float(up[1]), float(up[2])) < 0.02:  # pitch of 90 deg: roll is a turn about gravity
        roll = 0.0
    tilt = math.degrees(math.acos(float(np.clip(up[2], -1.0, 1.0))))
    direction = ", ".join(f"{x:.2f}" for x in error.gravity)
    return (
        f"Gravity acts along ({direction}) of the robot's base, not along -z: the base is tilted by {tilt:.0f} deg. "
        "Add to the URDF a link `mount` (another name where there is one) and a fixed joint from it to the base with "
        f'<origin rpy="{roll:.3f} {pitch:.3f} 0"/>, and set `base: mount` in the robot file.'
    )


def set_up_json(check: SetUpCheck | None) -> dict[str, Any] | None:
    """The entry of report.json; null where the set-up was not looked at or the links are not fitted."""
    if check is None:
        return None
    return {
        "tested": list(SET_UP_ERRORS),
        "errors": _entries(check.errors),
        "alternatives": _entries(check.alternatives),
        "left": {
            joint: {"before": share, "after": json_value(check.after.get(joint))}
            for joint, share in check.before.items()
        },
        "statements": list(set_up_sentences(check)),
    }


def _entries(errors: Sequence[SetUpError]) -> list[dict[str, Any]]:
    """Each error with what belongs to its kind."""
    return [
        {
            "kind": error.kind,
            "joints": list(error.joints),
            "units": dict(error.units),
            "drive_gain": {j: {"fitted": f, "declared": d} for j, (f, d) in error.gains.items()},
            "zero": error.zero if error.kind == "zero" else None,
            "gravity": list(error.gravity) if error.kind == "gravity" else None,
            "turns": error.turns if error.kind == "coupled" else None,
            "mass": error.mass if error.kind == "payload" else None,
            "carrier": error.carrier or None,
            "runs": list(error.runs),
        }
        for error in errors
    ]


ISOLATES: Mapping[str, str] = {
    "rotor_inertia": "drive the joint with fast accelerations at small speed (a chirp of small amplitude)",
    "stribeck": "creep at constant speeds from 0.001 to 0.5 rad/s in both directions",
    "quadratic_viscous": "run at constant speeds up to the fastest allowed",
    "viscous_power": "run at ten or more constant speeds from the slowest to the fastest allowed, in both directions",
    "run_in_friction": "repeat one motion for minutes after a rest, and again at once",
    "load_dependent_friction": "repeat one slow motion with several hung weights",
    "asymmetric_friction": "run the same constant speeds in both directions, unloaded",
    "presliding_hysteresis": "reverse slowly and often with amplitudes from 0.001 to 0.1 rad",
    "position_dependent_friction": "cross the whole range at one constant slow speed in both directions",
    "thermal_friction": "repeat one motion cold and warm, without changing it",
    "torque_ripple": "turn slowly at constant speed over the whole range, unloaded",
    "cable_spring": "hold postures over the whole range, unloaded, approached from both sides",
    "payload": "hold postures over the whole range and add fast small motions at each",
    "backlash": "record the motor's and the link's position while the load torque changes its sign slowly",
    "elasticity": "lock the link and load the motor slowly, with both encoders recorded",
    "deadzone": "load the joint slowly through zero effort in both directions, at rest",
    "saturation": "command efforts well beyond the suspected limit against a stiff stop",
    "servo_integrator": "hold a constant load for a minute and watch whether the position creeps back",
    "velocity_sign_switch": "carry the same loads up and down at the same speeds",
    "delay": "step the command and record at the fastest rate",
    "current_lag": "step the command with the joint locked and record at the fastest rate",
    "torque_sensor_bias": "unload and release the joint, drive off, and read the torque sensor",
    "effort_bias": "hold the joint at rest, unloaded, the drive off, and read the current or voltage",
    "torque_sensor_gain": "hang known weights on the link and read the torque sensor",
    "torque_sensor_drift": "leave the joint at rest, unloaded, for several minutes",
    "encoder_offset": "let the link hang freely, drive off, and read the encoder",
    "encoder_ripple": "turn at two constant speeds over a whole turn: the error of the encoder keeps its place",
    "servo_gain": "hang known weights on the link and read the effort that holds them, approached from both sides",
    "static_friction": "raise the effort slowly from rest until the joint moves, many times in both directions",
    "gain_ripple": "cross the whole range slowly in both directions, unloaded and with a known load",
    "supply_sag": "repeat one motion on a stabilised supply at two voltages",
    "winding_temperature": "repeat one motion under load cold and warm, without changing it",
    "directional_efficiency": "lower and raise known weights slowly, with the motor's torque recorded in its own unit",
    "position_dependent_load": "cross the whole range slowly in both directions, with two hung weights",
    "encoder_eccentricity": "turn at constant speed over a whole turn, or compare with a second encoder",
}
"""What shows an effect of the library alone, as an instruction, by its id."""
ISOLATES_PRISMATIC: Mapping[str, str] = {
    "stribeck": "creep at constant speeds from 0.1 to 50 mm/s in both directions",
    "presliding_hysteresis": "reverse slowly and often with amplitudes from 0.1 to 10 mm",
    "torque_ripple": "move slowly at constant speed over the whole range, unloaded",
    "payload": "add fast small motions at several positions",
    "torque_sensor_gain": "load the link with known forces and read the force sensor",
    "encoder_offset": "move the joint to a stop or mark of known position and read the encoder",
    "encoder_ripple": "move at two constant speeds over the whole range: the error of the encoder keeps its place",
    "servo_gain": "load the link with known forces and read the effort that holds them, approached from both sides",
}
"""The same of a prismatic joint, where the instruction differs."""


def next_experiment(joint: JointResult) -> str | None:
    """The next experiment of a joint in its units; None where there is none to propose."""
    return None if joint.next_experiment is None else experiment_sentence(joint.next_experiment, joint.units)


def experiment_sentence(experiment: NextExperiment, units: JointUnits = TURNING) -> str:
    """One or two sentences, in the units of the joint."""
    match experiment:
        case TellApart(first, second):
            one, other = (isolating(each, units) for each in (first, second))
            return f"To tell {first} from {second}: {one} (shows {first} alone); {other} (shows {second} alone)."
        case CoverRange(beyond):
            reached = signal_range(beyond.signal, *beyond.reached, units, beyond.unit)
            trained = signal_range(beyond.signal, *beyond.trained, units, beyond.unit)
            return (
                f"Record a training run in which the {signal_name(beyond.signal)} covers {reached}, as in "
                f"{joined(beyond.runs)}. The present training runs cover {trained}; outside this range, the model "
                "is extrapolated."
            )
        case RepeatRun(run, start, end):
            return (
                f"Repeat {run}. If the error between {start:.1f} and {end:.1f} s comes back, the joint causes it, for "
                "example by play of the gear where the load reverses. If not, something acted on the joint that the "
                "log does not show."
            )
        case FindPeriodicSource(frequency_hz, among_joints) if among_joints:
            return (
                f"The residual is periodic at {frequency_hz:.2f} Hz. If another joint moves at this frequency, its "
                "motor or its load acts here: check the effort columns, and whether a gear couples the two joints "
                "(`coupled` in the rig file). Otherwise look for a source of this frequency near the robot."
            )
        case FindPeriodicSource(frequency_hz):
            return (
                f"The residual is periodic at {frequency_hz:.2f} Hz: look for a source of this frequency near the "
                "rig, and record a run with it switched off."
            )
        case RepeatUnchanged():
            return "Repeat one run unchanged: the residual has structure that depends on no recorded signal."
        case VarySignals(signals):
            return _vary([name.replace("_", " ") for name in signals])
        case _:
            assert_never(experiment)


def _vary(signals: list[str]) -> str:
    if len(signals) > 1:
        return (
            f"Record runs in which {joined(signals)} vary independently of each other: the residual depends on them "
            "in a way that the model does not describe."
        )
    return (
        f"Record runs in which {signals[0]} varies and the other signals do not: the residual depends on it in a way "
        "that the model does not describe."
    )


def isolating(effect_id: str, units: JointUnits = TURNING) -> str:
    """What shows an effect alone; an effect of another package says it itself, or is asked by its signature."""
    if units.slides and effect_id in ISOLATES_PRISMATIC:
        return ISOLATES_PRISMATIC[effect_id]
    if effect_id in ISOLATES:
        return units.text(ISOLATES[effect_id])
    known = effect(effect_id)
    return units.text(known.isolated_by or f"vary {known.signature.x.replace('_', ' ')} alone, all else held")
