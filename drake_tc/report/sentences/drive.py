"""Sentences on the drive that the rig file describes: its gain, its timing, and a servo's own damping."""

from collections.abc import Mapping
from typing import assert_never

from drake_tc.diagnosis.load_notes import ConstantBesidePendulum
from drake_tc.diagnosis.notes import (
    DriveNote,
    FarFromRotor,
    GainBesideEffects,
    GainDeclaredWrong,
    GainNote,
    GainOfTorqueDrive,
    LoadWithRotor,
    PayloadFromRatio,
    ServoDamping,
    SizeByRotorInertia,
    ZeroOfEffort,
)
from drake_tc.diagnosis.timing_notes import (
    AllRecordedLate,
    DelayBySampling,
    HeldEffort,
    LateCommand,
    OlderEffort,
    PositionRecordedLate,
    RecordedLate,
    TorqueRecordedLate,
    UnknownAge,
    ViscousByAge,
)
from drake_tc.effects.context import EFFORT_UNIT, DriveKind

RECORDED: Mapping[DriveKind, str] = {
    "position_servo": "command",
    "current": "current",
    "voltage": "voltage",
    "torque": "torque of the drive",
}
"""What is recorded of the effort."""
EFFORTS: Mapping[DriveKind, str] = {
    "position_servo": "commands",
    "current": "currents",
    "voltage": "voltages",
    "torque": "torques of the drives",
}
"""The same of several joints."""


def drive_sentence(note: DriveNote) -> str:
    """One to three sentences."""
    match note:
        case DelayBySampling(name, value, period):
            return (
                f"Up to {_ms(period)} (one sampling period) of the {name} of {_ms(value)} may come from the instants "
                f"at which the columns were sampled. The 95 % interval of the {name} does not include this."
            )
        case OlderEffort(drive, age, period):
            return (
                f"On average, the {RECORDED[drive]} that acts at an instant is {_ms(age)} older than the one recorded "
                f"there. Sampling within one period ({_ms(period)}) explains this, so no delay is named; a log at a "
                "higher rate could show a delay of this size."
            )
        case RecordedLate(drive, lead):
            return (
                f"The {RECORDED[drive]} seems to act {_ms(lead)} before it is recorded, which no drive can do. It was "
                "therefore taken to be recorded late: both models and their errors are for the earlier values, and the "
                "free run is driven by the recorded ones. Check its time stamps, whether it is filtered before it is "
                "logged, and whether it belongs to an earlier cycle."
            )
        case AllRecordedLate(kind, lead):
            efforts = "efforts" if kind is None else EFFORTS[kind]
            return (
                f"The {efforts} of all joints seem to act {_ms(lead)} before they are recorded, which no drive can do. "
                "They were therefore taken to be recorded late: all models and their errors are for the earlier "
                "values, and the free runs are driven by the recorded ones. Check their time stamps, whether they are "
                "filtered before they are logged, and whether they belong to an earlier cycle."
            )
        case PositionRecordedLate(lead):
            return (
                f"The position seems to be recorded {_ms(lead)} after it was measured: if the positions are shifted by "
                "this time, command and torque fit the motion. Both models and their errors are for the shifted "
                "positions. Check the time stamps of the encoder."
            )
        case TorqueRecordedLate(lead):
            return (
                f"The torque seems to be recorded {_ms(lead)} after it was measured: if it is shifted by this time, "
                "command and motion fit it. Both models and their errors are for the shifted torque, and the free run "
                "is driven by the recorded one. Check the time stamps of the torque sensor, and whether it is filtered."
            )
        case HeldEffort(drive, period):
            return (
                f"The {RECORDED[drive]} is taken to act unchanged from one sample to the next ({_ms(period)}); declare "
                "command_hold: false if the samples are points of a continuous curve."
            )
        case ViscousByAge(shift, period):
            return (
                f"The logs do not show how old the command is within one sampling period ({_ms(period)}). The viscous "
                f"friction may therefore be wrong by up to {shift:.3g} N*m*s/rad, which its 95 % interval does not "
                "include. If you know whether the command is held between samples, state command_hold in the rig file."
            )
        case LateCommand(delay, viscous, found, ratio):
            larger = f"{100.0 * (ratio - 1.0):.0f} % larger" if ratio > 1.005 else "no larger"
            return (
                f"The delay may also act on the command alone, as that of a bus does. It is then {_ms(delay)}, the "
                f"viscous friction is {viscous:.3g} N*m*s/rad instead of {found:.3g}, and the error is {larger}. The "
                "95 % intervals do not include this."
            )
        case UnknownAge(period):
            return (
                f"The remaining error may come from the instants of sampling. It is no larger than the speed of the "
                f"command times half a sampling period ({_ms(0.5 * period)}), and most of it lies where the command is "
                "fast, as if the clocks of command and log drifted against each other. Log the command and the "
                "position at the same instants, or each with its own time stamps."
            )
        case ZeroOfEffort(effect, drive, offset, share):
            key = "torque_command" if drive == "torque" else drive
            return (
                f"An offset of the recorded {RECORDED[drive]} of {offset:.3g} {EFFORT_UNIT[drive]} would look like the "
                f"{effect}. This is {100.0 * share:.2g} % of its largest value in the logs, and data sheets of such "
                f"sensors allow up to 3 %. If yours does, declare the tolerance (sensors: {{{key}: {{bias: ...}}}}): "
                "an offset within it is then not reported."
            )
        case ConstantBesidePendulum(drive, effort, share):
            cause = "an offset between command and position" if drive == "position_servo" else "an offset of it"
            recorded = "position error" if drive == "position_servo" else f"recorded {RECORDED[drive]}"
            return (
                f"A pendulum has no constant torque. The fitted constant ({effort:.3g} {EFFORT_UNIT[drive]} of the "
                f"{recorded}, {100.0 * share:.2g} % of the Coulomb friction) may be {cause}, a Coulomb friction that "
                "differs between the directions of motion, or the preload of a spring or cable. These logs cannot tell "
                "them apart, and the interval of the constant is that of their sum."
            )
        case ServoDamping(viscous, servo, exceeds) if exceeds:
            return (
                f"The servo's damping of {servo:.3g} N*m*s/rad, computed from derivative_gain, exceeds the identified "
                f"viscous friction of {viscous:.3g} N*m*s/rad: check derivative_gain, and which velocity the servo "
                "uses."
            )
        case ServoDamping(viscous, servo):
            return (
                f"The identified viscous friction of {viscous:.3g} N*m*s/rad contains the servo's damping of "
                f"{servo:.3g}; {viscous - servo:.3g} N*m*s/rad are the joint's own."
            )
        case _:
            return _gain_sentence(note)


def _gain_sentence(note: GainNote) -> str:
    match note:
        case GainOfTorqueDrive(gain, low, high):
            return (
                f"The fitted drive gain is {gain:.3g} N*m of commanded torque for 1 N*m at the joint (95 % interval "
                f"{low:.3g} to {high:.3g}); 1 is expected of a drive that is commanded in N*m. Declare drive_gain: 1 "
                "to have the difference tested as an effect."
            )
        case SizeByRotorInertia(effects):
            return (
                f"The size of the {' and the '.join(effects)} rests on the declared rotor_inertia, which alone fixes "
                "the scale of the torques where no drive gain is declared: a wrong rotor_inertia would look the same. "
                "Declare drive_gain to have it checked."
            )
        case FarFromRotor(title, ratio):
            return (
                f"The inertia of the {title} is {ratio:.3g} times the declared rotor inertia. If the link carries no "
                "such load, the units disagree: a torque in N*mm makes it 1000 times as large (state it under "
                "units), and a rotor inertia on the motor's side has to be multiplied by the square of the gear ratio."
            )
        case LoadWithRotor(effects):
            depend = "depends" if len(effects) == 1 else "depend"
            return (
                f"The {' and the '.join(effects)} {depend} on the torque that the gear transmits. The fitted inertia "
                "of the unknown load includes the rotor inertia, although the gear does not transmit the torque that "
                "accelerates the rotor. Unless the rotor inertia is small, the errors of the parameters of "
                f"{'this effect' if len(effects) == 1 else 'these effects'} exceed their intervals. Declare "
                "rotor_inertia and drive_gain."
            )
        case PayloadFromRatio(least, like_pendulum):
            other = (
                ""
                if like_pendulum is None
                else f" A payload that is shaped like the pendulum would have {like_pendulum:.3g} N*m."
            )
            return (
                "The drive gain is not declared, so the logs show only the ratio of the load's inertia to its gravity "
                f"torque. The payload's moment of {least:.3g} N*m is the smallest that explains this ratio: that of a "
                f"mass close to the axis.{other} A wrong rotor_inertia would look the same. Declare drive_gain to find "
                "the moment itself."
            )
        case GainBesideEffects(effects, drive, gain, declared):
            return (
                f"With {' and '.join(effects)}, the drive gain of the model after is {gain:.4g} {EFFORT_UNIT[drive]} "
                f"per N*m where the rig file declares {declared:.4g}. Only the declared rotor_inertia fixes the scale "
                "of the torques then. If the declared gain is right, the effect is not: check rotor_inertia first (a "
                "servo that filters the velocity of its damping acts as less inertia)."
            )
        case GainDeclaredWrong(drive, gain, declared, factor):
            keys = "proportional_gain" if drive == "position_servo" else "gear_ratio and torque_constant"
            return (
                f"The logs show a drive gain of {gain:.4g} {EFFORT_UNIT[drive]} per N*m where the rig file declares "
                f"{declared:.4g}: each unit of effort makes {factor:.3g} times the declared torque. Check {keys}."
            )
        case _:
            assert_never(note)


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms"
