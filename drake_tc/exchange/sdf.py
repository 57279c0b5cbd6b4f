"""SDFormat joints: `<axis><dynamics>` with damping, friction and spring, and `<limit><effort>`."""

from collections.abc import Sequence
from pathlib import Path
from xml.dom import minidom

from drake_tc.errors import ParamsError
from drake_tc.exchange.projection import Projection
from drake_tc.exchange.urdf import check_type
from drake_tc.exchange.xml_text import append, child, number, parsed, put, read_xml, text, to_text

BENCH = '<sdf version="1.9">\n  <model name="drake_tc_bench">\n    <link name="base"/>\n  </model>\n</sdf>\n'


def to_sdf(projections: Sequence[Projection], into: Path | None = None) -> str:
    """The text of an SDFormat file.

    Args:
        projections: One a joint.
        into: A user's file; None writes a model with one revolute or prismatic joint each and a link of next to no
            weight.

    Raises:
        ParamsError: a file that cannot be used, that lacks a joint, or in which a joint is of another type.
    """
    document = parsed(BENCH) if into is None else read_xml(into, "sdf")
    if into is None:
        model = document.getElementsByTagName("model")[0]
        for projection in projections:
            _bench_joint(model, projection)
    joints = {each.getAttribute("name"): each for each in document.getElementsByTagName("joint")}
    for projection in projections:
        if projection.joint not in joints:
            raise ParamsError(f"{into}: no <joint name={projection.joint!r}>; joints: {', '.join(joints) or 'none'}")
        check_type(joints[projection.joint].getAttribute("type"), projection, into)
        axis, terms = child(joints[projection.joint], "axis"), projection.terms
        dynamics = child(axis, "dynamics")
        _set(child(dynamics, "damping"), terms.damping)
        _set(child(dynamics, "friction"), terms.frictionloss)
        if terms.stiffness or any(node.nodeName.startswith("spring_") for node in dynamics.childNodes):
            _set(child(dynamics, "spring_stiffness"), terms.stiffness)
            _set(child(dynamics, "spring_reference"), -terms.preload / terms.stiffness if terms.stiffness else 0.0)
        if terms.torque_limit is not None:
            _set(child(child(axis, "limit"), "effort"), terms.torque_limit)
    return to_text(document)


def _bench_joint(model: minidom.Element, projection: Projection) -> None:
    name = projection.joint
    rotor = append(model, "link")
    put(rotor, name=f"{name}_link")
    inertial = append(rotor, "inertial")
    _set(append(inertial, "mass"), 1e-3)
    inertia = append(inertial, "inertia")
    for moment in ("ixx", "iyy", "izz"):
        _set(append(inertia, moment), 1e-6)
    joint = append(model, "joint")
    put(joint, name=name, type=projection.joint_type)
    for tag, link in (("parent", "base"), ("child", f"{name}_link")):
        _set(append(joint, tag), link)
    _set(append(append(joint, "axis"), "xyz"), "1 0 0" if projection.joint_type == "prismatic" else "0 1 0")


def _set(element: minidom.Element, value: float | str) -> None:
    """Make a number or a text the element's content."""
    while element.firstChild is not None:
        element.removeChild(element.firstChild)
    element.appendChild(text(element, value if isinstance(value, str) else number(value)))
