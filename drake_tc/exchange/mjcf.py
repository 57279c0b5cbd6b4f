"""MuJoCo's MJCF: joints and actuators of a user's file, or a bench of one hinge or slide a joint.

MuJoCo's joint has armature, frictionloss and damping, whose three numbers d0, d1, d2 make the passive force
-(d0 + d1 |v| + d2 v^2) v. Its dry friction is a soft constraint: below frictionloss the velocity decays with a time
constant, 20 ms unless solreffriction says otherwise. The identified friction is rigid, so that two time steps are
written, the shortest that MuJoCo accepts. A spring along the joint is its stiffness with springref. What the file's
joint has of these and the model lacks goes, because the model was identified without it. That attributes are what this
module takes them for is tested in MuJoCo itself; `mujoco_versions` has the versions that know them.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.dom import minidom

from drake_tc.errors import ParamsError
from drake_tc.exchange.mjcf_actuator import put_actuator, timestep
from drake_tc.exchange.projection import Projection
from drake_tc.exchange.xml_text import append, child, imported, named, number, parsed, put, read_xml, to_text, top
from drake_tc.exchange.xml_text import element as new_element
from drake_tc.simulator_files.mjcf import PLAY, gears_of, joints_of
from drake_tc.simulator_files.terms import Terms
from drake_tc.simulator_files.xml_tree import included_path, xml_tree

BENCH = """<mujoco model="drake_tc_bench">
  <compiler angle="radian"/>
  <option timestep="{step}" integrator="implicitfast"/>
  <worldbody/>
  <actuator/>
</mujoco>
"""
STEP = 1e-3
"""Of the bench [s]."""


def to_mjcf(projections: Sequence[Projection], into: Path | None = None, step: float = STEP) -> str:
    """The text of an MJCF file.

    Args:
        projections: One a joint.
        into: A user's file whose joints of these names get the terms, with what it includes in place of the includes;
            None writes a bench with one hinge or slide a joint and a link of next to no weight, to try the terms.
        step: Of the bench [s].

    Raises:
        ParamsError: a file that cannot be used, or that lacks a joint.
    """
    document = parsed(BENCH.format(step=number(step))) if into is None else read_xml(into, "mujoco")
    root = top(document)
    if into is None:
        _add_bench(root, projections)
    else:
        put_includes(root, into)
    joints, default_types = named(document, "joint", into), _default_types(document)
    for projection in projections:
        if projection.joint not in joints:
            raise ParamsError(f"{into}: no <joint name={projection.joint!r}>; joints: {', '.join(joints) or 'none'}")
        element = joints[projection.joint]
        _check_type(element, projection, into, default_types)
        numbers, degrees = _numbers_of_damping(root), _degrees(root)
        gears = _gears(root, projection.joint, joints, degrees=degrees)
        _joint(element, put_actuator(root, projection), numbers, timestep(root), degrees=degrees)
        half = 0.5 * projection.terms.backlash
        _gear(element, projection, PLAY, gears.get("range"), numbers, half * _in_file(projection, degrees=degrees))
        stiffness = 1.0 / projection.terms.compliance if projection.terms.compliance else 0.0
        _gear(element, projection, SPRING, gears.get("stiffness"), numbers, stiffness)
    return to_text(document)


SPRING = "_elasticity"
"""End of the name of a hinge that is the compliance of a gear."""


def put_includes(root: minidom.Element, path: Path) -> list[str]:
    """Put the content of every included file in the place of its `<include>`; names of these files.

    Args:
        root: `<mujoco>`.
        path: Of its file.

    Raises:
        ParamsError: a file that is not there, is no MJCF or includes itself.
    """
    names: list[str] = []

    def expand(element: minidom.Element, folders: tuple[Path, ...], inside: tuple[Path, ...]) -> None:
        for node in [each for each in element.childNodes if isinstance(each, minidom.Element)]:
            if node.tagName != "include":
                expand(node, folders, inside)
                continue
            name = node.getAttribute("file")
            found = included_path(name, folders)
            if found is None or found.resolve() in inside:
                why = "no such file" if found is None else "it includes itself"
                raise ParamsError(f"{path}: <include file={name!r}>: {why}")
            names.append(name)
            other = imported(element, top(read_xml(found, "")))
            expand(other, (*folders, found.parent), (*inside, found.resolve()))
            for each in list(other.childNodes):
                element.insertBefore(each, node)
            element.removeChild(node)

    expand(root, (path.parent,), (path.resolve(),))
    return names


def _gears(
    root: minidom.Element, joint: str, joints: Mapping[str, minidom.Element], *, degrees: bool
) -> dict[str, minidom.Element]:
    """Joints beside the driven one that are its gear: the play under "range", the spring under "stiffness"."""
    read = joints_of(xml_tree(root.toxml()))
    mine = [name for name, driven in gears_of(read, degrees=degrees).items() if driven == joint]
    return {"stiffness" if any(read[name].numbers("stiffness")) else "range": joints[name] for name in mine}


def _in_file(projection: Projection, *, degrees: bool) -> float:
    return 180.0 / math.pi if degrees and projection.joint_type != "prismatic" else 1.0


def _check_type(
    element: minidom.Element, projection: Projection, into: Path | None, default_types: Sequence[str]
) -> None:
    """Refuse a joint of another type than the model's, unless the joint has its type from a class of defaults."""
    stated, own = element.getAttribute("type"), "slide" if projection.joint_type == "prismatic" else "hinge"
    if not stated and not default_types:
        stated = "hinge"
    if stated in ("hinge", "slide") and stated != own:
        raise ParamsError(f"{into}: joint {projection.joint!r} is a {stated}, and the model's is a {own}")


def _default_types(document: minidom.Document) -> list[str]:
    """Types of joints that the classes of defaults state; without one, a joint that states none is a hinge."""
    defaults = document.getElementsByTagName("default")
    joints = [joint for each in defaults for joint in each.getElementsByTagName("joint")]
    return [joint.getAttribute("type") for joint in joints if joint.getAttribute("type")]


def _add_bench(root: minidom.Element, projections: Sequence[Projection]) -> None:
    world = child(root, "worldbody")
    for projection in projections:
        body = append(world, "body")
        put(body, name=f"{projection.joint}_link")
        kind, axis = ("slide", "1 0 0") if projection.joint_type == "prismatic" else ("hinge", "0 1 0")
        put(append(body, "joint"), name=projection.joint, type=kind, axis=axis)
        put(append(body, "inertial"), pos="0 0 0", mass=1e-3, diaginertia="1e-6 1e-6 1e-6")


def _joint(element: minidom.Element, terms: Terms, numbers: int, step: float, *, degrees: bool) -> None:
    """The passive terms; a spring or a limit that a class hands on, and that the model lacks, is written as 0."""
    damping = _damping(terms.damping, terms.quadratic, numbers=numbers)
    put(element, armature=terms.armature, damping=damping, frictionloss=terms.frictionloss)
    if terms.frictionloss:
        put(element, solreffriction=f"{number(2.0 * step)} 1")
    springs = [each for each in _defaults_of_joints(element) if each.hasAttribute("stiffness")]
    longest = max((len(each.getAttribute("stiffness").split()) for each in springs), default=1)
    put(element, stiffness=_damping(terms.stiffness, numbers=longest) if terms.stiffness or springs else None)
    rest = -terms.preload / terms.stiffness if terms.stiffness else 0.0
    unit = 180.0 / math.pi if degrees and element.getAttribute("type") != "slide" else 1.0
    put(element, springref=rest * unit if terms.stiffness else None, springyield=None)
    made = any(each.hasAttribute("springdamper") for each in _defaults_of_joints(element))
    put(element, springdamper="0 0" if made else None)


def _defaults_of_joints(element: minidom.Element) -> list[minidom.Element]:
    document = element.ownerDocument
    tops = document.getElementsByTagName("default") if document is not None else []
    return [joint for each in tops for joint in each.getElementsByTagName("joint")]


def _damping(*values: float, numbers: int) -> str:
    """Numbers up to the last that is not 0; at least `numbers`, because a class hands on those that are left out."""
    used = max((i + 1 for i, value in enumerate(values) if value), default=1)
    return " ".join(number(values[i] if i < len(values) else 0.0) for i in range(max(used, numbers)))


def _numbers_of_damping(root: minidom.Element) -> int:
    """The most numbers that a default class gives a joint's damping."""
    tops = [node for node in root.childNodes if isinstance(node, minidom.Element) and node.tagName == "default"]
    joints = [joint for top in tops for joint in top.getElementsByTagName("joint")]
    return max((len(joint.getAttribute("damping").split()) for joint in joints), default=1)


def _gear(
    element: minidom.Element,
    projection: Projection,
    end: str,
    old: minidom.Element | None,
    numbers: int,
    value: float,
) -> None:
    """A second hinge or slide about the same axis, after the driven one: the play or the spring of the gear, or none.

    Args:
        element: The driven joint.
        projection: Of the joint.
        end: `PLAY` or `SPRING`: of its name.
        old: That of the file.
        numbers: Of the damping.
        value: Half of the play [rad], [deg] or [m], or the stiffness [N m/rad]; 0: there is none.
    """
    parent = element.parentNode
    if not isinstance(parent, minidom.Element):
        return
    if not value:
        if old is not None and old.parentNode is not None:
            old.parentNode.removeChild(old)
        return
    made = old or new_element(element, "joint")
    for attribute in ("axis", "pos"):
        if element.hasAttribute(attribute):
            put(made, **{attribute: element.getAttribute(attribute)})
    put(
        made,
        name=made.getAttribute("name") or projection.joint + end,
        type="slide" if projection.joint_type == "prismatic" else "hinge",
        damping=_damping(0.0, numbers=numbers),
        armature="0",
        frictionloss="0",
    )
    if end == PLAY:
        put(made, range=f"{number(-value)} {number(value)}", limited="true", stiffness="0")
    else:
        put(made, stiffness=value, springref="0", limited="false", range=None)
    if old is None:
        parent.insertBefore(made, element.nextSibling)  # type: ignore[arg-type]


def _degrees(root: minidom.Element) -> bool:
    """Whether angles of the file are in degrees, as they are unless the compiler is told otherwise."""
    return all(each.getAttribute("angle") != "radian" for each in root.getElementsByTagName("compiler"))
