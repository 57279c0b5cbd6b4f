"""The rig file's key `declared`: the effects that the user already models, with values where they are known.

`logs` must not import the library of effects, so a test compares it with the names here; effects of other packages are
known by their names in `drake_tc.extensions.EFFECTS`.

Files of other simulators (`drake_tc.simulator_files`) declare:

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

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

from pydantic import AfterValidator, Discriminator, Tag, WithJsonSchema

from drake_tc.config.joint_units import JointType, in_units_of
from drake_tc.config.keys import saying
from drake_tc.config.quoted import did_you_mean, quoted
from drake_tc.config.yaml_file import read_yaml
from drake_tc.errors import DrakeTcError, RigError
from drake_tc.extensions import EFFECTS
from drake_tc.logs.loads import Load, Pendulum
from drake_tc.logs.units import JOINT_SUFFIXES, joint_type_of_unit
from drake_tc.simulator_files.read import ANY_JOINT, ENDINGS, read_joints
from drake_tc.simulator_files.terms import ReadJoint, Terms
from drake_tc.simulator_files.urdf import resolve

if TYPE_CHECKING:
    from drake_tc.logs.rig import Rig

EFFECT_IDS = (
    *("viscous", "coulomb", "rotor_inertia", "stribeck", "quadratic_viscous", "load_dependent_friction"),
    *("asymmetric_friction", "presliding_hysteresis", "position_dependent_friction", "thermal_friction"),
    *("torque_ripple", "cable_spring", "backlash", "elasticity", "deadzone", "saturation", "servo_integrator"),
    *("velocity_sign_switch", "delay", "current_lag", "payload", "torque_sensor_bias", "torque_sensor_gain"),
    *("torque_sensor_drift", "effort_bias", "encoder_offset", "encoder_eccentricity", "encoder_ripple"),
    *("directional_efficiency", "position_dependent_load", "supply_sag", "winding_temperature", "servo_gain"),
    "static_friction",
    *("load_stribeck", "drive_compression", "winding_heat", "load_tilt", "gain_ripple"),
    *("saturation.servo", "current_lag.command"),
)

ROBOT_CAUSES = ("link_mass", "link_com", "ft_bias", "ft_gain", "imu_bias")
"""Causes that no single joint owns; they can be found, but not declared."""


def _known_effect(name: str) -> str:
    if name in ROBOT_CAUSES:
        raise ValueError(
            f"{quoted(name)} is a cause of the whole robot and cannot be declared; `sensors` takes tolerances"
        )
    known = (*EFFECT_IDS, *EFFECTS.names())
    if name not in known:
        possible = did_you_mean(name, known) or f"; known: {', '.join(known)}"
        raise ValueError(f"unknown effect {quoted(name)}{possible}")
    return name


EffectId = Annotated[
    str,
    saying("the id of an effect"),
    AfterValidator(_known_effect),
    WithJsonSchema({"type": "string", "enum": list(EFFECT_IDS)}),
]
Declared: TypeAlias = Mapping[str, float | None]
Value: TypeAlias = Annotated[float, saying("a number, or nothing for 'value unknown'")] | None


def _value_shape(value: object) -> str:
    return "@parameters" if isinstance(value, Mapping) else "@value"


Values: TypeAlias = Annotated[
    Annotated[Value, Tag("@value")] | Annotated[dict[str, Value], Tag("@parameters")], Discriminator(_value_shape)
]


def _not_negative(values: dict[str, Values]) -> dict[str, Values]:
    inertia = values.get("rotor_inertia")
    if isinstance(inertia, Mapping):
        inertia = inertia.get("rotor_inertia")
    if inertia is not None and inertia < 0:
        raise ValueError(f"rotor_inertia: expected a value >= 0 kg m^2, got {quoted(inertia)}")
    return values


def _shape(value: object) -> str | None:
    if isinstance(value, Mapping):
        return "@values"
    if isinstance(value, list):
        return "@list"
    return "@file" if isinstance(value, str) and is_file(value) else "@name"


def is_file(entry: str) -> bool:
    """Whether the text names a file of another simulator, and not an effect."""
    return entry.lower().endswith(ENDINGS)


DeclaredFile = Annotated[
    str,
    saying("a file of another simulator"),
    WithJsonSchema({"type": "string", "pattern": f"({'|'.join(re.escape(ending) for ending in ENDINGS)})$"}),
]


DeclaredEntry: TypeAlias = Annotated[
    Annotated[EffectId, Tag("@name")]
    | Annotated[DeclaredFile, Tag("@file")]
    | Annotated[list[EffectId], Tag("@list")]
    | Annotated[dict[EffectId, Values], AfterValidator(_not_negative), Tag("@values")],
    Discriminator(_shape),
]


def declared_of(entry: str | list[str] | dict[str, Values] | None) -> dict[str, float | None]:
    """`id` and `id.parameter` to the known value, or None; viscous and Coulomb friction are always in it.

    What a file declares is not in it: `with_declared_file` adds it to the rig.
    """
    declared: dict[str, float | None] = {"viscous": None, "coulomb": None}
    if isinstance(entry, str) and is_file(entry):
        return declared
    if isinstance(entry, str):
        entry = [entry]
    if isinstance(entry, list):
        return declared | dict.fromkeys(entry)
    for name, value in (entry or {}).items():
        if isinstance(value, Mapping):
            declared |= {name: None} | {f"{name}.{parameter}": number for parameter, number in value.items()}
        else:
            declared[name] = value
    return declared


MOTION = {"revolute": "turns", "prismatic": "slides"}


def joint_types(
    joints: Sequence[str],
    stated: Mapping[str, JointType | None],
    robot: Path | None,
    units: Mapping[str, str | float],
) -> dict[str, JointType]:
    """The type of each joint: that of the URDF, or stated, or that to which a unit of its columns belongs.

    Args:
        joints: Names.
        stated: By joint, what the rig file says; None where it does not.
        robot: The robot file, whose URDF has the types of its joints.
        units: The key `units` of the rig file. A unit of a channel of all joints, such as `velocity: rpm`, holds
            for the joints of its type if there are such: the others need not have the channel (`require_own_unit`).

    Raises:
        ValueError: They contradict each other; begins with the key.
    """
    known = _robot_joint_types(robot)
    out: dict[str, JointType] = {}
    for joint in joints:
        said, modelled = stated.get(joint), known.get(joint)
        if said is not None and modelled is not None and said != modelled:
            raise ValueError(f"joint_type: {joint} is {modelled} in the URDF of {robot}, got {said}")
        by_unit = next((kind for _, kind in _entries(joint, units)), None)
        out[joint] = modelled or said or by_unit or "revolute"
    for joint, kind in out.items():
        for key, other in _entries(joint, units):
            if other != kind and not (_may_be_missing(key) and other in out.values()):
                raise ValueError(_of_other_type(joint, kind, key, units[key], other))
    return out


def require_own_unit(canonical: str, kind: JointType, units: Mapping[str, str | float]) -> None:
    """Refuse a recorded channel of a joint whose only unit is that of all joints of the other type.

    Raises:
        ValueError: Begins with the key `units`.
    """
    joint, _, suffix = canonical.rpartition("/")
    for key, other in _entries(joint, units):
        if key in (canonical, suffix) and other != kind:
            raise ValueError(_of_other_type(joint, kind, key, units[key], other))


def _robot_joint_types(robot: Path | None) -> dict[str, JointType]:
    """Types of the moving joints of a robot file's URDF; none where it cannot be read (others say so)."""
    if robot is None:
        return {}
    try:
        document = read_yaml(robot, error=RigError)
        urdf = document.get("urdf") if isinstance(document, Mapping) else None
        text = resolve(str(urdf), robot.parent).read_bytes()
        found = ET.fromstring(text).findall("joint")
    except (DrakeTcError, OSError, ET.ParseError, ValueError):
        return {}
    kinds: dict[str, JointType] = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic"}
    types = ((joint.get("name", ""), joint.get("type", "")) for joint in found)
    return {name: kinds[kind] for name, kind in types if kind in kinds}


def check_sliding_loads(load: Mapping[str, Load], types: Mapping[str, JointType]) -> None:
    """A pendulum turns.

    Raises:
        ValueError: It is the load of a joint that slides; begins with the key.
    """
    for joint, entry in load.items():
        if isinstance(entry, Pendulum) and types[joint] == "prismatic":
            raise ValueError(
                f"load: {joint} slides (joint_type: prismatic), and a pendulum turns; possible: torque (a force "
                "sensor), unknown (a mass and a constant force, both fitted), or {robot: ...}"
            )


def _entries(joint: str, units: Mapping[str, str | float]) -> list[tuple[str, JointType]]:
    """Keys of `units` that hold for a channel of the joint, with the type of joint to which the unit belongs."""
    keys = [key for suffix in JOINT_SUFFIXES for key in (f"{joint}/{suffix}", suffix) if key in units]
    own = [key for key in keys if "/" in key or f"{joint}/{key}" not in units]
    found = ((key, joint_type_of_unit(units[key])) for key in own)
    return [(key, kind) for key, kind in found if kind is not None]


def _may_be_missing(key: str) -> bool:
    """Whether an entry of `units` is for a channel of all joints that one of them may lack."""
    return "/" not in key and key not in ("position", "position_command")


def _of_other_type(joint: str, kind: JointType, key: str, unit: str | float, other: JointType) -> str:
    suffix = key.rpartition("/")[2]
    listed = ", ".join(unit for unit in JOINT_SUFFIXES[suffix] if joint_type_of_unit(unit) == kind)
    own = "" if "/" in key else f" `{joint}/{suffix}` gives {joint} a unit of its own;"
    return (
        f"units: {key}: {unit!r} is a unit of a joint that {MOTION[other]}, and {joint} {MOTION[kind]} "
        f"(joint_type: {kind});{own} possible: {listed}, or a number (scale factor to "
        f"{in_units_of(kind, next(iter(JOINT_SUFFIXES[suffix])))})"
    )


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
        RigError: a file that cannot be used, that lacks a joint, or whose joint has another type than in the rig file.
    """
    read = read_joints(path, RigError)
    known = [joint for joint in rig.joints if joint in read or ANY_JOINT in read]
    missing = [joint for joint in joints if joint not in known]
    if missing or not known:
        names = ", ".join(missing or rig.joints)
        raise RigError(f"{path}: it has no joint {names}; its joints: {', '.join(read)}")
    for joint in joints or known:
        there, here = read[joint if joint in read else ANY_JOINT].joint_type, rig.joint_type(joint)
        if there is not None and there != here:
            raise RigError(
                f"{path}: joint {joint!r} is {there}, but {here} in the rig file; state joint_type: {there} there"
            )
    return [_of_joint(joint, rig.drive[joint], read.get(joint, read.get(ANY_JOINT))) for joint in joints or known]


def with_declared_file(rig: "Rig", path: Path, joints: Sequence[str] = ()) -> "Rig":
    """The rig with what a file declares of these or all joints (`declared_terms`); what the rig itself says stays.

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
    read = read.also_unused(*(f"its negative {name} ({value:.4g})" for name, value in values.items() if value < 0.0))
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
