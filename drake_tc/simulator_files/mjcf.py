"""Joints and actuators of an MJCF file, with the attributes that default classes give them.

Read are a joint's armature, frictionloss and damping (d0 d1 d2: the force -(d0 + d1 |v| + d2 v^2) v), and of the first
actuator of a joint its kind, gain, gear, delay and force limit. The torque of a position servo is gear^2 kp (q_d - q)
where the command is the joint's position. A hinge `NAME_backlash` is the play of the gear of `NAME`.
"""

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from dataclasses import replace

from drake_tc.simulator_files.terms import ReadJoint, Terms

Attributes = Mapping[str, str]
PLAY = "_backlash"
"""End of the name of a hinge that is the play of a gear."""
ACTUATORS = ("position", "motor", "general", "velocity", "intvelocity", "damper", "cylinder", "dcmotor", "muscle")
NO_TERMS = ("inductance", "cogging", "lugre", "thermal")
"""Attributes of a dcmotor that are no terms."""
SERVO_TOLERANCE = 1e-9
SHARED = ("gear", "ctrlrange", "ctrllimited", "forcerange", "forcelimited", "delay", "nsample")
"""Attributes that a default class hands on from an actuator of one kind to those of all kinds."""


def mjcf_joints(root: ET.Element) -> dict[str, ReadJoint]:
    """What the file says of each named hinge or slide, by name.

    Args:
        root: `<mujoco>`.

    Raises:
        ValueError: an attribute that is no number.
    """
    classes = _classes(root)
    found: dict[str, ReadJoint] = {}
    plays: dict[str, float] = {}
    degrees = all(each.get("angle", "degree") != "radian" for each in root.findall("compiler"))
    for element, childclass in _joints(root):
        name, values = element.get("name", ""), _with_defaults(element, classes, childclass)
        if name.endswith(PLAY):
            low, high = _numbers(values, "range", "0 0")[:2]
            plays[name.removesuffix(PLAY)] = (high - low) * (math.pi / 180.0 if degrees else 1.0)
        elif name and values.get("type", "hinge") in ("hinge", "slide"):
            found[name] = ReadJoint(_passive(values))
    for name, play in plays.items():
        if name in found:
            found[name] = replace(found[name], terms=replace(found[name].terms, backlash=play))
    for actuator in _actuators(root):
        joint = actuator.get("joint", "")
        if joint in found and not found[joint].driven:
            found[joint] = _driven(found[joint], actuator.tag, _with_defaults(actuator, classes, ""))
    return found


def _joints(root: ET.Element) -> Iterator[tuple[ET.Element, str]]:
    """Joints of the tree, each with the default class of the bodies around it."""

    def of_body(body: ET.Element, around: str) -> Iterator[tuple[ET.Element, str]]:
        inside = body.get("childclass", around)
        for element in body:
            if element.tag == "joint":
                yield element, inside
            elif element.tag in ("body", "frame"):
                yield from of_body(element, inside)

    for world in root.findall("worldbody"):
        yield from of_body(world, "")


def _actuators(root: ET.Element) -> list[ET.Element]:
    return [each for group in root.findall("actuator") for each in group if each.tag in ACTUATORS]


def actuators_of(root: ET.Element, joint: str) -> list[tuple[str, Attributes]]:
    """Kind and attributes, those of default classes among them, of each actuator of a joint.

    Args:
        root: `<mujoco>`.
        joint: Its name.
    """
    classes = _classes(root)
    return [
        (each.tag, _with_defaults(each, classes, ""))
        for group in root.findall("actuator")
        for each in group
        if each.get("joint") == joint
    ]


def _classes(root: ET.Element) -> dict[str, dict[str, Attributes]]:
    """By default class, the attributes of each kind of element; "" is the class of everything."""
    classes: dict[str, dict[str, Attributes]] = {"": {}}

    def read(element: ET.Element, inherited: Mapping[str, Attributes], name: str) -> None:
        own = dict(inherited)
        for each in element:
            if each.tag != "default":
                own[each.tag] = {**own.get(each.tag, {}), **each.attrib}
            if each.tag in ACTUATORS:
                shared = {name: value for name, value in each.attrib.items() if name in SHARED}
                own.update({tag: {**own.get(tag, {}), **shared} for tag in ACTUATORS})
        classes[name] = own
        for nested in element.findall("default"):
            read(nested, own, nested.get("class", ""))

    for top in root.findall("default"):
        read(top, classes[""], "")
        if top.get("class"):
            classes[top.get("class", "")] = classes[""]
    return classes


def _with_defaults(element: ET.Element, classes: Mapping[str, Mapping[str, Attributes]], around: str) -> Attributes:
    chosen = classes.get(element.get("class", around), classes[""])
    return {**chosen.get(element.tag, {}), **element.attrib}


def _numbers(values: Attributes, name: str, absent: str) -> list[float]:
    return [float(text) for text in (values.get(name) or absent).split()]


def _passive(values: Attributes) -> Terms:
    damping = _numbers(values, "damping", "0")
    return Terms(
        drive="torque",
        kp=1.0,
        armature=_numbers(values, "armature", "0")[0],
        damping=damping[0],
        quadratic=damping[1] if len(damping) > 1 else 0.0,
        frictionloss=_numbers(values, "frictionloss", "0")[0],
    )


def _driven(joint: ReadJoint, tag: str, values: Attributes) -> ReadJoint:
    """The joint with its actuator; one of a kind that says nothing of a known drive is named as unused."""
    if tag == "dcmotor":
        return _with_dc_motor(joint, values)
    gear = _numbers(values, "gear", "1")[0]
    gain = servo_gains(tag, values)
    if gain is not None:
        kp, derivative = gear**2 * gain[0], gear**2 * gain[1]
        terms = replace(joint.terms, drive="position_servo", kp=kp)
    elif tag in ("motor", "general") and values.get("biastype", "none") == "none":
        kp, derivative = gear * (_numbers(values, "gainprm", "1")[0] if tag == "general" else 1.0), 0.0
        terms = replace(joint.terms, drive="torque", kp=kp)
    else:
        return replace(joint, unused=(*joint.unused, f"its actuator <{tag}>"))
    limit, limited = _numbers(values, "forcerange", ""), values.get("forcelimited") != "false"
    return replace(
        joint,
        driven=True,
        derivative_gain=derivative,
        terms=replace(
            terms,
            delay=_numbers(values, "delay", "0")[0],
            torque_limit=abs(gear) * limit[1] if limited and len(limit) == 2 and limit[1] > 0.0 else None,
        ),
    )


def _with_dc_motor(joint: ReadJoint, values: Attributes) -> ReadJoint:
    """The force is gear k/R (V - k gear v), k = sqrt(kt ke); with a controller or nominal values it is not used."""
    constants, gear = _numbers(values, "motorconst", ""), _numbers(values, "gear", "1")[0]
    resistance = _numbers(values, "resistance", "0")[0]
    if not constants or resistance <= 0.0 or values.get("input", "voltage") != "voltage":
        return replace(joint, unused=(*joint.unused, "its actuator <dcmotor>"))
    k = gear * math.sqrt(constants[0] * constants[-1])
    limited = values.get("ctrllimited") != "false"
    voltage = _numbers(values, "ctrlrange", "0 0")[1] if limited else 0.0
    torque, current = [*_numbers(values, "saturation", ""), 0.0, 0.0][:2]
    limits = [gear * torque, k * current, k / resistance * voltage]
    terms = replace(
        joint.terms,
        drive="voltage",
        kp=k / resistance,
        damping=joint.terms.damping + k**2 / resistance,
        delay=_numbers(values, "delay", "0")[0],
        torque_limit=min((limit for limit in limits if limit > 0.0), default=None),
        torque_constant=k,
    )
    unused = tuple(f"{name} of its actuator <dcmotor>" for name in NO_TERMS if name in values)
    return replace(joint, terms=terms, driven=True, unused=(*joint.unused, *unused))


def servo_gains(tag: str, values: Attributes) -> tuple[float, float] | None:
    """Gain and damping of a position servo before the gear; None for another actuator.

    Args:
        tag: Kind of the actuator.
        values: Its attributes, those of default classes among them.
    """
    if tag == "position":
        return _numbers(values, "kp", "1")[0], _numbers(values, "kv", "0")[0]
    if tag == "general" and values.get("biastype") == "affine":
        gain, bias = _numbers(values, "gainprm", "1")[0], [*_numbers(values, "biasprm", "0"), 0.0, 0.0]
        if abs(bias[1] + gain) <= SERVO_TOLERANCE * abs(gain):
            return gain, -bias[2]
    return None
