"""URDF and SDFormat files, and the packages that they name.

Joints of a URDF file: `<dynamics>`, `<limit effort>`, and the actuator of their transmission.

The reflected inertia is rotor_inertia gear_ratio^2 of Drake's tags, else motorInertia mechanicalReduction^2, which
Drake does not use. `drake:controller_gains` are the gains of a position servo, which Drake clips as a whole to the
limit of the effort. A joint that follows another, and everything else that is physics, is listed as not used.

Joints of an SDFormat file: `<axis>` with `<dynamics>` and `<limit><effort>`, and Drake's tags of the joint.

The reflected inertia is drake:rotor_inertia drake:gear_ratio^2, both contents of their tags. `drake:controller_gains`
has its gains as attributes. The spring's torque is -spring_stiffness (q - spring_reference), as Drake applies it. All
joints of the file are read, those of nested models and of included files too; what else is physics is listed as not
used.
"""

import os
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

from drake_tc.config.files import is_file
from drake_tc.config.joint_units import JointType
from drake_tc.config.quoted import located
from drake_tc.errors import ParamsError
from drake_tc.simulator_files.terms import ReadJoint, Terms
from drake_tc.simulator_files.xml_tree import DRAKE, PREFIX, finite, included_tree, place

MOVING = ("revolute", "continuous", "prismatic")
COUPLING = ("gearbox", "screw")
"""Joints of SDFormat that couple two motions."""
SIMPLE = "SimpleTransmission"
"""End of the type of the transmissions of which Drake makes actuators."""
JOINT_USED = {"parent", "child", "origin", "axis", "dynamics", "limit", "mimic", "calibration"}
ACTUATOR_USED = {"hardwareInterface", "mechanicalReduction", "motorInertia"}
TRANSMISSION_USED = {"type", "joint", "actuator", "mechanicalReduction"}
DRAKE_USED = {f"{DRAKE}{name}" for name in ("rotor_inertia", "gear_ratio", "controller_gains")}
"""Of an actuator's tags."""
NO_COUPLING = {f"{DRAKE}{name}" for name in ("collision_filter_group", "joint")}
"""Drake's tags beside joints that change nothing of them."""
TOP_USED = {"link", "joint", "transmission", "gazebo", "ros2_control", "material", "sensor"} | NO_COUPLING
"""Tags of a URDF's root that are used, are no physics, or are listed at their joints."""
NO_PHYSICS = {"material", "selfCollide", "visual", "turnGravityOff"}
"""Of Gazebo's tags of a joint or link."""


def urdf_joints(root: ET.Element, *, robot: bool = False) -> dict[str, ReadJoint]:
    """What the file says of each moving joint, by name.

    Args:
        root: `<robot>`.
        robot: Whether limits of the motion and `<mimic>` are used, as in a robot; otherwise they are listed.

    Raises:
        ValueError: an attribute that is no number, or a joint that is there twice; names element and line.
    """
    moving = [joint for joint in root.findall("joint") if joint.get("type") in MOVING]
    found: dict[str, ReadJoint] = {}
    for joint in moving:
        if joint.get("name", "") in found:
            raise ValueError(f"{place(joint)}: joint {joint.get('name')!r} is there twice")
        found[joint.get("name", "")] = _joint(joint)
    for joint in () if robot else moving:
        name, mimic = joint.get("name", ""), joint.find("mimic")
        found[name] = found[name].also_unused(*_motion(joint))
        if mimic is not None:
            _follow(found, name, mimic)
    others = [each for each in root if each.tag not in TOP_USED and (each.tag.startswith(DRAKE) or ":" not in each.tag)]
    others += root.findall("gazebo/joint")
    coupling = [f"{place(each)} beside its joints" for each in others]
    found = {name: joint.also_unused(*coupling) for name, joint in found.items()}
    driven: set[str] = set()
    for transmission in root.findall("transmission"):
        simple = (transmission.findtext("type") or transmission.get("type") or SIMPLE).strip().endswith(SIMPLE)
        for joint in (each for each in transmission if each.tag.lower().endswith("joint")):  # also flexJoint, gap_joint
            name = joint.get("name", "")
            if name in found and (not simple or len(transmission.findall("actuator")) > 1):
                told = f"its transmission {place(transmission)}, which is no {SIMPLE}"
                found[name] = found[name].also_unused(told)
            elif name in driven:
                found[name] = found[name].also_unused(f"its further transmission {place(transmission)}")
            elif name in found:
                found[name] = _with_transmission(found[name], transmission, joint)
                driven.add(name)
    for name, told in _extensions(root):
        if name in found:
            found[name] = found[name].also_unused(told)
    return found


def with_drake(joint: ReadJoint, armature: float, p: float, d: float) -> ReadJoint:
    """The joint with what Drake's tags say of its actuator.

    Args:
        joint: Without them.
        armature: Reflected rotor inertia [kg m^2].
        p: Gain of a position servo [N m/rad]; 0: the file has none.
        d: Damping of the servo [N m s/rad].
    """
    joint = joint.with_terms(armature=armature)
    if p <= 0.0:
        return joint.also_unused("the gain d of controller_gains without p") if d else joint
    return replace(joint.with_terms(drive="position_servo", kp=p), driven=True, derivative_gain=d)


def attribute(element: ET.Element, tag: str, name: str, *, limit: bool = False) -> float:
    """The attribute of a child, 0 where there is none, or where a `limit` is infinite.

    Raises:
        ValueError: it is no number; names element and line.
    """
    child = element.find(tag)
    text = None if child is None else child.get(name)
    if child is None or not text or (limit and _is_infinite(text)):
        return 0.0
    return (finite(child, name, text) or [0.0])[0]


def _is_infinite(text: str) -> bool:
    return text.strip().lstrip("+-").lower() in ("inf", "infinity")


def _joint(joint: ET.Element) -> ReadJoint:
    effort = attribute(joint, "limit", "effort", limit=True)
    terms = Terms(
        drive="torque",
        kp=1.0,
        damping=attribute(joint, "dynamics", "damping"),
        frictionloss=attribute(joint, "dynamics", "friction"),
        torque_limit=effort if effort > 0.0 else None,
    )
    unused = [f"its {_word(each.tag)}" for each in joint if each.tag not in JOINT_USED]
    unused += [f"its further {place(each)}" for tag in ("dynamics", "limit") for each in joint.findall(tag)[1:]]
    for tag, used in (("dynamics", ("damping", "friction")), ("limit", ("effort", "lower", "upper", "velocity"))):
        for child in joint.findall(tag)[:1]:
            inside = (*(name for name in child.attrib if name not in used), *(each.tag for each in child))
            unused += [f"{_word(name)} of its {tag}" for name in inside]
    return ReadJoint(terms, unused=tuple(unused), joint_type=_type_of(joint))


def _type_of(joint: ET.Element) -> JointType:
    return "prismatic" if joint.get("type") == "prismatic" else "revolute"


def _motion(joint: ET.Element) -> list[str]:
    """Limits of the motion."""
    velocity, lower, upper = (attribute(joint, "limit", name, limit=True) for name in ("velocity", "lower", "upper"))
    found = ["its limit of the velocity"] if velocity else []
    if joint.get("type") != "continuous" and lower != upper:
        found.append("its limits of the position (lower, upper)")
    return found


def _follow(found: dict[str, ReadJoint], name: str, mimic: ET.Element) -> None:
    """A joint follows another, which then carries it: neither is used."""
    leader = mimic.get("joint", "")
    found[name] = found[name].also_unused(f"that it follows {leader!r} (mimic)")
    if leader in found:
        found[leader] = found[leader].also_unused(f"that {name!r} follows it (mimic)")


def _with_transmission(joint: ReadJoint, transmission: ET.Element, of_joint: ET.Element) -> ReadJoint:
    actuators = transmission.findall("actuator")
    if not actuators:
        return joint
    actuator = actuators[0]
    inertia, ratio = (attribute(actuator, f"{DRAKE}{name}", "value") for name in ("rotor_inertia", "gear_ratio"))
    armature = inertia * (ratio or 1.0) ** 2
    parts = (actuator, of_joint, transmission)
    reduction, *others = [value for part in parts if (value := content(part, "mechanicalReduction"))] or [1.0]
    motor = content(actuator, "motorInertia")
    armature = armature if inertia else motor * reduction**2
    gains = (attribute(actuator, f"{DRAKE}controller_gains", name) for name in ("p", "d"))
    used = (ACTUATOR_USED | DRAKE_USED, {"hardwareInterface", "mechanicalReduction"}, TRANSMISSION_USED)
    unused = [
        f"its {_word(each.tag)}"
        for part, known in zip(parts, used, strict=True)
        for each in part
        if each.tag not in known
    ]
    unused += [f"its further mechanicalReduction ({value:g})" for value in others if value != reduction]
    unused += [f"its mechanicalReduction ({reduction:g})"] if reduction != 1.0 and (inertia or not motor) else []
    unused += ["its motorInertia beside drake:rotor_inertia"] if inertia and motor else []
    return with_drake(joint, armature, *gains).also_unused(*unused)


def _extensions(root: ET.Element) -> Iterator[tuple[str, str]]:
    """(joint, what is not used) of Gazebo's and ros2_control's tags."""
    for gazebo in root.findall("gazebo"):
        yield from _plugins(gazebo)
        for each in gazebo:
            if each.tag not in NO_PHYSICS:
                yield gazebo.get("reference", ""), f"its <gazebo> tag {_word(each.tag)}"
    for control in root.findall("ros2_control"):
        for joint in control.findall("joint"):
            for each in (*joint.findall("param"), *joint.findall("command_interface/param")):
                yield joint.get("name", ""), f"its <ros2_control> parameter {each.get('name')}"
        for transmission in control.findall("transmission"):
            for joint in transmission.findall("joint"):
                yield joint.get("name", ""), f"its <ros2_control> transmission {place(transmission)}"


def _plugins(parent: ET.Element) -> Iterator[tuple[str, str]]:
    """(text, plugin) of the plugins and of every text in them, which may name a joint, such as that of a controller."""
    for plugin in parent.iter("plugin"):
        for text in dict.fromkeys((each.text or "").strip() or each.get("name", "") for each in plugin.iter()):
            yield text, f"its {place(plugin)}"


def content(element: ET.Element, path: str, *, limit: bool = False) -> float:
    """The number in the element at a path, 0 where there is none, or where a `limit` is infinite.

    Raises:
        ValueError: it is no number; names element and line.
    """
    child = element.find(path)
    text = "" if child is None else (child.text or "").strip()
    if child is None or (limit and _is_infinite(text)):
        return 0.0
    return (finite(child, _word(child.tag), text) or [0.0])[0]


def _word(tag: str) -> str:
    return tag.replace(DRAKE, PREFIX)


SDF_JOINT_USED = {"parent", "child", "pose", "axis", "sensor", f"{DRAKE}mimic"} | DRAKE_USED
AXIS_USED = {"xyz", "dynamics", "limit", "mimic"}
DYNAMICS_USED = {"damping", "friction", "spring_stiffness", "spring_reference"}
_NO = ("false", "0")
LINK_USUAL: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"gravity": ("true", "1"), "enable_wind": _NO, "kinematic": _NO, "velocity_decay": ()}
)
"""Tags of a link that act on the joints that carry it, unless they say this."""


def sdf_joints(root: ET.Element, path: Path, around: tuple[Path, ...] = ()) -> dict[str, ReadJoint]:
    """What the file says of each moving joint, by name; its includes are found from its path.

    Args:
        root: `<sdf>`.
        path: Of the file.
        around: Of the files that include it.

    Raises:
        ValueError: a content or an attribute that is no number, a joint that is there twice, or an include that cannot
            be followed where there are no other joints; names element and line.
    """
    found: dict[str, ReadJoint] = {}

    def add(name: str, joint: ReadJoint, where: ET.Element) -> None:
        if name in found:
            raise ValueError(f"{place(where)}: joint {name!r} is there twice; name the file of one model")
        found[name] = joint

    for joint in root.iter("joint"):
        if joint.get("type") in MOVING:
            add(joint.get("name", ""), _read(joint), joint)
    beside = [f"{place(each)} beside its joints" for each in root.iter("joint") if each.get("type") in COUPLING]
    for link in root.iter("link"):
        acting = (each for each in link if each.tag in LINK_USUAL)
        beside += [
            f"{each.tag} of {place(link)}" for each in acting if (each.text or "").strip() not in LINK_USUAL[each.tag]
        ]
    for model in root.iter("model"):
        drakes = (each for each in model if each.tag.startswith(DRAKE) and each.tag not in NO_COUPLING)
        beside += [f"{place(each)} beside its joints" for each in drakes]
    for name, told in _plugins(root):
        if name in found:
            found[name] = found[name].also_unused(told)
    for joint in root.iter("joint"):
        for mimic in (*joint.findall("axis/mimic"), *joint.findall(f"{DRAKE}mimic")):
            if joint.get("name", "") in found:
                _follow(found, joint.get("name", ""), mimic)
    found = {name: joint.also_unused(*beside) for name, joint in found.items()}
    unknown = []
    for include in root.iter("include"):
        uri = (include.findtext("uri") or "").strip()
        file = _model_file(uri, path.parent)
        if file is None:
            unknown.append(f"{place(include)}: {uri!r}: no such file or model")
        for name, read in {} if file is None else _included(include, file, (*around, path.resolve())).items():
            add(name, read, include)
    if unknown and not found:
        raise ValueError(f"{unknown[0]}; name the file of the model itself")
    return {name: joint.also_unused(*unknown) for name, joint in found.items()}


def _included(include: ET.Element, found: Path, inside: tuple[Path, ...]) -> dict[str, ReadJoint]:
    """Joints of an included SDFormat file or URDF.

    Raises:
        ValueError: it is none of these, includes itself, or is changed where it is included.
    """
    changed = next((each for each in include if each.tag.partition(":")[2] == "params"), None)
    if changed is not None:
        raise ValueError(f"{place(changed)}: an include whose model is changed is not read; write out the whole model")
    if found.resolve() in inside:
        raise ValueError(f"{place(include)}: {found} includes itself")
    root = included_tree(found, include)
    if root.tag not in ("sdf", "robot"):
        raise ValueError(f"{place(include)}: {found}: expected <sdf> or <robot>, got <{root.tag}>")
    try:
        return urdf_joints(root) if root.tag == "robot" else sdf_joints(root, found, inside)
    except ValueError as problem:
        raise ValueError(f"{found.name}: {problem}") from None


def _model_file(uri: str, folder: Path) -> Path | None:
    """The file that the URI of an include means: beside the file that includes it, or in a folder of models."""
    scheme, _, rest = uri.rpartition("://")
    if scheme in ("http", "https", "fuel") or not rest:
        return None
    if scheme in ("model", "package"):
        models = [os.environ.get(name, "") for name in ("GZ_SIM_RESOURCE_PATH", "GAZEBO_MODEL_PATH", "SDF_PATH")]
        folders = [folder, *folder.parents, *(Path(each) for each in os.pathsep.join(models).split(os.pathsep) if each)]
        name, _, inner = rest.partition("/")
        places = [each / rest for each in folders] + [each / inner for each in _package_folders(name)]
    else:
        places = [folder / rest]
    for place_of in places:
        candidates = [place_of, place_of / "model.sdf", *sorted(place_of.glob("*.sdf"))]
        for each in candidates:
            if each.is_file():
                return each
    return None


def _read(joint: ET.Element) -> ReadJoint:
    effort = content(joint, "axis/limit/effort", limit=True)
    stiffness = content(joint, "axis/dynamics/spring_stiffness")
    terms = Terms(
        drive="torque",
        kp=1.0,
        damping=content(joint, "axis/dynamics/damping"),
        frictionloss=content(joint, "axis/dynamics/friction"),
        stiffness=stiffness,
        preload=-stiffness * content(joint, "axis/dynamics/spring_reference"),
        torque_limit=effort if effort > 0.0 else None,
    )
    inertia, ratio = content(joint, f"{DRAKE}rotor_inertia"), content(joint, f"{DRAKE}gear_ratio") or 1.0
    gains = (attribute(joint, f"{DRAKE}controller_gains", name) for name in ("p", "d"))
    return with_drake(ReadJoint(terms, joint_type=_type_of(joint)), inertia * ratio**2, *gains).also_unused(
        *_unused(joint)
    )


def _unused(joint: ET.Element) -> list[str]:
    found = [f"its {_word(each.tag)}" for each in joint if each.tag not in SDF_JOINT_USED]
    for axis in joint.findall("axis"):
        found += [f"its {_word(each.tag)}" for each in axis if each.tag not in AXIS_USED]
        for dynamics in axis.findall("dynamics"):
            found += [f"its {each.tag}" for each in dynamics if each.tag not in DYNAMICS_USED]
        for limit in axis.findall("limit"):
            found += [f"its {each.tag} of the limit" for each in limit if each.tag in ("stiffness", "dissipation")]
    velocity, *ends = (content(joint, f"axis/limit/{name}", limit=True) for name in ("velocity", "lower", "upper"))
    if velocity:
        found.append("its limit of the velocity")
    if any(0.0 < abs(end) < 1e16 for end in ends):
        found.append("its limits of the position (lower, upper)")
    return found


_SCHEME = "package://"


def _package_folders(name: str) -> list[Path]:
    """Folders that could be the package `name`: those of Python environments first, then ROS_PACKAGE_PATH."""
    shares = [Path(entry) / "cmeel.prefix" / "share" / name for entry in sys.path if entry]
    roots = [Path(entry) for entry in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if entry]
    return shares + [root / name for root in roots] + [root for root in roots if root.name == name]


def resolve(reference: str, folder: Path) -> Path:
    """The file that `package://NAME/path`, or a path relative to the folder of the file that holds it, means.

    Raises:
        ParamsError: there is no such file or package; the message says where it was looked for, and what to install.
    """
    if not reference.startswith(_SCHEME):
        path = folder / reference
        if not is_file(path):
            where = "" if Path(reference).is_absolute() else f" in {folder}"
            raise ParamsError(f"{located((reference,))}: no such file{where}")
        return path
    name, _, rest = reference.removeprefix(_SCHEME).partition("/")
    if name in ("", ".", ".."):
        raise ParamsError(f"{located((reference,))}: expected package://NAME/path with the name of a package")
    folders = [candidate for candidate in _package_folders(name) if candidate.is_dir()]
    if not folders:
        raise ParamsError(
            f"{located((reference,))}: package {name!r} is neither installed nor in ROS_PACKAGE_PATH;"
            ' robots of example-robot-data: pip install "drake-tc[robots]"'
        )
    for candidate in folders:
        path = candidate / rest
        if ".." in Path(rest).parts or Path(rest).is_absolute():
            raise ParamsError(f"{located((reference,))}: expected a path that stays inside the package {name!r}")
        if rest and is_file(path):
            return path
    raise ParamsError(f"{located((reference,))}: package {name!r} in {folders[0]} has no file {rest!r}")
