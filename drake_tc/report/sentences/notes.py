"""What the reader of a result must know beside its numbers, as sentences.

What the reader of a joint's result must not overlook.
"""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import assert_never

import numpy as np

from drake_tc.config.joint_units import TURNING, JointUnits
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
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.models import MODEL_FILE
from drake_tc.effects.context import EFFORT_UNIT
from drake_tc.logs.record import distinct_notes
from drake_tc.report.numbers import percent, pretty_unit, significant
from drake_tc.report.sentences.words import capital, mostly_unexplained, title_of

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
