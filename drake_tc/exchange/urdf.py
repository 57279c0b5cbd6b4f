"""Joints of URDF and SDFormat files. Of a URDF: `<dynamics>`, `<limit effort>`, and Drake's tags of the actuator.

<dynamics damping="f_v" friction="f_c"/>                      [N m s/rad], [N m]
<drake:rotor_inertia value="J"/> <drake:gear_ratio value="1"/>    J is reflected: J gear_ratio^2 [kg m^2]
<drake:controller_gains p="kp" d="0"/>                         [N m/rad], [N m s/rad]

Of an SDFormat file: `<axis><dynamics>` with damping, friction and spring, and `<limit><effort>`.
"""

from collections.abc import Sequence
from pathlib import Path
from xml.dom import minidom

from drake_tc.errors import ParamsError
from drake_tc.exchange.projection import Projection
from drake_tc.exchange.xml_text import append, child, named, number, parsed, put, read_xml, text, to_text, top
from drake_tc.simulator_files.terms import Terms
from drake_tc.simulator_files.urdf import SIMPLE

DRAKE = "http://drake.mit.edu"
BENCH = '<robot name="drake_tc_bench">\n  <link name="base"/>\n</robot>\n'
GAINS = "drake:controller_gains"
"""Of a servo; a file that has them gets those of the model, whether Drake's tags were asked for or not."""
GEAR_RATIO = 1.0
"""The rotor inertia is exported as it is reflected to the joint."""


def to_urdf(projections: Sequence[Projection], into: Path | None = None, *, drake: bool = False) -> str:
    """The text of a URDF file.

    Args:
        projections: One a joint.
        into: A user's file; None writes a robot with one revolute or prismatic joint each, and its transmission: Drake
            makes an actuator of nothing else.
        drake: Add Drake's tags.

    Raises:
        ParamsError: a file that cannot be used, or that lacks a joint.
    """
    document = parsed(BENCH) if into is None else read_xml(into, "robot")
    root = top(document)
    if into is None:
        for projection in projections:
            _bench_joint(root, projection)
            _actuator(root, projection.joint)
    joints = named(document, "joint", ("robot",))
    for projection in projections:
        if projection.joint not in joints:
            raise ParamsError(f"{into}: no <joint name={projection.joint!r}>; joints: {', '.join(joints) or 'none'}")
        _check_type(joints[projection.joint].getAttribute("type"), projection, into)
        of_joint = _transmissions(root, projection.joint)
        _put_gains([tag for each in of_joint for tag in each.getElementsByTagName(GAINS)], projection.terms)
        _joint(joints[projection.joint], projection, friction=not drake)
        if drake:
            if not root.hasAttribute("xmlns:drake"):
                put(root, **{"xmlns:drake": DRAKE})
            _drake(root, projection)
    return to_text(document)


def _bench_joint(root: minidom.Element, projection: Projection) -> None:
    name, slides = projection.joint, projection.joint_type == "prismatic"
    link = append(root, "link")
    put(link, name=f"{name}_link")
    inertial = append(link, "inertial")
    put(append(inertial, "mass"), value=1e-3)
    put(append(inertial, "inertia"), ixx=1e-6, iyy=1e-6, izz=1e-6, ixy=0.0, ixz=0.0, iyz=0.0)
    joint = append(root, "joint")
    put(joint, name=name, type=projection.joint_type)
    put(append(joint, "parent"), link="base")
    put(append(joint, "child"), link=f"{name}_link")
    put(append(joint, "axis"), xyz="1 0 0" if slides else "0 1 0")
    reach = 10.0 if slides else 3.14159
    put(append(joint, "limit"), lower=-reach, upper=reach, velocity=100.0, effort=1000.0)


def _check_type(found: str, projection: Projection, into: Path | None) -> None:
    """Refuse a joint of a user's file that turns where the model's slides, and the reverse.

    Raises:
        ParamsError: it does.
    """
    if (found == "prismatic") != (projection.joint_type == "prismatic"):
        raise ParamsError(f"{into}: joint {projection.joint!r} is {found}; the model has a {projection.joint_type}")


def _joint(element: minidom.Element, projection: Projection, *, friction: bool) -> None:
    terms = projection.terms
    damping = terms.damping - terms.derivative_gain  # the servo has that part
    put(child(element, "dynamics"), damping=damping, friction=terms.frictionloss if friction else None)
    if terms.torque_limit is not None:
        put(child(element, "limit"), effort=terms.torque_limit)
    for limit in element.getElementsByTagName("limit"):
        if not friction and _is_zero(limit.getAttribute("effort")):
            put(limit, effort=None)


def _is_zero(effort: str) -> bool:
    """Whether a limit is the placeholder 0: Drake makes no actuator of such a joint."""
    return "0" in effort and not effort.strip(" 0.")


def _drake(root: minidom.Element, projection: Projection) -> None:
    """The tags of the joint's transmission, which is appended where there is none."""
    terms = projection.terms
    actuator = _actuator(root, projection.joint)
    put(child(actuator, "drake:rotor_inertia"), value=terms.armature)
    put(child(actuator, "drake:gear_ratio"), value=GEAR_RATIO)
    if terms.drive == "position_servo":
        put(child(actuator, GAINS), p=terms.kp, d=terms.derivative_gain)


def _put_gains(found: Sequence[minidom.Element], terms: Terms) -> float:
    """Drake's gains of a servo, where the file has them already; the damping that is then the servo's [N m s/rad].

    A drive of another kind has none: they go.
    """
    if terms.drive == "position_servo" and found:
        put(found[0], p=terms.kp, d=terms.derivative_gain)
        return terms.derivative_gain
    for tag in found:
        if tag.parentNode is not None:
            tag.parentNode.removeChild(tag)
    return 0.0


def _actuator(root: minidom.Element, joint: str) -> minidom.Element:
    actuator = child(_transmission(root, joint), "actuator")
    if not actuator.hasAttribute("name"):
        put(actuator, name=joint)
    return actuator


def _transmissions(root: minidom.Element, joint: str) -> list[minidom.Element]:
    """Simple ones of the joint: Drake makes no actuator of others, nor of those inside of other tags."""
    return [
        each
        for each in root.childNodes
        if isinstance(each, minidom.Element)
        and each.tagName == "transmission"
        and any(of.getAttribute("name") == joint for of in each.getElementsByTagName("joint"))
        and _type_of(each).endswith(SIMPLE)
    ]


def _type_of(transmission: minidom.Element) -> str:
    types = transmission.getElementsByTagName("type")
    said = types[0].firstChild if types else None
    return str(said.nodeValue).strip() if said is not None else transmission.getAttribute("type") or SIMPLE


def _transmission(root: minidom.Element, joint: str) -> minidom.Element:
    for transmission in _transmissions(root, joint):
        return transmission
    made = append(root, "transmission")
    put(made, name=f"{joint}_transmission")
    append(made, "type").appendChild(text(made, "transmission_interface/SimpleTransmission"))
    inner = append(made, "joint")
    put(inner, name=joint)
    append(inner, "hardwareInterface").appendChild(text(made, "EffortJointInterface"))
    return made


SDF_BENCH = '<sdf version="1.9">\n  <model name="drake_tc_bench">\n    <link name="base"/>\n  </model>\n</sdf>\n'


def to_sdf(projections: Sequence[Projection], into: Path | None = None) -> str:
    """The text of an SDFormat file.

    Args:
        projections: One a joint.
        into: A user's file; None writes a model with one revolute or prismatic joint each and a link of next to no
            weight.

    Raises:
        ParamsError: a file that cannot be used, that lacks a joint, or in which a joint is of another type.
    """
    document = parsed(SDF_BENCH) if into is None else read_xml(into, "sdf")
    if into is None:
        model = document.getElementsByTagName("model")[0]
        for projection in projections:
            _sdf_bench_joint(model, projection)
    joints = named(document, "joint", ("model", "world"))
    for projection in projections:
        if projection.joint not in joints:
            tags = [
                uri for each in document.getElementsByTagName("include") for uri in each.getElementsByTagName("uri")
            ]
            included = ", ".join(str(each.firstChild.nodeValue).strip() for each in tags if each.firstChild)
            hint = f"; it includes {included}: name the file of the model itself" if included else ""
            raise ParamsError(
                f"{into}: no <joint name={projection.joint!r}>; joints: {', '.join(joints) or 'none'}{hint}"
            )
        _check_type(joints[projection.joint].getAttribute("type"), projection, into)
        axis, terms = child(joints[projection.joint], "axis"), projection.terms
        dynamics = child(axis, "dynamics")
        gains = joints[projection.joint].getElementsByTagName(GAINS)
        _set(child(dynamics, "damping"), terms.damping - _put_gains(gains, terms))
        _set(child(dynamics, "friction"), terms.frictionloss)
        if terms.stiffness or any(node.nodeName.startswith("spring_") for node in dynamics.childNodes):
            _set(child(dynamics, "spring_stiffness"), terms.stiffness)
            _set(child(dynamics, "spring_reference"), -terms.preload / terms.stiffness if terms.stiffness else 0.0)
        if terms.torque_limit is not None:
            _set(child(child(axis, "limit"), "effort"), terms.torque_limit)
        for effort in axis.getElementsByTagName("effort") if gains else ():
            if effort.firstChild is not None and _is_zero(str(effort.firstChild.nodeValue)):
                _set(effort, "-1")
    return to_text(document)


def _sdf_bench_joint(model: minidom.Element, projection: Projection) -> None:
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
