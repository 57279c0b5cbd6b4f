"""Joints of a URDF file: `<dynamics>`, `<limit effort>`, and Drake's tags of the transmission's actuator.

The reflected inertia is rotor_inertia gear_ratio^2. `drake:controller_gains` are the gains of a position servo.
"""

import xml.etree.ElementTree as ET
from dataclasses import replace

from drake_tc.simulator_files.terms import ReadJoint, Terms

DRAKE = "{http://drake.mit.edu}"
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
                found[name] = _with_drake(found[name], actuator)
    return found


def _terms(joint: ET.Element) -> Terms:
    effort = _value(joint, "limit", "effort")
    return Terms(
        drive="torque",
        kp=1.0,
        damping=_value(joint, "dynamics", "damping"),
        frictionloss=_value(joint, "dynamics", "friction"),
        torque_limit=effort if effort > 0.0 else None,
    )


def _with_drake(joint: ReadJoint, actuator: ET.Element) -> ReadJoint:
    inertia, ratio = _value(actuator, f"{DRAKE}rotor_inertia", "value"), _value(actuator, f"{DRAKE}gear_ratio", "value")
    terms = replace(joint.terms, armature=inertia * (ratio or 1.0) ** 2)
    kp = _value(actuator, f"{DRAKE}controller_gains", "p")
    if kp <= 0.0:
        return replace(joint, terms=terms)
    derivative = _value(actuator, f"{DRAKE}controller_gains", "d")
    return replace(joint, driven=True, derivative_gain=derivative, terms=replace(terms, drive="position_servo", kp=kp))


def _value(element: ET.Element, tag: str, attribute: str) -> float:
    """The attribute of a child, 0 where there is none."""
    child = element.find(tag)
    return float((child.get(attribute) if child is not None else None) or 0.0)
