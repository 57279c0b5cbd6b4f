"""MuJoCo's MJCF: joints and actuators of a user's file, or a bench of one hinge or slide a joint.

MuJoCo's joint has armature, frictionloss and damping, whose three numbers d0, d1, d2 make the passive force
-(d0 + d1 |v| + d2 v^2) v. Its dry friction is a soft constraint: below frictionloss the velocity decays with a time
constant, 20 ms unless solreffriction says otherwise. The identified friction is rigid, so that two time steps are
written, the shortest that MuJoCo accepts. Its actuators have kp, forcerange and a delay. That these are what this
module takes them for is tested in MuJoCo itself; `mujoco_versions` has the versions that know them.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from xml.dom import minidom

from drake_tc.errors import ParamsError
from drake_tc.exchange.mjcf_actuator import put_actuator, timestep
from drake_tc.exchange.projection import Projection
from drake_tc.exchange.xml_text import append, child, named, number, parsed, put, read_xml, to_text, top
from drake_tc.exchange.xml_text import element as new_element
from drake_tc.simulator_files.terms import Terms

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
        into: A user's file whose joints of these names get the terms; None writes a bench with one hinge or slide a
            joint and a link of next to no weight, to try the terms.
        step: Of the bench [s].

    Raises:
        ParamsError: a file that cannot be used, or that lacks a joint.
    """
    document = parsed(BENCH.format(step=number(step))) if into is None else read_xml(into, "mujoco")
    root = top(document)
    if into is None:
        _add_bench(root, projections)
    joints, default_types = named(document, "joint", into), _default_types(document)
    for projection in projections:
        if projection.joint not in joints:
            raise ParamsError(f"{into}: no <joint name={projection.joint!r}>; joints: {', '.join(joints) or 'none'}")
        element = joints[projection.joint]
        _check_type(element, projection, into, default_types)
        numbers = _numbers_of_damping(root)
        _joint(element, put_actuator(root, projection, into), numbers, timestep(root))
        if projection.terms.backlash:
            _play(element, projection, numbers, degrees=_degrees(root))
    return to_text(document)


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


def _joint(element: minidom.Element, terms: Terms, numbers: int, step: float) -> None:
    damping = _damping(terms.damping, terms.quadratic, numbers=numbers)
    put(element, armature=terms.armature, damping=damping, frictionloss=terms.frictionloss)
    if terms.frictionloss:
        put(element, solreffriction=f"{number(2.0 * step)} 1")


def _damping(*values: float, numbers: int) -> str:
    """Numbers up to the last that is not 0; at least `numbers`, because a class hands on those that are left out."""
    used = max((i + 1 for i, value in enumerate(values) if value), default=1)
    return " ".join(number(values[i] if i < len(values) else 0.0) for i in range(max(used, numbers)))


def _numbers_of_damping(root: minidom.Element) -> int:
    """The most numbers that a default class gives a joint's damping."""
    tops = [node for node in root.childNodes if isinstance(node, minidom.Element) and node.tagName == "default"]
    joints = [joint for top in tops for joint in top.getElementsByTagName("joint")]
    return max((len(joint.getAttribute("damping").split()) for joint in joints), default=1)


def _play(element: minidom.Element, projection: Projection, numbers: int, *, degrees: bool) -> None:
    """A free hinge or slide of small range about the same axis, after the driven one: the gear's play."""
    parent, name = element.parentNode, f"{projection.joint}_backlash"
    if not isinstance(parent, minidom.Element):
        return
    others = [n for n in parent.childNodes if isinstance(n, minidom.Element) and n.getAttribute("name") == name]
    made = others[0] if others else new_element(element, "joint")
    slides = projection.joint_type == "prismatic"
    half = 0.5 * projection.terms.backlash * (180.0 / math.pi if degrees and not slides else 1.0)
    for attribute in ("axis", "pos"):
        if element.hasAttribute(attribute):
            put(made, **{attribute: element.getAttribute(attribute)})
    put(
        made,
        name=name,
        type="slide" if slides else "hinge",
        range=f"{number(-half)} {number(half)}",
        limited="true",
        damping=_damping(0.0, numbers=numbers),
        armature="0",
        frictionloss="0",
        stiffness="0",
    )
    if not others:
        parent.insertBefore(made, element.nextSibling)  # type: ignore[arg-type]


def _degrees(root: minidom.Element) -> bool:
    """Whether angles of the file are in degrees, as they are unless the compiler is told otherwise."""
    return all(each.getAttribute("angle") != "radian" for each in root.getElementsByTagName("compiler"))
