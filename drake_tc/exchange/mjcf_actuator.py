"""The actuator of a joint in an MJCF file, in place of the one that drives the joint there.

    position: force = gear kp (ctrl - gear q) - gear^2 kv v, written with gear = 1 and kv = 0
    motor:    force = gear ctrl, written with gear = kp, the torque for one unit of the drive's command
    dcmotor:  force = gear kt/R (ctrl - kt gear v), written with gear = 1 where the torque constant is known; its limit
              is that of ctrl, because MuJoCo 3.17 does not apply the voltage of `saturation` to it

Default classes hand on gear, gains, delay and limits to every actuator, so whatever differs from MuJoCo's own default
is written out where a file has default classes. A limit of force or command that the model says nothing of stays the
same limit at the joint when the gear changes.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from xml.dom import minidom

from drake_tc.errors import ParamsError
from drake_tc.exchange.dc_motor import dc_motor
from drake_tc.exchange.projection import Projection
from drake_tc.exchange.xml_text import append, child, number, put
from drake_tc.exchange.xml_text import element as new_element
from drake_tc.simulator_files.mjcf import ACTUATORS, joints_of
from drake_tc.simulator_files.terms import Terms
from drake_tc.simulator_files.xml_tree import xml_tree

ROUNDING = 1e-9
"""MuJoCo takes the sample before a delay has passed: rounding of a whole number of steps must not add one."""


def put_actuator(root: minidom.Element, projection: Projection, into: Path | None) -> Terms:
    """A position servo, a motor or a motor on a voltage for the joint; the terms that are left to the joint.

    Args:
        root: `<mujoco>`.
        projection: Of the joint.
        into: The user's file, for messages.

    Raises:
        ParamsError: several actuators drive the joint.
    """
    terms, joint = projection.terms, projection.joint
    mine = [node for group in _groups(root) for node in _elements(group) if node.getAttribute("joint") == joint]
    if len(mine) > 1:
        names = ", ".join(f"<{node.tagName} name={node.getAttribute('name')!r}>" for node in mine)
        raise ParamsError(
            f"{into}: {len(mine)} actuators drive joint {joint}: {names}; expected at most one,"
            " because the torques of the others would be added"
        )
    read = joints_of(xml_tree(root.toxml()))
    before = read[joint].actuators if joint in read else ()
    was = (before[0].kind, before[0].values) if before else ("", {})
    servo = bool(before) and before[0].is_servo
    element = mine[0] if mine else append(child(root, "actuator"), "position")
    motor = None if was[1].get("forcerange") else dc_motor(terms)  # a dcmotor has no forcerange of its own
    kind = "position" if terms.drive == "position_servo" else "motor" if motor is None else "dcmotor"
    if element.tagName != kind:
        element = _renamed(element, kind)
    if not element.hasAttribute("name"):
        put(element, name=joint)
    put(element, joint=joint)
    inherits = _has_defaults(element)
    if kind == "position":
        put(element, kp=terms.kp, kv=0.0 if inherits else None, dampratio=None, gear=1.0 if inherits else None)
    elif motor is not None:
        limit = 0.0 if terms.torque_limit is None else terms.torque_limit / terms.kp
        put(element, motorconst=motor.torque_constant, resistance=motor.resistance, gear=1.0 if inherits else None)
        put(element, ctrlrange=f"{number(-limit)} {number(limit)}" if limit else None)
        if was[1].get("ctrlrange"):
            put(element, ctrllimited="true" if limit else "false")
    else:
        put(element, gear=terms.kp)
    _put_delay(element, terms, timestep(root), was[1])
    if motor is not None:
        return replace(terms, damping=motor.damping)
    _put_limits(element, terms, *was, servo=servo)
    return terms


def _put_limits(element: minidom.Element, terms: Terms, kind: str, was: Mapping[str, str], *, servo: bool) -> None:
    """The identified limit of torque, or the limit of the file; and the file's limits of the command."""
    before = float((was.get("gear") or "1").split()[0])
    after = 1.0 if element.tagName == "position" else terms.kp
    renamed = kind != element.tagName
    if terms.torque_limit is not None:
        bound = terms.torque_limit / after
        put(element, forcerange=f"{number(-bound)} {number(bound)}")
        if was.get("forcelimited") == "false":
            put(element, forcelimited="true")
    elif was.get("forcerange") and (before != after or renamed):
        put(element, forcerange=_scaled(was["forcerange"], before / after))
    if not was.get("ctrlrange"):
        return
    factor = 1.0 / before if servo else before / after
    if servo != (element.tagName == "position"):  # an angle in place of a torque, or the other way round
        put(element, ctrlrange=None, ctrllimited="false" if _has_defaults(element) else None)
    elif factor != 1.0 or renamed:
        put(element, ctrlrange=_scaled(was["ctrlrange"], factor))


def _put_delay(element: minidom.Element, terms: Terms, step: float, was: Mapping[str, str]) -> None:
    if terms.delay:
        put(element, delay=terms.delay * (1.0 - ROUNDING), nsample=str(math.ceil(terms.delay / step - 1e-9) + 1))
    elif float(was.get("delay") or 0.0) > 0.0:
        put(element, delay=0.0, nsample="0")


def _scaled(limits: str, factor: float) -> str:
    return " ".join(number(float(value) * factor) for value in limits.split())


def _renamed(element: minidom.Element, tag: str) -> minidom.Element:
    """The element under another tag, with what both kinds have."""
    made = new_element(element, tag)
    for name in ("name", "class", "group", "joint"):
        if element.hasAttribute(name):
            made.setAttribute(name, element.getAttribute(name))
    if element.parentNode is not None:
        element.parentNode.replaceChild(made, element)
    return made


def _elements(parent: minidom.Element) -> list[minidom.Element]:
    return [node for node in parent.childNodes if isinstance(node, minidom.Element)]


def _groups(root: minidom.Element) -> list[minidom.Element]:
    """All `<actuator>` sections: MuJoCo merges them."""
    return [node for node in _elements(root) if node.tagName == "actuator"]


def _has_defaults(element: minidom.Element) -> bool:
    """Whether default classes of the element's file have attributes of actuators."""
    tops = element.ownerDocument.getElementsByTagName("default") if element.ownerDocument else []
    return any(top.getElementsByTagName(tag) for top in tops for tag in ACTUATORS)


def timestep(root: minidom.Element) -> float:
    """Of the file [s]; MuJoCo's own is 2 ms.

    Args:
        root: `<mujoco>`.
    """
    for option in root.getElementsByTagName("option"):
        if option.hasAttribute("timestep"):
            return float(option.getAttribute("timestep"))
    return 2e-3
