"""The next experiment, as one or two sentences."""

from collections.abc import Mapping
from typing import assert_never

from drake_tc.config.joint_units import TURNING, JointUnits
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
from drake_tc.effects.library import effect
from drake_tc.report.sentences.words import joined, signal_name, signal_range

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
