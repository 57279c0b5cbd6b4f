"""Joints and actuators of an MJCF file, with what it includes and the attributes that default classes give them.

Read are of a joint armature, frictionloss, damping (d0 d1 d2: the force -(d0 + d1 |v| + d2 v^2) v), stiffness with
springref, and actuatorfrcrange; of its actuators kind, gain, damping, gear, filter, delay and force limit. The torque
of a position servo is gear^2 (kp (q_d - q) - kv v), clipped as a whole, where the command is the joint's position. A
velocity actuator beside it adds its kv.

A second hinge of the same body about the same axis, without an actuator, is the gear: its play where it is free within
a small range, its compliance where it has a spring. Every other attribute that is physics is listed as not used.
"""

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from drake_tc.simulator_files.mjcf_actuator import Actuator, actuators
from drake_tc.simulator_files.terms import ReadJoint, Ripple, StribeckPeak, Terms
from drake_tc.simulator_files.xml_tree import (
    Attributes,
    Defaults,
    bodies,
    finite,
    in_degrees,
    mujoco_module,
    place,
    with_includes,
)

PLAY = "_backlash"
"""End of the name of a hinge that is the play of a gear."""
MOST_PLAY = {"hinge": 0.2, "slide": 0.02}
"""Largest range of a joint that is taken for the play of a gear [rad], [m]."""
JOINT_USED = {
    *("name", "class", "type", "pos", "axis", "group", "user", "armature", "frictionloss", "damping", "stiffness"),
    *("springref", "ref", "margin", "solreffriction", "solimpfriction", "solreflimit", "solimplimit", "limited"),
    *("range", "actuatorfrcrange", "actuatorfrclimited", "springdamper"),
}
HARD = {"solreffriction": (0.0, 0.02), "solimpfriction": (0.9, 1.0)}
"""First numbers with which the dry friction of a joint creeps no faster than with MuJoCo's defaults."""
ACTUATOR_USED = {
    *("name", "class", "joint", "jointinparent", "gear", "group", "user", "nsample", "interp", "forcerange"),
    *("forcelimited", "ctrlrange", "ctrllimited", "delay", "damping", "armature", "kp", "kv", "dampratio", "timeconst"),
    *("gainprm", "biasprm", "dynprm", "dyntype", "gaintype", "biastype", "actlimited", "actearly", "lengthrange"),
    *("cranklength", "inheritrange", "actdim", "actrange"),
}
DC_MOTOR_USED = {"motorconst", "resistance", "saturation", "inductance", "cogging", "lugre", "input"}
PID_USED = {"ki", "input"}
BY_MUJOCO = "which needs MuJoCo: it is not installed (pip install 'drake-tc[mujoco]') or does not load the file"
SYMMETRIC = 1e-6


@dataclass(frozen=True)
class MjcfJoint:
    """A joint of an MJCF file.

    Attributes:
        element: Of the tree.
        values: Its attributes, those of default classes among them.
        body: The body that it moves.
        actuators: Those that drive it, in the order of the file.
    """

    element: ET.Element
    values: Attributes
    body: ET.Element
    actuators: tuple[Actuator, ...]

    @property
    def kind(self) -> str:
        """hinge, slide, ball or free."""
        return self.values.get("type", "hinge")

    def numbers(self, name: str, absent: str = "0") -> list[float]:
        """The numbers of an attribute."""
        return finite(self.element, name, self.values.get(name) or absent)


def joints_of(root: ET.Element) -> dict[str, MjcfJoint]:
    """Named hinges and slides of a file, by name."""
    defaults = Defaults(root)
    driving: dict[str, list[Actuator]] = {}
    flags, groups = _disabled(root), disabled_groups(root)
    for each in actuators(root, defaults):
        each.enabled = each.values.get("group", "0") not in groups
        if "clampctrl" in flags:
            each.values["ctrllimited"] = "false"
        name = each.values.get("joint") or each.values.get("jointinparent") or ""
        driving.setdefault(name, []).append(each)
    found = {}
    for body, own in bodies(root):
        for element, around in own:
            name, values = element.get("name", ""), defaults.attributes(element, around)
            if name and element.tag == "joint" and values.get("type", "hinge") in ("hinge", "slide"):
                found[name] = MjcfJoint(element, values, body, tuple(driving.get(name, ())))
    return found


def gears_of(joints: Mapping[str, MjcfJoint], *, degrees: bool) -> dict[str, str]:
    """Joints that are the play or the spring of a gear, to the driven joint beside them."""
    found = {}
    for name, joint in joints.items():
        if joint.actuators:
            continue
        for other, driven in joints.items():
            beside = driven.body is joint.body and driven is not joint and driven.kind == joint.kind
            named = name == other + PLAY
            if not beside or not (named or driven.actuators):
                continue
            if _same_axis(joint, driven) and (named or _play(joint, degrees=degrees) or _spring(joint)):
                found[name] = other
    return found


def _same_axis(one: MjcfJoint, other: MjcfJoint) -> bool:
    a, b = one.numbers("axis", "0 0 1"), other.numbers("axis", "0 0 1")
    near = [abs(x * math.hypot(*b) - y * math.hypot(*a)) < 1e-9 for x, y in zip(a, b, strict=False)]
    return all(near) and one.numbers("pos", "0 0 0") == other.numbers("pos", "0 0 0")


def _play(joint: MjcfJoint, *, degrees: bool) -> float:
    """Range of a free joint that is small; 0 where it is not such a joint."""
    span = [*joint.numbers("range", ""), 0.0, 0.0]
    if joint.values.get("limited") == "false" or any(joint.numbers("stiffness")):
        return 0.0
    width = (span[1] - span[0]) * (math.pi / 180.0 if degrees and joint.kind == "hinge" else 1.0)
    return width if 0.0 < width <= MOST_PLAY[joint.kind] else 0.0


def _spring(joint: MjcfJoint) -> float:
    """Stiffness of a joint that has nothing else; 0 where it is not such a joint."""
    stiffness = joint.numbers("stiffness")
    return 0.0 if any(stiffness[1:]) or any(joint.numbers("frictionloss")) else stiffness[0]


def mjcf_joints(root: ET.Element, path: Path) -> dict[str, ReadJoint]:
    """What the file says of each named hinge or slide, by name; its includes are found from its path.

    Raises:
        ValueError: an attribute that is no number, an include that is not there, or an element that makes joints from
            other files; names element and line.
    """
    root = with_includes(root, path)
    for tag in ("attach", "replicate"):
        for each in root.iter(tag):
            if tag == "attach" or each.find(".//joint") is not None:
                raise ValueError(
                    f"{place(each)}: it makes joints of other names, which are not read; write the file as MuJoCo "
                    "expands it: mujoco.mj_saveLastXML"
                )
    joints, degrees = joints_of(root), in_degrees(root)
    gears = gears_of(joints, degrees=degrees)
    made = _compiled_by_mujoco(joints, path)
    outside, flags, everywhere = _couplings(root), _disabled(root), _beside_joints(root)
    found = {}
    for name, joint in joints.items():
        if name in gears:
            continue
        read = _driven(_passive(joint, degrees=degrees, flags=flags), joint, flags, made)
        if name + PLAY in joints and name + PLAY not in gears:
            read = read.also_unused(
                f"its play {place(joints[name + PLAY].element)}, which is not on the same body and axis"
            )
        for other in (each for each, driven in gears.items() if driven == name):
            read = _with_gear(read, joints[other], degrees=degrees, flags=flags)
        found[name] = _with_springdamper(read, joint, flags, made).also_unused(
            *outside.get(name, ()), *_of_body(joint), *everywhere
        )
    return found


def _with_gear(read: ReadJoint, gear: MjcfJoint, *, degrees: bool, flags: set[str]) -> ReadJoint:
    names = ("damping", "armature", "frictionloss")
    rest = [f"{name} of {place(gear.element)}" for name in names if any(gear.numbers(name))]
    if "spring" in flags and _spring(gear):
        return read.also_unused(f"{place(gear.element)} beside it, whose spring is switched off", *rest)
    if stiffness := _spring(gear):
        rest += [f"range of {place(gear.element)}"] if gear.values.get("range") else []
        return read.with_terms(compliance=1.0 / stiffness).also_unused(*rest)
    play = 0.0 if "limit" in flags else _play(gear, degrees=degrees)
    rest += [] if play else [f"the play {place(gear.element)}, whose range is too wide or does not act"]
    return read.with_terms(backlash=play).also_unused(*rest)


def _passive(joint: MjcfJoint, *, degrees: bool, flags: set[str]) -> ReadJoint:
    damping, stiffness = ([*joint.numbers(name), 0.0, 0.0, 0.0][:3] for name in ("damping", "stiffness"))
    unit = math.pi / 180.0 if degrees and joint.kind == "hinge" else 1.0
    rest = joint.numbers("springref")[0] * unit
    unused = [name for name in joint.values if name not in JOINT_USED]
    if any(joint.numbers("frictionloss")):
        stated = ((name, number) for name in HARD for number in joint.numbers(name, "")[:1])
        soft = ((name, number) for name, number in stated if not HARD[name][0] <= number <= HARD[name][1])
        unused += [f"its {name} ({number:g})" for name, number in soft]
    if damping[2]:
        unused.append("the third number of its damping")
    if any(stiffness[1:]):
        unused.append("the stiffness that depends on the deflection")
    if joint.values.get("range") and joint.values.get("limited") != "false":
        unused.append("its limits of the position (range)")
    forces = {"damper": "damping", "spring": "stiffness", "frictionloss": "frictionloss"}
    off = [name for flag, name in forces.items() if flag in flags and any(joint.numbers(name))]
    unused += [f"its {name}, which <flag> disables" for name in off]
    spring = 0.0 if "spring" in flags else stiffness[0]
    terms = Terms(
        drive="torque",
        kp=1.0,
        armature=joint.numbers("armature")[0],
        damping=0.0 if "damper" in flags else damping[0],
        quadratic=0.0 if "damper" in flags else damping[1],
        frictionloss=0.0 if "frictionloss" in flags else joint.numbers("frictionloss")[0],
        stiffness=spring,
        preload=-spring * rest,
    )
    return ReadJoint(terms, unused=tuple(unused), joint_type="prismatic" if joint.kind == "slide" else "revolute")


def _driven(read: ReadJoint, joint: MjcfJoint, flags: set[str], made: Any) -> ReadJoint:
    """The joint with its actuators; those that say nothing of a known drive are named as unused."""
    if "actuation" in flags:
        return read.also_unused(*(f"its actuator {each.name}, which <flag> disables" for each in joint.actuators))
    off = (each.name for each in joint.actuators if not each.enabled)
    read = read.also_unused(*(f"{name}, whose group <option> disables" for name in off))
    acting = [each for each in joint.actuators if each.gear]
    for actuator in acting:  # armature and damping of an actuator act on the joint whatever drives it
        gear, damping = actuator.gear, 0.0 if "damper" in flags else actuator.first("damping")
        armature = read.terms.armature + gear**2 * actuator.first("armature")
        read = read.with_terms(armature=armature, damping=read.terms.damping + gear**2 * damping)
        read = read.also_unused(*_unused(actuator))
    first, (limit, told) = drive_of(acting), _joint_limit(joint)
    read = read.also_unused(*told)
    if first is not None:
        read = _with_drive(read, first, made, limit)
    elif limit < math.inf:
        read = read.with_terms(torque_limit=limit)
    for actuator in acting:
        if actuator is not first and actuator.enabled:
            read = _with_second(read, actuator, first)
    return read


def drive_of(found: Sequence[Actuator]) -> Actuator | None:
    """The actuator that is the drive: a position servo, else one whose force is proportional to the command, if any."""

    def dc(each: Actuator) -> bool:
        plain = each.values.get("input", "voltage") == "voltage" and not each.values.get("controller")
        return each.kind == "dcmotor" and plain and _motor_constants(each) is not None

    known = [
        each for each in found if each.enabled and each.gear and each.dynamics in ("none", "filter", "filterexact")
    ]
    servos = [each for each in known if each.is_servo or each.kind == "pid"]
    plain = [each for each in known if each.gain and not each.bias[1] and not _is_velocity(each)]
    return next(iter((*servos, *plain, *(each for each in known if dc(each)))), None)


def terms_of_drive(actuator: Actuator) -> Terms | None:
    """What an actuator, switched on or off, is as the only drive of a joint; None where it is no drive that is read."""
    if drive_of([replace(actuator, enabled=True)]) is None:
        return None
    return _with_drive(ReadJoint(Terms(drive="torque", kp=1.0)), actuator, None).terms


def _is_velocity(each: Actuator) -> bool:
    return each.gain is not None and not any(each.bias[:2]) and each.bias[2] != 0.0 and each.bias[2] == -each.gain


def _unused(actuator: Actuator) -> list[str]:
    used = ACTUATOR_USED | {"dcmotor": DC_MOTOR_USED, "pid": PID_USED}.get(actuator.kind, set())
    found = [f"{name} of {actuator.name}" for name in actuator.values if name not in used]
    further = [f"the further numbers of damping of {actuator.name}"] if any(actuator.numbers("damping")[1:]) else []
    return found + further


def _with_drive(read: ReadJoint, actuator: Actuator, made: Any, joint_limit: float = math.inf) -> ReadJoint:
    """The joint with its drive, whose force the joint limits to `joint_limit` [N m]."""
    if actuator.kind == "dcmotor":
        return _with_dc_motor(read, actuator, joint_limit)
    gear, unused = actuator.gear, list[str]()
    if actuator.kind == "pid":
        servo, kp, kv, bias = True, actuator.first("kp", 1.0), actuator.first("kv"), 0.0
        rate = actuator.first("ki") / kp if kp else 0.0
        unused += [f"inputs of {actuator.name} beside the position"] if actuator.values.get("input") != "pos" else []
    else:
        servo, kp = actuator.is_servo, actuator.gain or 0.0
        kv, bias, rate = -actuator.bias[2], actuator.bias[0], 0.0
    if actuator.damping_ratio:
        kv = made.damping(actuator) if made is not None else 0.0
        if made is None:
            unused.append(f"dampratio of {actuator.name}, {BY_MUJOCO}")
    unused += [f"the constant force of {actuator.name}"] if bias else []
    if servo and gear != 1.0:
        unused.append(f"that the command of {actuator.name} is {gear:g} times the joint's (gear)")
    at_joint = (gear**2 if servo else gear) * kp
    force, command, told = _limits(actuator, servo=servo, kp=at_joint)
    limits, beside = _with_damping_inside(min(force, joint_limit), command, 0.0 if servo else gear**2 * kv, actuator)
    read = read.with_terms(
        drive="position_servo" if servo else "torque",
        kp=at_joint,
        lag=actuator.filter,
        integral_rate=rate,
        delay=actuator.first("delay"),
        damping=read.terms.damping + (0.0 if servo else gear**2 * kv),
        **limits,
    )
    found = replace(read, driven=True, derivative_gain=gear**2 * kv if servo else 0.0)
    return found.also_unused(*unused, *told, *beside)


def _with_damping_inside(
    whole: float, command: float, damping: float, actuator: Actuator
) -> tuple[dict[str, Any], list[str]]:
    """Fields of the terms for the smaller limit of the torque, and the other one, which is not used.

    Args:
        whole: Limit of the torque with the drive's damping [N m]; infinite: none.
        command: Limit of the torque of the command alone [N m]; infinite: none.
        damping: Of the drive [N m s/rad]; without it both are the same limit.
        actuator: The drive.
    """
    limit, told = min(whole, command), list[str]()
    if damping and max(whole, command) < math.inf:
        told.append(f"the larger limit of {actuator.name}, which has both a ctrlrange and a force limit")
    inside = damping if damping and whole < command else 0.0
    return {"torque_limit": limit if limit < math.inf else None, "derivative_gain": inside}, told


def _limits(actuator: Actuator, *, servo: bool, kp: float) -> tuple[float, float, list[str]]:
    """Limits of the torque by the force and by the command, infinite for none, and what is not used of limits."""
    force, command = actuator.limits("forcerange"), actuator.limits("ctrlrange")
    of_force, of_command, unused = math.inf, math.inf, []
    if force is not None and _is_symmetric(force):
        of_force = abs(actuator.gear) * force[1]
    elif force is not None:
        unused.append(f"forcerange of {actuator.name}, which is not symmetric")
    if command is not None and not servo and _is_symmetric(command):
        of_command = abs(kp) * command[1]
    elif command is not None:
        unused.append(f"ctrlrange of {actuator.name}")
    if actuator.values.get("inheritrange"):
        unused.append(f"inheritrange of {actuator.name}")
    if actuator.values.get("actrange") and actuator.values.get("actlimited") != "false":
        unused.append(f"actrange of {actuator.name}")
    return of_force, of_command, unused


def _is_symmetric(limits: tuple[float, float]) -> bool:
    return abs(limits[0] + limits[1]) <= SYMMETRIC * (limits[1] - limits[0])


def _with_second(read: ReadJoint, actuator: Actuator, first: Actuator | None) -> ReadJoint:
    """An actuator beside the drive: the damping of one that holds a velocity is used, at the command 0."""
    if actuator.kind == "dcmotor" and actuator.values.get("input") == "none":
        return _with_passive_motor(read, actuator)
    damper = _is_velocity(actuator) and actuator.dynamics == "none" and actuator.limits("forcerange") is None
    if first is None or not damper:
        return read.also_unused(f"its actuator {actuator.name}")
    kv = actuator.gear**2 * -actuator.bias[2]
    if read.terms.drive == "position_servo" and first.limits("forcerange") is None:
        read = replace(read, derivative_gain=read.derivative_gain + kv)
    else:
        read = read.with_terms(damping=read.terms.damping + kv)
    return read.also_unused(f"the command of {actuator.name}")


def _motor_constants(actuator: Actuator) -> tuple[float, float] | None:
    """(k, R) of a motor on a voltage, k = sqrt(kt ke); None where it is not stated by these alone."""
    constants, resistance = actuator.numbers("motorconst"), actuator.first("resistance")
    if not constants or resistance <= 0.0 or any(actuator.numbers("nominal")):
        return None
    return math.sqrt(constants[0] * constants[-1]), resistance


def _with_dc_motor(read: ReadJoint, actuator: Actuator, joint_limit: float) -> ReadJoint:
    """The force is gear k/R (V - k gear v)."""
    constants = _motor_constants(actuator)
    if constants is None:
        return read.also_unused(f"its actuator {actuator.name}")
    gear, resistance = actuator.gear, constants[1]
    k = gear * constants[0]
    command = actuator.limits("ctrlrange")
    voltage = command[1] if command is not None and _is_symmetric(command) else 0.0
    torque, current = [*actuator.numbers("saturation"), 0.0, 0.0][:2]
    force = actuator.limits("forcerange")  # default classes hand it on to a dcmotor, which has no such attribute
    torque = min((x for x in (torque, force[1] if force else 0.0) if x > 0.0), default=0.0)
    whole = min(joint_limit, *(limit or math.inf for limit in (abs(gear) * torque, abs(k) * current)))
    of_voltage = abs(k) / resistance * voltage or math.inf
    limits, beside = _with_damping_inside(whole, of_voltage, k**2 / resistance, actuator)
    inductance = [*actuator.numbers("inductance"), 0.0, 0.0]
    read = read.with_terms(
        drive="voltage",
        kp=k / resistance,
        damping=read.terms.damping + k**2 / resistance,
        delay=actuator.first("delay"),
        lag=inductance[1] or inductance[0] / resistance,
        torque_constant=k,
        **limits,
    )
    told = [f"ctrlrange of {actuator.name}, which is not symmetric"] if command is not None and not voltage else []
    told += [f"that the inductance of {actuator.name} delays its back-EMF too"] if read.terms.lag else []
    told += [f"the voltage of saturation of {actuator.name}"] if any(actuator.numbers("saturation")[2:]) else []
    return _with_motor_friction(replace(read, driven=True), actuator).also_unused(*told, *beside)


def _with_passive_motor(read: ReadJoint, actuator: Actuator) -> ReadJoint:
    """A dcmotor without input: its friction, its cogging and its back-EMF."""
    constants = _motor_constants(actuator)
    if constants is None:
        return read.also_unused(f"its actuator {actuator.name}")
    k = actuator.gear * constants[0]
    return _with_motor_friction(read.with_terms(damping=read.terms.damping + k**2 / constants[1]), actuator)


def _with_motor_friction(read: ReadJoint, actuator: Actuator) -> ReadJoint:
    """`lugre` (stiffness, damping, F_C, F_S, v_S) and `cogging` (amplitude, periods, phase) of a dcmotor.

    Sliding, the first is F_C + (F_S - F_C) exp(-(v/v_S)^2); its bristles are not used. The second is
    A sin(N gear q + phase) at the motor.
    """
    gear = abs(actuator.gear)
    if lugre := actuator.numbers("lugre"):
        _, _, least, most, speed = [*lugre, 0.0, 0.0, 0.0][:5]
        read = read.with_terms(frictionloss=read.terms.frictionloss + gear * least)
        if most > least and speed > 0.0:
            read = read.with_terms(stribeck=StribeckPeak(gear * (most - least), speed / gear, 2.0))
        read = read.also_unused(f"the bristles of lugre of {actuator.name}")
    if cogging := actuator.numbers("cogging"):
        height, periods, phase = [*cogging, 0.0, 0.0][:3]
        size, cycles = -actuator.gear * height, periods * actuator.gear
        ripple = Ripple(size * math.sin(phase), math.copysign(1.0, cycles) * size * math.cos(phase), abs(cycles))
        read = read.with_terms(ripple=ripple if height and cycles else None)
    return read


def _joint_limit(joint: MjcfJoint) -> tuple[float, list[str]]:
    """Limit of the torque of all its actuators [N m], infinite for none, and what is not used of it."""
    span = joint.numbers("actuatorfrcrange", "")
    if len(span) != 2 or joint.values.get("actuatorfrclimited") == "false" or span[0] >= span[1]:
        return math.inf, []
    if not _is_symmetric((span[0], span[1])):
        return math.inf, ["actuatorfrcrange, which is not symmetric"]
    acting = [each for each in joint.actuators if each.gear and each.enabled]
    first = drive_of(acting)
    plain = first is not None and (first.is_servo or first.kind == "pid")  # with dampers that it limits too
    plain &= all(_is_velocity(each) for each in acting if each is not first)
    if len(acting) < 2 or (plain and not any(each.limits("forcerange") for each in acting)):
        return span[1], []
    return span[1], ["actuatorfrcrange, which limits several actuators together"]


def _with_springdamper(read: ReadJoint, joint: MjcfJoint, flags: set[str], made: Any) -> ReadJoint:
    """The joint with what MuJoCo makes of springdamper."""
    if not any(joint.numbers("springdamper")):
        return read
    if made is None:
        return read.also_unused(f"springdamper, {BY_MUJOCO}")
    stiffness, damping, rest = made.spring(joint)
    if "spring" not in flags:
        read = read.with_terms(stiffness=stiffness, preload=-stiffness * rest)
    if "damper" not in flags:
        read = read.with_terms(damping=read.terms.damping - joint.numbers("damping")[0] + damping)
    return read


def _disabled(root: ET.Element) -> set[str]:
    """Forces that the file switches off."""
    said = {name: value for flag in root.iterfind("option/flag") for name, value in flag.attrib.items()}
    found = {name for name, value in said.items() if value == "disable"}
    found |= {"frictionloss"} if "constraint" in found else set()
    return found | ({"spring", "damper"} if "passive" in found else set())


def disabled_groups(root: ET.Element) -> set[str]:
    """Groups of actuators that the file switches off; their armature and damping still act."""
    return {name for each in root.findall("option") for name in each.get("actuatorgroupdisable", "").split()}


def _couplings(root: ET.Element) -> dict[str, list[str]]:
    """By joint, what couples it to others: equalities and tendons."""
    found: dict[str, list[str]] = {}
    pulling: dict[str, list[str]] = {}
    for each in root.iterfind("actuator/*"):
        if each.get("tendon"):
            pulling.setdefault(each.get("tendon", ""), []).append(f"its actuator {place(each)}")
    for each in root.iterfind("equality/joint"):
        for name in (each.get("joint1", ""), each.get("joint2", "")):
            found.setdefault(name, []).append(f"its coupling {place(each)}")
    for each in root.iterfind("tendon/fixed"):
        for name in (part.get("joint", "") for part in each.findall("joint")):
            found.setdefault(name, []).append(f"its tendon {place(each)}")
            found[name] += pulling.get(each.get("name", ""), ())
    return found


def _beside_joints(root: ET.Element) -> list[str]:
    """What acts on bodies, and so on any joint: air and water, closed loops, spatial tendons, actuators at sites."""
    found = [
        f"{name} of {place(each)}"
        for each in root.findall("option")
        for name in ("density", "viscosity", "wind")
        if any(finite(each, name, each.get(name, "")))
    ]
    found += [place(each) for each in root.iterfind("equality/*") if each.tag in ("connect", "weld", "tendon")]
    at_bodies = ("site", "body", "cranksite")
    found += [f"the actuator {place(each)}" for each in root.iterfind("actuator/*") if any(map(each.get, at_bodies))]
    return found + [place(each) for each in root.iterfind("tendon/spatial")]


def _of_body(joint: MjcfJoint) -> list[str]:
    carried = (each for each in joint.body.iter("body") if any(finite(each, "gravcomp", each.get("gravcomp", ""))))
    return [f"gravcomp of {place(each)}" for each in carried]


class _Compiled:
    """What only MuJoCo's compiler knows of a file: numbers that depend on inertias of its bodies."""

    def __init__(self, path: Path) -> None:
        self.model = mujoco_module().MjModel.from_xml_path(str(path))

    def damping(self, actuator: Actuator) -> float:
        """Kv of a servo with a damping ratio, before the gear."""
        return -float(self.model.actuator_biasprm[actuator.number][2])

    def spring(self, joint: MjcfJoint) -> tuple[float, float, float]:
        """Stiffness, damping and rest position."""
        at = self.model.joint(joint.element.get("name"))
        rest = float(self.model.qpos_spring[at.qposadr[0]])
        return float(self.model.jnt_stiffness[at.id]), float(self.model.dof_damping[at.dofadr[0]]), rest


def _compiled_by_mujoco(joints: Mapping[str, MjcfJoint], path: Path) -> _Compiled | None:
    """The compiled file where a term needs it; None where none does, or MuJoCo cannot load the file."""
    ratios = any(each.damping_ratio for joint in joints.values() for each in joint.actuators)
    if not ratios and not any(any(joint.numbers("springdamper")) for joint in joints.values()):
        return None
    try:
        return _Compiled(path)
    except (ImportError, OSError, ValueError):
        return None
