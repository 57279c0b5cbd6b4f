"""A URDF as a tree of links and joints, read leniently: what we do not use, we do not look at.

A link in two parts, for a force/torque sensor inside it that no joint of the URDF stands for.
"""

import copy
import math
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers.expat import ExpatError

import numpy as np

from drake_tc.config.quoted import quoted
from drake_tc.errors import ParamsError
from drake_tc.robot.fields import Pose, Triple
from drake_tc.simulator_files.xml_tree import line_of, xml_tree

MOVABLE = ("revolute", "continuous", "prismatic")
"""Types of one degree of freedom: those that can be driven, or locked at a position."""
KINDS = (*MOVABLE, "fixed")
_MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
_SLACK, _NOTHING = 1e-6, 1e-15
"""Of the largest moment of inertia, as files round; and an inertia that is none [kg m^2]."""

HEAVIEST = 1e9
"""Mass [kg] and moments of inertia [kg m^2] of links stay below it: products of larger ones may overflow."""


def numbers(where: str, text: str | None, count: int) -> tuple[float, ...]:
    """The finite numbers in an attribute.

    Raises:
        ParamsError: others, or not as many; `where` stands before the message.
    """
    try:
        values = tuple(float(part) for part in (text or "").split())
    except ValueError:
        values = ()
    if len(values) != count or not all(map(math.isfinite, values)):
        what = "a finite number" if count == 1 else f"{count} finite numbers"
        raise ParamsError(f"{where}: expected {what}, got {'none' if text is None else quoted(text)}")
    return values


def check_names(path: Path, root: ET.Element) -> None:
    """Refuse a link or joint that is there twice.

    Raises:
        ParamsError: one is.
    """
    for tag in ("link", "joint"):
        counts = Counter(element.get("name") for element in root.findall(tag))
        twice = next((name for name, count in counts.items() if name and count > 1), None)
        if twice is not None:
            raise ParamsError(f"{path}: {tag} {quoted(twice)} is there twice; expected different names")


def check_inertials(path: Path, root: ET.Element) -> None:
    """Refuse masses below zero and inertias that no body has.

    Raises:
        ParamsError: a link has one, or what stands there is no number.
    """
    for link in root.findall("link"):
        inertial = link.find("inertial")
        if inertial is None:
            continue
        where = f"{path}: link {quoted(link.get('name'))}"
        mass, inertia = inertial.find("mass"), inertial.find("inertia")
        if mass is not None:
            (value,) = numbers(f"{where} mass", mass.get("value"), 1)
            if not 0.0 <= value < HEAVIEST:
                raise ParamsError(f"{where} mass: expected a number from 0 to {HEAVIEST:g} [kg], got {value:g}")
        if inertia is not None:
            _check_inertia(where, inertia)
        origin = inertial.find("origin")
        for name in ("xyz", "rpy") if origin is not None else ():
            if origin is not None and origin.get(name) is not None:
                numbers(f"{where} inertial {name}", origin.get(name), 3)


def _check_inertia(where: str, element: ET.Element) -> None:
    """The moments of inertia are numbers, and none about any axis is negative."""
    given = {
        name: numbers(f"{where} {name}", element.get(name, "0" if name[1] != name[2] else None), 1)[0]
        for name in _MOMENTS
    }
    xx, yy, zz, xy, xz, yz = (given[name] for name in _MOMENTS)
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    scale = float(np.max(np.abs(matrix)))
    if scale >= HEAVIEST:
        raise ParamsError(f"{where} inertia: expected moments below {HEAVIEST:g} [kg m^2], got {scale:g}")
    if scale > _NOTHING and float(np.linalg.eigvalsh(matrix / scale)[0]) < -_SLACK:
        raise ParamsError(f"{where} inertia: expected moments of inertia >= 0 about every axis, got {quoted(given)}")


def check_kind(where: str, kind: str) -> None:
    """Refuse a type of joint that is neither fixed nor of one degree of freedom.

    Raises:
        ParamsError: it is.
    """
    if kind not in KINDS:
        raise ParamsError(f"{where}: type {quoted(kind)} cannot be simulated; expected one of {', '.join(KINDS)}")


def check_mimics(path: Path, leaders: Mapping[str, str], movable: Iterable[str]) -> None:
    """Refuse joints that follow what does not move, or each other.

    Args:
        path: The file.
        leaders: Joint to the joint that it follows.
        movable: Joints of one degree of freedom.

    Raises:
        ParamsError: one does.
    """
    known = set(movable)
    for joint in leaders:
        at, seen = joint, {joint}
        while at in leaders:
            at = leaders[at]
            if at not in known:
                raise ParamsError(f"{path}: joint {quoted(joint)} mimic: no joint {quoted(at)} that moves")
            if at in seen:
                raise ParamsError(f"{path}: joint {quoted(joint)} mimic: the joints follow each other in a loop")
            seen.add(at)


def check_tree(path: Path, links: Iterable[str], ends: Mapping[str, tuple[str, str]]) -> None:
    """Refuse links that do not hang together as one tree.

    Args:
        path: The file.
        links: Their names.
        ends: Joint to its parent and child.

    Raises:
        ParamsError: a joint names a link that is not there, a link hangs on two joints, links form a loop or nothing
            connects them.
    """
    known = set(links)
    above: dict[str, str] = {}
    for joint, (parent, child) in ends.items():
        for link in (parent, child):
            if link not in known:
                raise ParamsError(f"{path}: joint {quoted(joint)}: no link {quoted(link)}")
        if child in above:
            raise ParamsError(
                f"{path}: link {quoted(child)} hangs on two joints, {quoted(above[child])} and {quoted(joint)};"
                " expected a tree"
            )
        above[child] = joint
    for link in known:
        seen = {link}
        while link in above:
            link = ends[above[link]][0]
            if link in seen:
                raise ParamsError(f"{path}: joint {quoted(above[link])} closes a loop; expected a tree")
            seen.add(link)
    roots = [link for link in links if link not in above]
    if len(roots) > 1:
        raise ParamsError(
            f"{path}: no joint connects {quoted(roots[0])} and {quoted(roots[1])}; expected one tree of links"
        )


@dataclass(frozen=True)
class LinkSplit:
    """A sensor inside a link: the part beyond it hangs on a fixed joint, and so does all that hung on the link.

    The two parts share the link's mass m and inertia I about its centre of mass c:

        this side    (1 - s) m, (1 - s) I      beyond    s m, s I      both at c

    so that both together are the link. The part beyond has the link's frame.

    Attributes:
        link: The link, and the name of the part on the base's side.
        sensor: Name of the sensor.
        share: s, of the link's mass beyond the sensor, in [0, 1].
    """

    link: str
    sensor: str
    share: float

    @property
    def joint(self) -> str:
        """Name of the fixed joint that carries the sensor."""
        return f"{self.sensor}_inside_{self.link}"

    @property
    def beyond(self) -> str:
        """Name of the part beyond the sensor."""
        return f"{self.link}_beyond_{self.sensor}"

    def apply(self, root: ET.Element) -> None:
        """Split the link in the URDF `root`, which has it."""
        link = next(each for each in root.findall("link") if each.get("name") == self.link)
        part = ET.Element("link", {"name": self.beyond})
        part.extend(copy.deepcopy(inertial) for inertial in link.findall("inertial"))
        _scale(part, self.share)
        _scale(link, 1.0 - self.share)
        for parent in root.iterfind("joint/parent"):
            if parent.get("link") == self.link:
                parent.set("link", self.beyond)
        joint = ET.Element("joint", {"name": self.joint, "type": "fixed"})
        ET.SubElement(joint, "parent", {"link": self.link})
        ET.SubElement(joint, "child", {"link": self.beyond})
        root.extend([part, joint])


def _scale(link: ET.Element, share: float) -> None:
    """Mass and moments of inertia times `share`; without an inertial where nothing is left."""
    for inertial in link.findall("inertial"):
        if share == 0.0:
            link.remove(inertial)
            continue
        for entry in (*inertial.findall("mass"), *inertial.findall("inertia")):
            for key, value in entry.attrib.items():
                entry.set(key, repr(share * float(value)))


_WORLD = "world"
DEEPEST = 50
"""Levels of elements in each other."""
LARGEST = 2**26
"""Size of a file [bytes]."""


@dataclass(frozen=True)
class Mimic:
    """q = multiplier q_of + offset."""

    of: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class JointTag:
    """One joint of the URDF.

    Attributes:
        name, kind, parent, child: As in the file.
        origin: X_PJ in the parent link.
        axis: Unit vector in the joint's frame.
        lower, upper: [rad or m]; infinite where the file gives none, or gives an empty range.
        velocity, effort: Limits [rad/s, N m]; infinite where the file gives none, or zero as a placeholder.
        mimic: The joint it follows, or None.
        line: Of the file.
    """

    name: str
    kind: str
    parent: str
    child: str
    origin: Pose
    axis: Triple
    lower: float
    upper: float
    velocity: float
    effort: float
    mimic: Mimic | None
    line: int = 0

    @property
    def movable(self) -> bool:
        """Whether it has one degree of freedom."""
        return self.kind in MOVABLE


@dataclass(frozen=True)
class UrdfTree:
    """Links and joints of a URDF, without a link `world` and its joints.

    Attributes:
        root: The XML element `robot`.
        links: Names.
        joints: Name to joint, in the file's order.
        mounts: Joints whose parent is the link `world`, by their child link.
    """

    root: ET.Element
    links: tuple[str, ...]
    joints: Mapping[str, JointTag]
    mounts: Mapping[str, JointTag] = field(default_factory=dict)

    def beyond(self, link: str) -> set[str]:
        """The link and all links that hang from it."""
        found = {link}
        grew = True
        while grew:
            new = {joint.child for joint in self.joints.values() if joint.parent in found} - found
            grew = bool(new)
            found |= new
        return found

    @property
    def movable(self) -> tuple[str, ...]:
        """Names of the joints of one degree of freedom."""
        return tuple(name for name, joint in self.joints.items() if joint.movable)


def _triple(where: str, value: str | None, default: Triple) -> Triple:
    if value is None:
        return default
    x, y, z = numbers(where, value, 3)
    return x, y, z


def _float(where: str, element: ET.Element | None, name: str, default: float) -> float:
    value = None if element is None else element.get(name)
    if value is None:
        return default
    return numbers(f"{where} {name}", value, 1)[0]


def _origin(where: str, element: ET.Element) -> Pose:
    origin = element.find("origin")
    if origin is None:
        return Pose()
    zero = (0.0, 0.0, 0.0)
    return Pose(_triple(f"{where} xyz", origin.get("xyz"), zero), _triple(f"{where} rpy", origin.get("rpy"), zero))


def _link_of(where: str, element: ET.Element, tag: str) -> str:
    found = element.find(tag)
    name = None if found is None else found.get("link")
    if not name:
        raise ParamsError(f"{where}: expected <{tag} link=...>, got none")
    return name


def _mimic(where: str, element: ET.Element) -> Mimic | None:
    tag = element.find("mimic")
    if tag is None or not tag.get("joint"):
        return None
    return Mimic(str(tag.get("joint")), _float(where, tag, "multiplier", 1.0), _float(where, tag, "offset", 0.0))


def _axis(where: str, element: ET.Element, kind: str) -> Triple:
    tag = element.find("axis")
    axis = _triple(f"{where} axis", None if tag is None else tag.get("xyz"), (1.0, 0.0, 0.0))
    length = math.hypot(*axis)
    if kind not in MOVABLE:
        return axis
    if not length > 0.0:
        raise ParamsError(f"{where} axis: expected a vector of some length, got {axis}")
    return axis[0] / length, axis[1] / length, axis[2] / length


def _joint(path: Path, element: ET.Element) -> JointTag:
    name = element.get("name", "")
    where = f"{path}: joint {quoted(name)}"
    kind = element.get("type", "")
    limit = element.find("limit")
    lower, upper = _float(where, limit, "lower", -math.inf), _float(where, limit, "upper", math.inf)
    if lower > upper and kind != "continuous":
        raise ParamsError(f"{where}: limit: expected lower <= upper, got {lower:g} and {upper:g}")
    if kind == "continuous" or lower == upper:  # two zeros stand for none
        lower, upper = -math.inf, math.inf
    velocity, effort = _float(where, limit, "velocity", math.inf), _float(where, limit, "effort", math.inf)
    for what, value in (("velocity", velocity), ("effort", effort)):
        if value < 0.0:
            raise ParamsError(f"{where}: limit {what}: expected a number >= 0, got {value:g}")
    return JointTag(
        name=name,
        kind=kind,
        parent=_link_of(where, element, "parent"),
        child=_link_of(where, element, "child"),
        origin=_origin(where, element),
        axis=_axis(where, element, kind),
        lower=lower,
        upper=upper,
        velocity=velocity if velocity > 0.0 else math.inf,
        effort=effort if effort > 0.0 else math.inf,
        mimic=_mimic(where, element),
        line=line_of(element),
    )


def _elements(root: ET.Element, tag: str) -> Iterator[ET.Element]:
    yield from (element for element in root.findall(tag) if element.get("name"))


def read_urdf(path: Path, splits: Iterable[LinkSplit] = ()) -> UrdfTree:
    """Read a URDF.

    Args:
        path: The file.
        splits: Links that a sensor inside them divides.

    Raises:
        ParamsError: the file cannot be read or is no URDF; the message names file and joint.
    """
    root = _root(path)
    check_names(path, root)
    check_inertials(path, root)
    for split in splits:
        split.apply(root)
    links = tuple(str(link.get("name")) for link in _elements(root, "link") if link.get("name") != _WORLD)
    joints = {joint.name: joint for joint in (_joint(path, element) for element in _elements(root, "joint"))}
    kept = {name: joint for name, joint in joints.items() if joint.parent != _WORLD}
    for joint in kept.values():
        check_kind(f"{path}: joint {quoted(joint.name)}", joint.kind)
    check_tree(path, links, {name: (joint.parent, joint.child) for name, joint in kept.items()})
    leaders = {name: joint.mimic.of for name, joint in kept.items() if joint.mimic is not None}
    check_mimics(path, leaders, [name for name, joint in kept.items() if joint.kind in MOVABLE])
    return UrdfTree(root, links, kept, {joint.child: joint for joint in joints.values() if joint.parent == _WORLD})


def _root(path: Path) -> ET.Element:
    """The element `robot` of a file."""
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST + 1)
        if len(content) > LARGEST:
            raise ParamsError(f"{path}: expected a URDF of at most {LARGEST >> 20} MiB")
        root = xml_tree(content.decode("utf-8-sig"))
    except OSError as error:
        raise ParamsError(f"{path}: cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        raise ParamsError(f"{path}: expected a URDF in UTF-8; byte {error.start} is not") from None
    except (ExpatError, ValueError) as error:  # ValueError: an encoding that is declared and unknown
        raise ParamsError(f"{path}: not valid XML: {error}") from None
    if root.tag != "robot":
        raise ParamsError(f"{path}: expected a URDF (<robot>), got <{quoted(root.tag)[1:-1]}>")
    deepest = _depth(root)
    if deepest > DEEPEST:
        raise ParamsError(f"{path}: expected elements at most {DEEPEST} levels deep, got {deepest}")
    return root


def _depth(root: ET.Element) -> int:
    """Levels of elements in each other."""
    depth, level = 0, [root]
    while level:
        depth, level = depth + 1, [child for element in level for child in element]
    return depth
