"""Sentences on the drive that the rig file describes: a servo's own damping, and a torque drive's scale."""

from collections.abc import Mapping

from drake_tc.diagnosis.data.samples import HELD, Samples
from drake_tc.diagnosis.problem.estimates import Estimate
from drake_tc.effects.base import EFFORT_UNIT, DriveKind, Effect
from drake_tc.effects.library import effect
from drake_tc.logs.rig import Rig

NEAR_ONE = 0.02
"""Relative departure of a drive gain from the expected one that is not worth a sentence."""

WORTH_SAYING = 0.05
"""Sampling period over a delay, from which on it is said how much of the delay the instants of sampling may be."""
RECORDED: Mapping[DriveKind, str] = {
    "position_servo": "command",
    "current": "current",
    "voltage": "voltage",
    "torque": "torque of the drive",
}
"""What is recorded of the effort."""

SCALE_ALONE = ("payload", "torque_sensor_gain")
"""Effects that do nothing but scale the torques of a load."""

Parameters = Mapping[str, Mapping[str, Estimate]]


def drive_notes(rig: Rig, joint: str, found: Parameters, fitted_gain: float) -> tuple[str, ...]:
    """What the fitted drive gain and viscous friction say of the drive.

    Args:
        rig: Says the drive's kind and its declared gains.
        joint: Which joint.
        found: Parameters of the final model, by effect.
        fitted_gain: K of the final fit [effort/(N m)], an error of the declared gain included.
    """
    if rig.drive[joint] == "torque" and joint not in rig.drive_gain:
        return _torque_scale(found["drive"]["gain"])
    notes = _other_gain(found, rig.drive_gain.get(joint), EFFORT_UNIT[rig.drive[joint]])
    damping = rig.derivative_gain.get(joint)
    if damping is None:
        return notes
    return (*notes, _own_friction(found["viscous"]["viscous"], rig.drive_gain[joint] * damping / fitted_gain))


def gain_note(found: Parameters, drive: DriveKind) -> tuple[str, ...]:
    """What an error of the declared drive gain is in the terms of the rig file.

    An effort that acts as (1 + e) y at the declared gain K makes the torque of a drive of gain K/(1 + e).
    """
    if "servo_gain" not in found:
        return ()
    declared, factor = found["drive"]["gain"].value, 1.0 + found["servo_gain"]["gain_error"].value
    unit = f"{EFFORT_UNIT[drive]} per N*m"
    keys = "proportional_gain" if drive == "position_servo" else "gear_ratio and torque_constant"
    return (
        f"The logs show a drive gain of {declared / factor:.4g} {unit} where the rig file declares {declared:.4g}: "
        f"each unit of effort makes {factor:.3g} times the declared torque. Check {keys}.",
    )


def late_note(found: Parameters, samples: Samples) -> tuple[str, ...]:
    """How much of a delay or lag that was found the instants of sampling may be, where that is worth saying."""
    period = samples.signals.period
    values = [
        (name, numbers[name].value)
        for key, numbers in found.items()
        for name in ("delay", "lag")
        if key.partition(".")[0] in ("delay", "current_lag") and name in numbers
    ]
    return tuple(
        f"Up to {1e3 * period:.3g} ms (one sampling period) of the {name} of {1e3 * value:.3g} ms may come from the "
        f"instants at which the columns were sampled. The 95 % interval of the {name} does not include this."
        for name, value in values
        if period >= WORTH_SAYING * value
    )


def age_note(samples: Samples, drive: DriveKind) -> tuple[str, ...]:
    """That the command was taken to hold between samples, or that the effort is older than its sample."""
    period, age = f"{1e3 * samples.signals.period:.3g} ms", samples.effort_age
    if age == 0.0:
        return ()
    if age != HELD:
        late = f"{1e3 * age * samples.signals.period:.3g} ms"
        return (
            f"On average, the {RECORDED[drive]} that acts at an instant is {late} older than the one recorded there. "
            f"Sampling within one period ({period}) explains this, so no delay is named; a log at a higher rate could "
            "show a delay of this size.",
        )
    return (
        f"The {RECORDED[drive]} is taken to act unchanged from one sample to the next ({period}); declare "
        "command_hold: false if the samples are points of a continuous curve.",
    )


def _other_gain(found: Parameters, declared: float | None, unit: str) -> tuple[str, ...]:
    """What the size of effects rests on that scale the torques, and that they have moved a declared drive gain."""
    members = [effect(key) for key in found if key != "drive"]
    scaling = [member for member in members if type(member).torque_scale is not Effect.torque_scale]
    gain = found["drive"]["gain"].value
    scale = [member for member in scaling if member.id in SCALE_ALONE]
    if scale and declared is None:
        return (
            f"The size of the {' and the '.join(member.title for member in scale)} rests on the declared "
            "rotor_inertia, which alone fixes the scale of the torques where no drive gain is declared: a wrong "
            "rotor_inertia would look the same. Declare drive_gain to have it checked.",
        )
    if declared is None or not scaling or abs(gain / declared - 1.0) < NEAR_ONE:
        return ()
    return (
        f"With {' and '.join(member.title for member in scaling)}, the drive gain of the model after is {gain:.4g} "
        f"{unit} per N*m where the rig file declares {declared:.4g}. Only the declared rotor_inertia fixes the scale "
        "of the torques then. If the declared gain is right, the effect is not: check rotor_inertia first (a servo "
        "that filters the velocity of its damping acts as less inertia).",
    )


def _torque_scale(gain: Estimate) -> tuple[str, ...]:
    low, high = gain.ci95
    if low <= 1.0 <= high or abs(gain.value - 1.0) < NEAR_ONE:
        return ()
    return (
        f"The fitted drive gain is {gain.value:.3g} N*m of commanded torque for 1 N*m at the joint (95 % interval "
        f"{low:.3g} to {high:.3g}); 1 is expected of a drive that is commanded in N*m. Declare drive_gain: 1 to have "
        "the difference tested as an effect.",
    )


def _own_friction(total: Estimate, servo: float) -> str:
    """The viscous friction without the servo's damping [N m s/rad],  K_0 derivative_gain/K.

    The servo multiplies q_d - q - K_0 derivative_gain qdot by one gain 1/K, so a drive that is stronger than declared
    damps more too.
    """
    begin = (
        f"The identified viscous friction of {total.value:.3g} N*m*s/rad contains the servo's damping of {servo:.3g}"
    )
    if total.ci95[1] < servo:
        return (
            f"The servo's damping of {servo:.3g} N*m*s/rad, computed from derivative_gain, exceeds the identified "
            f"viscous friction of {total.value:.3g} N*m*s/rad: check derivative_gain, and which velocity the servo "
            "uses."
        )
    return f"{begin}; {total.value - servo:.3g} N*m*s/rad are the joint's own."
