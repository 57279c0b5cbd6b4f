"""Joints of an SDFormat file: `<axis>` with `<dynamics>` and `<limit><effort>`, and Drake's tags of the joint.

The reflected inertia is drake:rotor_inertia drake:gear_ratio^2, both contents of their tags. `drake:controller_gains`
has its gains as attributes. All joints of the file are read, those of nested models too.
"""

import math
import xml.etree.ElementTree as ET

from drake_tc.simulator_files.terms import ReadJoint, Terms
from drake_tc.simulator_files.urdf import MOVING, attribute, with_drake
from drake_tc.simulator_files.xml_tree import DRAKE


def sdf_joints(root: ET.Element) -> dict[str, ReadJoint]:
    """What the file says of each moving joint, by name.

    Args:
        root: `<sdf>`.

    Raises:
        ValueError: a content or an attribute that is no number.
    """
    return {joint.get("name", ""): _read(joint) for joint in root.iter("joint") if joint.get("type") in MOVING}


def _read(joint: ET.Element) -> ReadJoint:
    effort = _content(joint, "axis/limit/effort")
    terms = Terms(
        drive="torque",
        kp=1.0,
        damping=_content(joint, "axis/dynamics/damping"),
        frictionloss=_content(joint, "axis/dynamics/friction"),
        torque_limit=effort if 0.0 < effort < math.inf else None,
    )
    unused = ("its spring_stiffness",) if _content(joint, "axis/dynamics/spring_stiffness") else ()
    inertia, ratio = _content(joint, f"{DRAKE}rotor_inertia"), _content(joint, f"{DRAKE}gear_ratio") or 1.0
    gains = (attribute(joint, f"{DRAKE}controller_gains", name) for name in ("p", "d"))
    return with_drake(ReadJoint(terms, unused=unused), inertia * ratio**2, *gains)


def _content(element: ET.Element, path: str) -> float:
    """The number in the element at a path, 0 where there is none."""
    return float((element.findtext(path) or "").strip() or 0.0)
