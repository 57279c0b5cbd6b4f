"""MuJoCo's MJCF: joints and actuators of a user's file, or a bench of one hinge a joint.

MuJoCo's joint has armature, frictionloss and damping, whose three numbers d0, d1, d2 make the passive force
-(d0 + d1 |v| + d2 v^2) v; its actuators have kp, forcerange and, from 3.6 on, a delay. That these are what this module
takes them for is tested in MuJoCo itself.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from xml.dom import minidom

from drake_tc.errors import ParamsError
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
ROUNDING = 1e-9
"""MuJoCo takes the sample before a delay has passed: rounding of a whole number of steps must not add one."""
KINDS = ("position", "motor", "general", "velocity", "intvelocity", "damper", "cylinder", "dcmotor")


def to_mjcf(projections: Sequence[Projection], into: Path | None = None, step: float = STEP) -> str:
    """The text of an MJCF file.

    Args:
        projections: One a joint.
        into: A user's file whose joints of these names get the terms; None writes a bench with one hinge a joint and
            a link of next to no weight, to try the terms.
        step: Of the bench [s].

    Raises:
        ParamsError: a file that cannot be used, or that lacks a joint.
    """
    document = parsed(BENCH.format(step=number(step))) if into is None else read_xml(into, "mujoco")
    root = top(document)
    if into is None:
        _add_bench(root, projections)
    joints = named(document, "joint", into)
    for projection in projections:
        if projection.joint not in joints:
            raise ParamsError(f"{into}: no <joint name={projection.joint!r}>; joints: {', '.join(joints) or 'none'}")
        element = joints[projection.joint]
        _joint(element, projection.terms)
        _actuator(root, projection, _timestep(root))
        if projection.terms.backlash:
            _play(element, projection, degrees=_degrees(root))
    return to_text(document)


def _add_bench(root: minidom.Element, projections: Sequence[Projection]) -> None:
    world = child(root, "worldbody")
    for projection in projections:
        body = append(world, "body")
        put(body, name=f"{projection.joint}_link")
        put(append(body, "joint"), name=projection.joint, type="hinge", axis="0 1 0")
        put(append(body, "inertial"), pos="0 0 0", mass=1e-3, diaginertia="1e-6 1e-6 1e-6")


def _joint(element: minidom.Element, terms: Terms) -> None:
    damping = number(terms.damping) + (f" {number(terms.quadratic)}" if terms.quadratic else "")
    put(element, armature=terms.armature, damping=damping, frictionloss=terms.frictionloss)


def _actuator(root: minidom.Element, projection: Projection, step: float) -> None:
    """A position servo or a motor for the joint, in place of what drives it in the file."""
    terms, actuators = projection.terms, child(root, "actuator")
    mine = [
        node
        for node in actuators.childNodes
        if isinstance(node, minidom.Element)
        and node.getAttribute("joint") == projection.joint
        and node.tagName in KINDS
    ]
    element = mine[0] if mine else append(actuators, "position")
    kind = "position" if terms.drive == "position_servo" else "motor"
    if element.tagName != kind:
        element = _renamed(element, kind)
    if not element.hasAttribute("name"):
        put(element, name=projection.joint)
    put(element, joint=projection.joint)
    if kind == "position":
        put(element, kp=terms.kp, kv=None, gear=None)
    else:
        put(element, gear=terms.kp)
    limit = terms.torque_limit
    if limit is not None:
        scale = 1.0 if kind == "position" else terms.kp
        put(element, forcerange=f"{number(-limit / scale)} {number(limit / scale)}")
    if terms.delay:
        put(element, delay=terms.delay * (1.0 - ROUNDING), nsample=str(math.ceil(terms.delay / step - 1e-9) + 1))


def _renamed(element: minidom.Element, tag: str) -> minidom.Element:
    """The element under another tag, with what both kinds have."""
    made = new_element(element, tag)
    for name in ("name", "class", "group", "joint"):
        if element.hasAttribute(name):
            made.setAttribute(name, element.getAttribute(name))
    if element.parentNode is not None:
        element.parentNode.replaceChild(made, element)
    return made


def _play(element: minidom.Element, projection: Projection, *, degrees: bool) -> None:
    """A free hinge of small range about the same axis, after the driven one: the gear's play."""
    parent, name = element.parentNode, f"{projection.joint}_backlash"
    if not isinstance(parent, minidom.Element):
        return
    others = [n for n in parent.childNodes if isinstance(n, minidom.Element) and n.getAttribute("name") == name]
    made = others[0] if others else new_element(element, "joint")
    half = 0.5 * projection.terms.backlash * (180.0 / math.pi if degrees else 1.0)
    for attribute in ("axis", "pos"):
        if element.hasAttribute(attribute):
            put(made, **{attribute: element.getAttribute(attribute)})
    put(
        made,
        name=name,
        type="hinge",
        range=f"{number(-half)} {number(half)}",
        limited="true",
        damping="0",
        armature="0",
    )
    if not others:
        parent.insertBefore(made, element.nextSibling)  # type: ignore[arg-type]


def _timestep(root: minidom.Element) -> float:
    """Of the file [s]; MuJoCo's own is 2 ms."""
    for option in root.getElementsByTagName("option"):
        if option.hasAttribute("timestep"):
            return float(option.getAttribute("timestep"))
    return 2e-3


def _degrees(root: minidom.Element) -> bool:
    """Whether angles of the file are in degrees, as they are unless the compiler is told otherwise."""
    return all(each.getAttribute("angle") != "radian" for each in root.getElementsByTagName("compiler"))
