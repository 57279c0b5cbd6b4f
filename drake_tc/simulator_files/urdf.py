"""Joints of a URDF file: `<dynamics>`, `<limit effort>`, and the actuator of their transmission.

The reflected inertia is rotor_inertia gear_ratio^2 of Drake's tags, else motorInertia mechanicalReduction^2, which
Drake does not use. `drake:controller_gains` are the gains of a position servo, which Drake clips as a whole to the
limit of the effort. A joint that follows another, and everything else that is physics, is listed as not used.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import replace

from drake_tc.simulator_files.terms import ReadJoint, Terms
from drake_tc.simulator_files.xml_tree import DRAKE, PREFIX, finite, place

MOVING = ("revolute", "continuous", "prismatic")
SIMPLE = "SimpleTransmission"
JOINT_USED = {"parent", "child", "origin", "axis", "dynamics", "limit", "mimic", "calibration"}
ACTUATOR_USED = {"hardwareInterface", "mechanicalReduction", "motorInertia"}
DRAKE_USED = {f"{DRAKE}{name}" for name in ("rotor_inertia", "gear_ratio", "controller_gains")}
"""Of an actuator's tags."""
NO_PHYSICS = {"material", "selfCollide", "visual", "turnGravityOff"}
"""Of Gazebo's tags of a joint or link."""


def urdf_joints(root: ET.Element) -> dict[str, ReadJoint]:
    """What the file says of each moving joint, by name.

    Args:
        root: `<robot>`.

    Raises:
        ValueError: an attribute that is no number; names element and line.
    """
    found = {joint.get("name", ""): _joint(joint) for joint in root.findall("joint") if joint.get("type") in MOVING}
    for transmission in root.findall("transmission"):
        for joint in transmission.findall("joint"):
            name = joint.get("name", "")
            if name in found:
                found[name] = _with_transmission(found[name], transmission, joint)
    for name, told in _extensions(root):
        if name in found:
            found[name] = found[name].also_unused(told)
    return found


def with_drake(joint: ReadJoint, armature: float, p: float, d: float) -> ReadJoint:
    """The joint with what Drake's tags say of its actuator.

    Args:
        joint: Without them.
        armature: Reflected rotor inertia [kg m^2].
        p: Gain of a position servo [N m/rad]; 0: the file has none.
        d: Damping of the servo [N m s/rad].
    """
    terms = replace(joint.terms, armature=armature)
    if p <= 0.0:
        joint = replace(joint, terms=terms)
        return joint.also_unused("the gain d of controller_gains without p") if d else joint
    return replace(joint, driven=True, derivative_gain=d, terms=replace(terms, drive="position_servo", kp=p))


def attribute(element: ET.Element, tag: str, name: str) -> float:
    """The attribute of a child, 0 where there is none.

    Args:
        element: The parent.
        tag: Of the child.
        name: Of the attribute.

    Raises:
        ValueError: it is no number; names element and line.
    """
    child = element.find(tag)
    text = None if child is None else child.get(name)
    return 0.0 if child is None or not text else (finite(child, name, text) or [0.0])[0]


def _joint(joint: ET.Element) -> ReadJoint:
    effort = attribute(joint, "limit", "effort")
    terms = Terms(
        drive="torque",
        kp=1.0,
        damping=attribute(joint, "dynamics", "damping"),
        frictionloss=attribute(joint, "dynamics", "friction"),
        torque_limit=effort if effort > 0.0 else None,
    )
    unused = [f"its {_word(each.tag)}" for each in joint if each.tag not in JOINT_USED]
    for tag, used in (("dynamics", ("damping", "friction")), ("limit", ("effort", "lower", "upper", "velocity"))):
        for child in joint.findall(tag):
            unused += [f"{_word(name)} of its {tag}" for name in child.attrib if name not in used]
    if attribute(joint, "limit", "velocity"):
        unused.append("its limit of the velocity")
    if joint.get("type") != "continuous" and attribute(joint, "limit", "lower") != attribute(joint, "limit", "upper"):
        unused.append("its limits of the position (lower, upper)")
    mimic = joint.find("mimic")
    if mimic is not None:
        unused.append(f"that it follows {mimic.get('joint')!r} (mimic)")
    return ReadJoint(terms, unused=tuple(unused))


def _with_transmission(joint: ReadJoint, transmission: ET.Element, of_joint: ET.Element) -> ReadJoint:
    actuators = transmission.findall("actuator")
    if not actuators:
        return joint
    kind = (transmission.findtext("type") or transmission.get("type") or SIMPLE).strip()
    if not kind.endswith(SIMPLE) or len(actuators) > 1:
        return joint.also_unused(f"its transmission {place(transmission)}, which is no {SIMPLE}")
    actuator = actuators[0]
    inertia, ratio = (attribute(actuator, f"{DRAKE}{name}", "value") for name in ("rotor_inertia", "gear_ratio"))
    armature = inertia * (ratio or 1.0) ** 2
    parts = (actuator, of_joint, transmission)
    reduction = next((value for part in parts if (value := content(part, "mechanicalReduction"))), 1.0)
    if not inertia:
        armature = content(actuator, "motorInertia") * reduction**2
    gains = (attribute(actuator, f"{DRAKE}controller_gains", name) for name in ("p", "d"))
    unused = [f"its {_word(each.tag)}" for each in actuator if each.tag not in ACTUATOR_USED | DRAKE_USED]
    unused += [
        f"its {_word(each.tag)}" for each in of_joint if each.tag not in ("hardwareInterface", "mechanicalReduction")
    ]
    if inertia and content(actuator, "motorInertia"):
        unused.append("its motorInertia beside drake:rotor_inertia")
    return with_drake(joint, armature, *gains).also_unused(*unused)


def _extensions(root: ET.Element) -> Iterator[tuple[str, str]]:
    """(joint, what is not used) of Gazebo's and ros2_control's tags, and of Drake's elements between joints."""
    for gazebo in root.findall("gazebo"):
        for each in gazebo:
            if each.tag not in NO_PHYSICS:
                yield gazebo.get("reference", ""), f"its <gazebo> tag {_word(each.tag)}"
    for control in root.findall("ros2_control"):
        for joint in control.findall("joint"):
            for each in joint.findall("param"):
                yield joint.get("name", ""), f"its <ros2_control> parameter {each.get('name')}"


def content(element: ET.Element, path: str) -> float:
    """The number in the element at a path, 0 where there is none.

    Raises:
        ValueError: it is no number; names element and line.
    """
    child = element.find(path)
    return 0.0 if child is None else (finite(child, _word(child.tag), child.text or "") or [0.0])[0]


def _word(tag: str) -> str:
    return tag.replace(DRAKE, PREFIX)
