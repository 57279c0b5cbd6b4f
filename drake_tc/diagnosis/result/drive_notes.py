"""Notes on the drive that the rig file describes: its gain, its timing, and a servo's own damping."""

from collections.abc import Callable, Mapping, Sequence

from drake_tc.actuation.recorded_run import NEEDS_LOAD
from drake_tc.diagnosis.data.load_scale import load_scale
from drake_tc.diagnosis.data.samples import HELD, Samples
from drake_tc.diagnosis.load_notes import ConstantBesidePendulum
from drake_tc.diagnosis.notes import (
    DriveNote,
    FarFromRotor,
    GainBesideEffects,
    GainDeclaredWrong,
    GainOfTorqueDrive,
    LoadWithRotor,
    PayloadFromRatio,
    ServoDamping,
    SizeByRotorInertia,
    ZeroOfEffort,
)
from drake_tc.diagnosis.problem.estimates import Estimate
from drake_tc.diagnosis.result.experiments import SAME_SCALE
from drake_tc.diagnosis.result.joint_result import FoundEffect
from drake_tc.diagnosis.timing_notes import (
    DelayBySampling,
    HeldEffort,
    OlderEffort,
    PositionRecordedLate,
    RecordedLate,
    TorqueRecordedLate,
    ViscousByAge,
)
from drake_tc.effects.base import Context, DriveKind, Effect
from drake_tc.effects.effort_bias import EffortBias
from drake_tc.effects.library import effect
from drake_tc.effects.payload import Payload
from drake_tc.effects.unknown_load import PENDULUM
from drake_tc.logs.loads import Pendulum
from drake_tc.logs.rig import Rig

NEAR_ONE = 0.02
"""Relative departure of a drive gain from the expected one that is not worth a note."""

WORTH_SAYING = 0.05
"""Smallest share of a delay, or of the viscous friction, that the instants of sampling may explain and that is worth a
note."""
SCALE_ALONE = ("torque_sensor_gain",)
"""Effects that do nothing but scale the torques of a load."""
PENDULUM_PAYLOAD = "payload.pendulum"
"""Key of a payload whose moment only the ratio of inertia to gravity torque tells."""

OFFSETS: Mapping[str, str] = {"effort_bias": "bias_torque", "asymmetric_friction.coulomb": "coulomb_asymmetry"}
"""Parameter that is a constant torque, by key of the effects of this form."""
ZERO_OF_DATA_SHEETS = 0.03
"""Largest offset of a current sensor by common data sheets, over full scale, which the recorded efforts do not exceed.

(Allegro ACS712, a Hall sensor: total output error of 1.5 % at 25 deg C, and as much again over temperature.)
"""
FAR_FROM_ROTOR = 30.0
"""Inertia of a payload over the declared one of the rotor from which on a unit may be wrong: below the factors of N*mm
(1000) and of an inertia on the motor's side (the gear ratio squared), above what loads usually are."""
Parameters = Mapping[str, Mapping[str, Estimate]]


def drive_notes(rig: Rig, joint: str, found: Parameters, fitted_gain: float) -> tuple[DriveNote, ...]:
    """What the fitted drive gain and viscous friction say of the drive.

    Args:
        rig: Says the drive's kind and its declared gains.
        joint: Which joint.
        found: Parameters of the final model, by effect.
        fitted_gain: K of the final fit [effort/(N m)], an error of the declared gain included.
    """
    far = _far_from_rotor(rig, joint, found)
    load: tuple[DriveNote, ...] = (*far, *_payload(rig, joint, found), *_with_rotor(rig, joint, found))
    load = (*load, *_constant(found, rig.drive[joint], fitted_gain))
    if rig.drive[joint] == "torque" and joint not in rig.drive_gain:
        return (*_torque_scale(found["drive"]["gain"]), *load)
    notes = (*_other_gain(found, rig.drive_gain.get(joint), rig.drive[joint]), *load)
    damping = rig.derivative_gain.get(joint)
    if damping is None:
        return notes
    return (*notes, _own_friction(found["viscous"]["viscous"], rig.drive_gain[joint] * damping / fitted_gain))


def scale_alternatives(rig: Rig, joint: str, found: Parameters) -> tuple[tuple[str, str], ...]:
    """Pairs (effect, "rotor_inertia"): effects that a wrong declared rotor inertia imitates exactly.

    Without a declared drive gain, all torques, 1/K and the rotor inertia J may be multiplied by one factor. A torque
    sensor that reads a share e too much and a rotor whose inertia is (1 + e) J leave the same balance.
    """
    if joint in rig.drive_gain or not rig.known(joint, "rotor_inertia") > 0.0:
        return ()
    return (SAME_SCALE,) if SAME_SCALE[0] in {key.partition(".")[0] for key in found} else ()


def gain_note(found: Parameters, drive: DriveKind) -> tuple[GainDeclaredWrong, ...]:
    """What an error of the declared drive gain is in the terms of the rig file.

    An effort that acts as (1 + e) y at the declared gain K makes the torque of a drive of gain K/(1 + e).
    """
    if "servo_gain" not in found:
        return ()
    declared, factor = found["drive"]["gain"].value, 1.0 + found["servo_gain"]["gain_error"].value
    return (GainDeclaredWrong(drive, declared / factor, declared, factor),)


def zero_of_effort(
    effects: Sequence[FoundEffect], alternatives: Sequence[tuple[str, str]], gain: float, context: Context
) -> tuple[ZeroOfEffort, ...]:
    """Effects that an offset of the effort would look like, if it were as small as data sheets allow.

    Args:
        effects: That were found.
        alternatives: Pairs (effect, another one that explains as much).
        gain: K of the final fit [effort/(N m)].
        context: Holds the largest effort in the logs, and a declared tolerance, which leaves nothing to say.
    """
    out = []
    for found in () if EffortBias.id in context.tolerances else effects:
        name = OFFSETS.get(found.key)
        may_be = found.id == EffortBias.id or (found.id, EffortBias.id) in alternatives
        if name is not None and may_be:
            offset = abs(found.parameters[name].value) * gain
            if offset <= ZERO_OF_DATA_SHEETS * context.effort:
                out.append(ZeroOfEffort(found.title, context.drive, offset, offset / context.effort))
    return tuple(out)


def late_note(found: Parameters, samples: Samples) -> tuple[DelayBySampling, ...]:
    """How much of a delay or lag that was found the instants of sampling may be, where that is worth saying."""
    period = samples.signals.period
    values = [
        (name, numbers[name].value)
        for key, numbers in found.items()
        for name in ("delay", "lag")
        if key.partition(".")[0] in ("delay", "current_lag") and name in numbers
    ]
    return tuple(DelayBySampling(name, value, period) for name, value in values if period >= WORTH_SAYING * value)


def age_note(samples: Samples, drive: DriveKind) -> tuple[DriveNote, ...]:
    """Notes that the command is taken to hold between samples, or that a column is older or younger than its sample."""
    period, age = samples.signals.period, samples.effort_age
    late: tuple[DriveNote, ...] = ()
    if samples.position_late != 0.0:
        late = (PositionRecordedLate(samples.position_late),)
    elif samples.torque_late != 0.0:
        late = (TorqueRecordedLate(samples.torque_late),)
    if age == 0.0:
        return late
    if age < 0.0:
        return (RecordedLate(drive, -age * period),)
    return (*late, HeldEffort(drive, period) if age == HELD else OlderEffort(drive, age * period, period))


def viscous_age_note(
    stated: bool | None, samples: Samples, found: Parameters, drive: DriveKind, error_of_age: Callable[[], float]
) -> tuple[ViscousByAge, ...]:
    """How wrong a servo's viscous friction may be because the age of its command is not known.

    An error d of the command's age changes the servo's torque by about K d qdot, with the stiffness K of the servo
    [N m/rad], and a fit attributes this torque to viscous friction. A log hardly shows d within one period T: at most
    T/2, or what the rows do not exclude. There is a note if K d exceeds both half the width of the 95 % interval and a
    twentieth of the friction.

    Args:
        stated: `command_hold` of the rig file; None where it does not say.
        samples: Training rows.
        found: Parameters of the final model, by effect.
        drive: Kind of drive.
        error_of_age: Gives the largest d that the rows do not exclude [sampling periods]; asked only if it matters.
    """
    if stated is not None or drive != "position_servo":
        return ()
    viscous, period = found["viscous"]["viscous"], samples.signals.period
    per_period = period / found["drive"]["gain"].value
    least = max(0.5 * (viscous.ci95[1] - viscous.ci95[0]), WORTH_SAYING * viscous.value)
    if HELD * per_period <= least:
        return ()
    shift = error_of_age() * per_period
    return (ViscousByAge(shift, period),) if shift > least else ()


def _other_gain(found: Parameters, declared: float | None, drive: DriveKind) -> tuple[DriveNote, ...]:
    """What the size of effects rests on that scale the torques, and that they have moved a declared drive gain."""
    members = [effect(key) for key in found if key != "drive"]
    scaling = [member for member in members if type(member).torque_scale is not Effect.torque_scale]
    gain = found["drive"]["gain"].value
    scale = [member for member in scaling if member.id in SCALE_ALONE]
    if scale and declared is None:
        return (SizeByRotorInertia(tuple(member.title for member in scale)),)
    if declared is None or not scaling or abs(gain / declared - 1.0) < NEAR_ONE:
        return ()
    return (GainBesideEffects(tuple(member.title for member in scaling), drive, gain, declared),)


def _far_from_rotor(rig: Rig, joint: str, found: Parameters) -> tuple[FarFromRotor, ...]:
    """A payload that is so large beside the declared rotor inertia that the two may have different units."""
    rotor = rig.known(joint, "rotor_inertia")
    out = []
    for key, values in found.items():
        member = effect(key) if key != "drive" else None
        if rotor > 0.0 and isinstance(member, Payload) and member.inertia_parameter in values:
            ratio = values[member.inertia_parameter].value / rotor
            out += [FarFromRotor(member.title, ratio)] if ratio >= FAR_FROM_ROTOR else []
    return tuple(out)


def _payload(rig: Rig, joint: str, found: Parameters) -> tuple[PayloadFromRatio, ...]:
    """What the moment of a payload rests on, and what it is with the pendulum's own ratio of inertia to moment.

    With G, I the pendulum's moment and inertia, J the rotor's and G_p the fitted moment, a share s more of the pendulum
    leaves the same ratio:  (J + (1 + s) I)/((1 + s) G) = (J + I)/(G + G_p).
    """
    load = rig.load[joint]
    if PENDULUM_PAYLOAD not in found or not isinstance(load, Pendulum):
        return ()
    least = found[PENDULUM_PAYLOAD]["payload_moment"].value
    rotor = rig.known(joint, "rotor_inertia")
    if "rotor_inertia" in found:
        rotor = found["rotor_inertia"]["rotor_inertia"].value
    left = (rotor + load.inertia) * load.weight / (load.weight + least) - load.inertia
    if load.by_run or left <= 0.0:
        return (PayloadFromRatio(least, None),)
    return (PayloadFromRatio(least, load.weight * (rotor / left - 1.0)),)


def _with_rotor(rig: Rig, joint: str, found: Parameters) -> tuple[LoadWithRotor, ...]:
    """A note if effects depend on the torque in the gear and the fitted inertia of the load includes the rotor's.

    The gear transmits J_l qddot + G(q). Where no rotor inertia J is declared, the fitted load is
    (J_l + J) qddot + G(q).
    """
    scale = load_scale(rig, joint)
    followers = tuple(effect(key).title for key in found if key.partition(".")[0] in NEEDS_LOAD)
    unknown = scale.fitted_inertia and scale.rotor_inertia == 0.0
    return (LoadWithRotor(followers),) if unknown and followers else ()


def _constant(found: Parameters, drive: DriveKind, gain: float) -> tuple[ConstantBesidePendulum, ...]:
    """A note if an unknown pendulum has a constant torque that is worth saying beside the Coulomb friction.

    While the joint slides, an offset of the effort and friction that depends on the direction are constants too.
    """
    constant = found.get(PENDULUM.key, {}).get("constant")
    if constant is None:
        return ()
    coulomb = found["coulomb"]["coulomb"].value
    low, high = constant.ci95
    if low <= 0.0 <= high or abs(constant.value) < WORTH_SAYING * coulomb:
        return ()
    return (ConstantBesidePendulum(drive, constant.value * gain, abs(constant.value) / max(coulomb, 1e-300)),)


def _torque_scale(gain: Estimate) -> tuple[GainOfTorqueDrive, ...]:
    low, high = gain.ci95
    if low <= 1.0 <= high or abs(gain.value - 1.0) < NEAR_ONE:
        return ()
    return (GainOfTorqueDrive(gain.value, low, high),)


def _own_friction(total: Estimate, servo: float) -> ServoDamping:
    """The viscous friction without the servo's damping [N m s/rad],  K_0 derivative_gain/K.

    The servo multiplies q_d - q - K_0 derivative_gain qdot by one gain 1/K, so a drive that is stronger than declared
    damps more too.
    """
    return ServoDamping(total.value, servo, exceeds=total.ci95[1] < servo)
