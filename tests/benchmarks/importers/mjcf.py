"""A URDF from an MJCF tree of hinges: what a rigid-body model needs, and nothing else.

Read are bodies with `pos` and `quat`, `inertial` with `diaginertia` or `fullinertia`, and hinge joints whose `axis` and
`range` may come from default classes. Frames of bodies become link frames. An inertia about principal axes is turned
into them: I = R diag(I_1, I_2, I_3) R^T, R of the inertial's quaternion.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from drake_tc.errors import LogError
from drake_tc.types import FloatArray

Attributes = Mapping[str, str]


def urdf_of_mjcf(text: str, source: str) -> tuple[str, str, list[str]]:
    """Convert one model.

    Args:
        text: MJCF.
        source: Named in errors.

    Returns:
        The URDF's text, the name of its first link, and the hinges in the order of the tree.

    Raises:
        LogError: Not an MJCF with one tree of hinges.
    """
    try:
        model = ET.fromstring(text)
    except ET.ParseError as error:
        raise LogError(f"{source}: not XML: {error}") from None
    root = model.find("worldbody/body")
    if model.tag != "mujoco" or root is None:
        raise LogError(f"{source}: expected an MJCF with a body in its worldbody")
    classes: dict[str, Attributes] = {}
    for default in model.findall("default"):
        _read_defaults(default, {}, classes)
    robot = ET.Element("robot", name=model.get("model", "robot"))
    try:
        hinges = list(_add_body(robot, root, None, root.get("childclass", ""), classes))
    except (KeyError, ValueError) as error:
        raise LogError(f"{source}: a body, its inertial or a joint cannot be read: {error}") from None
    if not hinges:
        raise LogError(f"{source}: no hinge joint in the tree of {root.get('name')!r}")
    ET.indent(robot)
    return ET.tostring(robot, encoding="unicode") + "\n", root.attrib["name"], hinges


def _read_defaults(element: ET.Element, inherited: Attributes, classes: dict[str, Attributes]) -> None:
    """Attributes of joints by default class; a class inherits from the one around it."""
    joint = element.find("joint")
    own = {**inherited, **(joint.attrib if joint is not None else {})}
    classes[element.get("class", "main" if not inherited else "")] = own
    for nested in element.findall("default"):
        _read_defaults(nested, own, classes)


def _add_body(
    robot: ET.Element, body: ET.Element, parent: str | None, around: str, classes: Mapping[str, Attributes]
) -> Iterator[str]:
    """Append the link of a body, its joint to `parent` and all bodies below; yields the hinges."""
    name = body.attrib["name"]
    around = body.get("childclass", around)
    _add_link(robot, name, body.find("inertial"))
    if parent is not None:
        joint = body.find("joint")
        yield from _add_joint(robot, body, parent, {} if joint is None else _joint_attributes(joint, around, classes))
    for below in body.findall("body"):
        yield from _add_body(robot, below, name, around, classes)


def _joint_attributes(joint: ET.Element, around: str, classes: Mapping[str, Attributes]) -> Attributes:
    inherited = classes.get(joint.get("class", around), classes.get("main", {}))
    attributes = {"type": "hinge", "axis": "0 0 1", **inherited, **joint.attrib}
    if attributes["type"] != "hinge":
        raise ValueError(f"joint {joint.get('name')!r} is a {attributes['type']}; expected a hinge")
    return attributes


def _add_joint(robot: ET.Element, body: ET.Element, parent: str, attributes: Attributes) -> Iterator[str]:
    """One joint; a body without a joint is welded to its parent."""
    name = attributes.get("name", f"{body.attrib['name']}_weld")
    joint = ET.SubElement(robot, "joint", name=name, type="revolute" if attributes else "fixed")
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=body.attrib["name"])
    _add_origin(joint, _numbers(body.get("pos", "0 0 0"), 3), _rotation(body))
    if attributes:
        ET.SubElement(joint, "axis", xyz=attributes["axis"])
        lower, upper = _numbers(attributes.get("range", "0 0"), 2)
        ET.SubElement(joint, "limit", lower=f"{lower:g}", upper=f"{upper:g}", effort="0", velocity="0")
        yield name


def _add_link(robot: ET.Element, name: str, inertial: ET.Element | None) -> None:
    link = ET.SubElement(robot, "link", name=name)
    if inertial is None:
        return
    if "fullinertia" in inertial.attrib:
        xx, yy, zz, xy, xz, yz = _numbers(inertial.attrib["fullinertia"], 6)
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    else:
        inertia = np.diag(_numbers(inertial.attrib["diaginertia"], 3))
    R = _rotation(inertial).as_matrix()
    turned = R @ inertia @ R.T
    entry = ET.SubElement(link, "inertial")
    _add_origin(entry, _numbers(inertial.get("pos", "0 0 0"), 3), Rotation.identity())
    ET.SubElement(entry, "mass", value=inertial.attrib["mass"])
    places = {"ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2)}
    ET.SubElement(entry, "inertia", {key: f"{turned[place]:.9g}" for key, place in places.items()})


def _add_origin(element: ET.Element, xyz: FloatArray, rotation: Rotation) -> None:
    rpy = rotation.as_euler("xyz")
    ET.SubElement(element, "origin", xyz=_text(xyz), rpy=_text(rpy))


def _text(values: FloatArray) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def _rotation(element: ET.Element) -> Rotation:
    """Of the quaternion [w x y z]; MJCF normalises it."""
    w, x, y, z = _numbers(element.get("quat", "1 0 0 0"), 4)
    return Rotation.from_quat([x, y, z, w])


def _numbers(text: str, count: int) -> FloatArray:
    values = np.array([float(part) for part in text.split()])
    if values.size != count:
        raise ValueError(f"expected {count} numbers, got {text!r}")
    return values
