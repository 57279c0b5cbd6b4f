"""What a rig declares, taken from a file of another simulator (`drake_tc.simulator_files`).

    armature -> rotor_inertia      damping, frictionloss -> viscous, coulomb      quadratic -> quadratic_viscous
    delay -> delay                 backlash -> backlash                           kp -> drive_gain 1/kp
    stiffness -> cable_spring      lag -> current_lag, of a servo's command       integral_rate -> servo_integrator
    torque_limit/kp -> saturation  kv -> derivative_gain                          friction_stribeck ... -> stribeck
    ripple -> torque_ripple        compliance -> elasticity

Gain, limit, filter, integral action and damping of the drive are taken where the file's drive is of the rig's kind.
A limit is a part of the declared model as every other effect: that of a servo with damping is the form
`saturation.servo`, which limits kp (q_d - q) - kv v as a whole. What the rig file itself says stays. A term that is 0
is not declared: the file's model lacks it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from drake_tc.config.joint_units import JointType, in_units_of
from drake_tc.errors import RigError
from drake_tc.logs.rig_document.declared import Declared
from drake_tc.simulator_files.read import ANY_JOINT, read_joints
from drake_tc.simulator_files.terms import ReadJoint, Terms

if TYPE_CHECKING:
    from drake_tc.logs.rig import Rig

UNITS: Mapping[str, str] = {
    "rotor_inertia": "kg m^2",
    "viscous": "N m s/rad",
    "coulomb": "N m",
    "quadratic_viscous": "N m s^2/rad^2",
    "delay": "s",
    "backlash": "rad",
    "current_lag": "s",
    "current_lag.command": "s",
    "servo_integrator": "1/s",
    "cable_spring.spring_stiffness": "N m/rad",
    "cable_spring.spring_preload": "N m",
    "torque_ripple.ripple_cosine": "N m",
    "torque_ripple.ripple_sine": "N m",
    "torque_ripple.cycles_per_turn": "1/turn",
    "elasticity": "rad/(N m)",
}
EFFORT: Mapping[str, str] = {"position_servo": "rad", "current": "A", "voltage": "V", "torque": "N m"}


@dataclass(frozen=True)
class DeclaredTerms:
    """What a file declares of one joint of a rig.

    Attributes:
        joint: Its name.
        declared: Effect id, or `id.parameter`, to its value; None for a value that is not known.
        drive_gain: K [effort/(N m)], where the file has a drive of the rig's kind.
        saturation: Limit of the effort [rad | A | V | N m], where known.
        derivative_gain: Of a position servo [N m s/rad], where known.
        unused: What the file has beside these, in words.
    """

    joint: str
    declared: Declared
    drive_gain: float | None = None
    saturation: float | None = None
    derivative_gain: float | None = None
    unused: tuple[str, ...] = ()

    def line(self, drive: str, joint_type: JointType = "revolute") -> str:
        """What was taken, as a text for people."""
        told = {name: value for name, value in self.declared.items() if not name.startswith("saturation")}
        parts = [f"{name} {value:.4g} {UNITS.get(name, '')}".rstrip() for name, value in told.items() if value]
        open_ids = [name for name, value in told.items() if value is None]
        parts += [name for name in open_ids if not any(key.startswith(f"{name}.") for key in self.declared)]
        unit = EFFORT[drive]
        parts += [f"drive_gain {self.drive_gain:.4g} {unit} for 1 N m"] if self.drive_gain else []
        parts += [f"saturation {self.saturation:.4g} {unit}"] if self.saturation else []
        parts += [f"derivative_gain {self.derivative_gain:.4g} N m s/rad"] if self.derivative_gain else []
        rest = f"; not used: {', '.join(self.unused)}" if self.unused else ""
        return in_units_of(joint_type, f"{self.joint}: declared: {', '.join(parts) or 'nothing'}{rest}")


def declared_terms(rig: "Rig", path: Path, joints: Sequence[str] = ()) -> list[DeclaredTerms]:
    """What the file declares of joints of the rig.

    Args:
        rig: Names the joints and the kinds of their drives.
        path: URDF, SDFormat, MJCF or a parameter file of BAM; the last one holds for every joint.
        joints: Those that must be in the file; none: those of the rig that are in it, at least one.

    Raises:
        RigError: a file that cannot be used, or that lacks a joint.
    """
    read = read_joints(path, RigError)
    known = [joint for joint in rig.joints if joint in read or ANY_JOINT in read]
    missing = [joint for joint in joints if joint not in known]
    if missing or not known:
        names = ", ".join(missing or rig.joints)
        raise RigError(f"{path}: it has no joint {names}; its joints: {', '.join(read)}")
    return [_of_joint(joint, rig.drive[joint], read.get(joint, read.get(ANY_JOINT))) for joint in joints or known]


def with_declared_file(rig: "Rig", path: Path, joints: Sequence[str] = ()) -> "Rig":
    """The rig with what a file declares; what the rig itself says stays.

    Args:
        rig: As its own file has it.
        path: See `declared_terms`.
        joints: See `declared_terms`.

    Raises:
        RigError: see `declared_terms`.
    """
    found = declared_terms(rig, path, joints)
    declared = dict(rig.declared)
    for each in found:
        own = {name: value for name, value in declared[each.joint].items() if value is not None or name not in ALWAYS}
        declared[each.joint] = dict.fromkeys(ALWAYS) | dict(each.declared) | own
    stated = {
        name: {each.joint: getattr(each, name) for each in found if getattr(each, name) is not None}
        for name in ("drive_gain", "saturation", "derivative_gain")
    }
    changed = {name: {**values, **getattr(rig, name)} for name, values in stated.items()}
    told = tuple(f"{path}: {each.line(rig.drive[each.joint], rig.joint_type(each.joint))}" for each in found)
    return replace(rig, declared=declared, declared_by_files=(*rig.declared_by_files, *told), **changed)  # type: ignore[arg-type]


LEAST_CYCLES = 1.5
"""Fewest cycles per turn of a torque ripple: no log tells a slower one from the weight of the link."""
ALWAYS = ("viscous", "coulomb")
"""Part of every declared model, whether a file has values or not."""


def _of_joint(joint: str, drive: str, read: ReadJoint | None) -> DeclaredTerms:
    if read is None:
        raise RigError(f"no joint {joint}")
    terms, same = read.terms, read.driven and read.terms.drive == drive
    values = {
        "rotor_inertia": terms.armature,
        "viscous": terms.damping,
        "coulomb": terms.frictionloss,
        "quadratic_viscous": terms.quadratic,
        "delay": terms.delay,
        "backlash": terms.backlash,
        "elasticity": terms.compliance,
    }
    declared: dict[str, float | None] = {name: value for name, value in values.items() if value > 0.0}
    declared |= _springs(terms)
    if terms.ripple is not None and terms.ripple.cycles < LEAST_CYCLES:
        slow = f"a torque ripple of {terms.ripple.cycles:.3g} cycles per turn (the least is {LEAST_CYCLES:g})"
        read = read.also_unused(slow)
    for effect, parameters in read.effects.items():
        declared[effect] = None
        declared |= {f"{effect}.{name}": value for name, value in (parameters or {}).items()}
    if not same:
        unused = [f"its drive ({terms.drive})"] if read.driven else []
        unused += [f"its limit of the torque ({terms.torque_limit:.4g} N m)"] if terms.torque_limit is not None else []
        return DeclaredTerms(joint, declared, unused=(*read.unused, *unused))
    gain = abs(terms.kp)
    limit = terms.torque_limit / gain if terms.torque_limit is not None and gain else None
    damping = read.derivative_gain if read.derivative_gain > 0.0 else None
    if terms.lag:
        declared["current_lag.command" if drive == "position_servo" else "current_lag"] = terms.lag
    if terms.integral_rate:
        declared["servo_integrator"] = terms.integral_rate
    inside = (read.derivative_gain + terms.derivative_gain) / gain if gain else 0.0
    if limit is not None and inside > 0.0:
        declared |= {"saturation.servo": None, "saturation.servo.limit": limit}
        declared["saturation.servo.derivative_time"] = inside
    elif limit is not None:
        declared["saturation"] = limit
    return DeclaredTerms(
        joint,
        declared,
        drive_gain=1.0 / gain if gain else None,
        saturation=limit,
        derivative_gain=damping,
        unused=(*read.unused, *(("that its torque is against the command",) if terms.kp < 0.0 else ())),
    )


def _springs(terms: Terms) -> dict[str, float | None]:
    """Declared torques over the position and the peak of dry friction."""
    found: dict[str, float | None] = {}
    if terms.stiffness or terms.preload:
        found |= {"cable_spring": None, "cable_spring.spring_stiffness": terms.stiffness}
        found["cable_spring.spring_preload"] = terms.preload
    if terms.ripple is not None and terms.ripple.cycles >= LEAST_CYCLES:
        found |= {"torque_ripple": None, "torque_ripple.ripple_cosine": terms.ripple.cosine}
        found |= {"torque_ripple.ripple_sine": terms.ripple.sine}
        found |= {"torque_ripple.cycles_per_turn": terms.ripple.cycles}
    return found
