"""Joints of a URDF file: `<dynamics>`, `<limit effort>`, and Drake's tags of the transmission's actuator.

The reflected inertia is rotor_inertia gear_ratio^2. `drake:controller_gains` are the gains of a position servo.
"""

import xml.etree.ElementTree as ET
from dataclasses import replace

from drake_tc.simulator_files.terms import ReadJoint, Terms
from drake_tc.simulator_files.xml_tree import DRAKE

MOVING = ("revolute", "continuous", "prismatic")


def urdf_joints(root: ET.Element) -> dict[str, ReadJoint]:
    """What the file says of each moving joint, by name.

    Args:
        root: `<robot>`.

    Raises:
        ValueError: an attribute that is no number.
    """
    found = {
        joint.get("name", ""): ReadJoint(_terms(joint))
        for joint in root.findall("joint")
        if joint.get("type") in MOVING
    }
    for transmission in root.findall("transmission"):
        actuator = transmission.find("actuator")
        for joint in transmission.findall("joint"):
            name = joint.get("name", "")
            if name in found and actuator is not None:
                found[name] = _with_tags(found[name], actuator)
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
        return replace(joint, terms=terms)
    return replace(joint, driven=True, derivative_gain=d, terms=replace(terms, drive="position_servo", kp=p))


def attribute(element: ET.Element, tag: str, name: str) -> float:
    """The attribute of a child, 0 where there is none.

    Args:
        element: The parent.
        tag: Of the child.
        name: Of the attribute.

    Raises:
        ValueError: it is no number.
    """
    child = element.find(tag)
    return float((child.get(name) if child is not None else None) or 0.0)


def _terms(joint: ET.Element) -> Terms:
    effort = attribute(joint, "limit", "effort")
    return Terms(
        drive="torque",
        kp=1.0,
        damping=attribute(joint, "dynamics", "damping"),
        frictionloss=attribute(joint, "dynamics", "friction"),
        torque_limit=effort if effort > 0.0 else None,
    )


def _with_tags(joint: ReadJoint, actuator: ET.Element) -> ReadJoint:
    inertia, ratio = (attribute(actuator, f"{DRAKE}{name}", "value") for name in ("rotor_inertia", "gear_ratio"))
    gains = (attribute(actuator, f"{DRAKE}controller_gains", name) for name in ("p", "d"))
    return with_drake(joint, inertia * (ratio or 1.0) ** 2, *gains)
