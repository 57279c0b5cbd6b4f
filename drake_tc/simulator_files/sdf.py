"""Joints of an SDFormat file: `<axis>` with `<dynamics>` and `<limit><effort>`, and Drake's tags of the joint.

The reflected inertia is drake:rotor_inertia drake:gear_ratio^2, both contents of their tags. `drake:controller_gains`
has its gains as attributes. The spring's torque is -spring_stiffness (q - spring_reference), as Drake applies it. All
joints of the file are read, those of nested models too; what else is physics is listed as not used.
"""

import math
import xml.etree.ElementTree as ET

from drake_tc.simulator_files.terms import ReadJoint, Terms
from drake_tc.simulator_files.urdf import MOVING, attribute, content, with_drake
from drake_tc.simulator_files.xml_tree import DRAKE, PREFIX, finite, place

JOINT_USED = {"parent", "child", "pose", "axis", "sensor"} | {
    f"{DRAKE}{name}" for name in ("rotor_inertia", "gear_ratio", "controller_gains")
}
AXIS_USED = {"xyz", "dynamics", "limit", "mimic"}
DYNAMICS_USED = {"damping", "friction", "spring_stiffness", "spring_reference"}


def sdf_joints(root: ET.Element) -> dict[str, ReadJoint]:
    """What the file says of each moving joint, by name.

    Args:
        root: `<sdf>`.

    Raises:
        ValueError: a content or an attribute that is no number; names element and line.
    """
    found = {joint.get("name", ""): _read(joint) for joint in root.iter("joint") if joint.get("type") in MOVING}
    if not found and (included := next(root.iter("include"), None)) is not None:
        uri = (included.findtext("uri") or "").strip()
        raise ValueError(f"{place(included)}: {uri}: included models are not read; name the file of the model itself")
    return found


def _read(joint: ET.Element) -> ReadJoint:
    effort = _limit(joint, "effort")
    stiffness = content(joint, "axis/dynamics/spring_stiffness")
    terms = Terms(
        drive="torque",
        kp=1.0,
        damping=content(joint, "axis/dynamics/damping"),
        frictionloss=content(joint, "axis/dynamics/friction"),
        stiffness=stiffness,
        preload=-stiffness * content(joint, "axis/dynamics/spring_reference"),
        torque_limit=effort if 0.0 < effort < math.inf else None,
    )
    inertia, ratio = content(joint, f"{DRAKE}rotor_inertia"), content(joint, f"{DRAKE}gear_ratio") or 1.0
    gains = (attribute(joint, f"{DRAKE}controller_gains", name) for name in ("p", "d"))
    return with_drake(ReadJoint(terms), inertia * ratio**2, *gains).also_unused(*_unused(joint))


def _unused(joint: ET.Element) -> list[str]:
    found = [f"its {each.tag.replace(DRAKE, PREFIX)}" for each in joint if each.tag not in JOINT_USED]
    for axis in joint.findall("axis"):
        found += [f"its {each.tag.replace(DRAKE, PREFIX)}" for each in axis if each.tag not in AXIS_USED]
        for dynamics in axis.findall("dynamics"):
            found += [f"its {each.tag}" for each in dynamics if each.tag not in DYNAMICS_USED]
        for limit in axis.findall("limit"):
            found += [f"its {each.tag} of the limit" for each in limit if each.tag in ("stiffness", "dissipation")]
        mimic = axis.find("mimic")
        if mimic is not None:
            found.append(f"that it follows {mimic.get('joint')!r} (mimic)")
    if 0.0 < abs(_limit(joint, "velocity")) < math.inf:
        found.append("its limit of the velocity")
    ends = _limit(joint, "lower"), _limit(joint, "upper")
    if any(0.0 < abs(end) < 1e16 for end in ends):
        found.append("its limits of the position (lower, upper)")
    return found


def _limit(joint: ET.Element, name: str) -> float:
    """A limit; it may be infinite, or -1 for none."""
    element = joint.find(f"axis/limit/{name}")
    text = "" if element is None else (element.text or "").strip()
    if element is None or not text or text.lstrip("+-").lower() in ("inf", "infinity"):
        return 0.0
    return (finite(element, name, text) or [0.0])[0]
