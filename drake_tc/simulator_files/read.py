"""Read a file of another simulator, whichever of them it is.

A parameter file of BAM (JSON) is one servo on a voltage, friction models m1 to m6.

    kt/R V - kt^2/R v - friction_viscous v - frictionloss sign(v) - tau = armature vdot
    frictionloss = friction_base + friction_stribeck exp(-|v / dtheta_stribeck|^alpha) + what depends on the load

Source: Duclusaud, Passault, Padois and Ly, "Extended Friction Models for the Physics Simulation of Servo Actuators"
(2025). The load-dependent terms are those of motor and external torque. Where only that of the external torque away
from rest is not 0 it is this library's effect; other forms are declared without a value.
"""

import json
import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from pathlib import Path
from xml.parsers.expat import ExpatError

from drake_tc.config.files import is_file
from drake_tc.errors import DrakeTcError
from drake_tc.simulator_files.mjcf import mjcf_joints
from drake_tc.simulator_files.terms import ReadJoint, StribeckPeak, Terms
from drake_tc.simulator_files.urdf import sdf_joints, urdf_joints
from drake_tc.simulator_files.xml_tree import xml_tree

TAKEN = {"model", "actuator", "kt", "R", "armature", "friction_base", "friction_viscous", "command_delay"}
PEAK = ("friction_stribeck", "dtheta_stribeck", "alpha")
"""Height, speed and exponent of a Stribeck peak."""
MODELS = ("m1", "m2", "m3", "m4", "m5", "m6")
STRIBECK, LOADED = ("m2", "m4", "m5", "m6"), ("m3", "m4", "m5", "m6")
"""Models whose friction has a Stribeck peak, and those whose friction depends on the load."""
NO_LOAD_FRICTION = (
    "load_friction_motor", "load_friction_motor_stribeck", "load_friction_external_stribeck",
    "load_friction_motor_quad", "load_friction_external_quad",
)  # fmt: skip
"""Load-dependent terms that are 0 where friction is a share of the external torque alone."""
EXPONENTS = (0.5, 2.0)
"""Of Stribeck peaks that this library's effect can have; of another peak only the kind is declared."""


def bam_servo(document: Mapping[str, object]) -> ReadJoint:
    """What the file says of its servo.

    Raises:
        ValueError: a parameter that is missing or no number of 0 or more, or a model that BAM does not have.
    """
    kt, resistance = _number(document, "kt"), _number(document, "R")
    if kt <= 0.0 or resistance <= 0.0:
        raise ValueError(f"kt, R: expected positive numbers, got {kt:g} and {resistance:g}")
    effects: dict[str, Mapping[str, float] | None] = {}
    model, taken = document.get("model"), TAKEN
    if model not in MODELS:
        raise ValueError(f"model: expected one of {', '.join(MODELS)}, got {model!r}")
    peak = None
    if model in STRIBECK:
        taken = taken | set(PEAK)
        peak = StribeckPeak(*(_number(document, name) for name in PEAK))
        if not peak.velocity or not peak.exponent:
            got = f"{peak.velocity:g} and {peak.exponent:g}"
            raise ValueError(f"dtheta_stribeck, alpha: expected positive numbers, got {got}")
        effects["stribeck"] = _own_effect(peak)
    if model in LOADED:
        effects["load_dependent_friction"] = _load_friction(document)
        taken = taken | {name for name in document if name.startswith("load_friction")}
    unused = tuple(sorted(name for name in document if name not in taken))
    terms = Terms(
        drive="voltage",
        kp=kt / resistance,
        armature=_number(document, "armature"),
        damping=_number(document, "friction_viscous") + kt**2 / resistance,
        frictionloss=_number(document, "friction_base"),
        stribeck=peak,
        torque_constant=kt,
        delay=_number(document, "command_delay") if "command_delay" in document else 0.0,
    )
    return ReadJoint(terms, driven=True, effects=effects, unused=unused)


def _own_effect(peak: StribeckPeak) -> Mapping[str, float] | None:
    if not EXPONENTS[0] <= peak.exponent <= EXPONENTS[1]:
        return None
    return {"stribeck": peak.height, "stribeck_velocity": peak.velocity, "stribeck_exponent": peak.exponent}


def _load_friction(document: Mapping[str, object]) -> Mapping[str, float] | None:
    if "load_friction_external" not in document or any(document.get(name, 0.0) != 0.0 for name in NO_LOAD_FRICTION):
        return None
    return {"load_friction": _number(document, "load_friction_external")}


def _number(document: Mapping[str, object], name: str) -> float:
    value = document.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value < math.inf:
        raise ValueError(f"{name}: expected a number of 0 or more, got {value!r}")
    return float(value)


ENDINGS = (".urdf", ".sdf", ".xml", ".mjcf", ".json", ".xacro")
"""Endings of the files that can be read; what is in an XML file decides whether it is a URDF, SDFormat or MJCF.

A .xacro file is read if it holds nothing that has to be expanded.
"""
XACRO = re.compile(r"http://(www\.)?ros\.org/wiki/xacro")
"""What the prefix stands for of XML elements that only the program `xacro` understands."""
KINDS = "a URDF (<robot>), an SDFormat file (<sdf>) or an MJCF (<mujoco>)"
ANY_JOINT = "*"
"""Key of a file that is of one servo, whatever its joint is called."""


def read_joints(path: Path, error: type[DrakeTcError]) -> dict[str, ReadJoint]:
    """What the file says of each joint, by name; of one servo under `ANY_JOINT`.

    Args:
        path: URDF, SDFormat, MJCF or a parameter file of BAM.
        error: Class of what is raised.

    Raises:
        DrakeTcError: of class `error`: a file that cannot be read or used; names file and reason.
    """
    if not is_file(path):
        raise error(f"{path}: no such file; expected a URDF, an SDFormat file, an MJCF or a parameter file of BAM")
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as problem:
        raise error(f"{path}: cannot be read: {getattr(problem, 'strerror', None) or problem}") from None
    return joints_of_text(text, path, error)


def joints_of_text(text: str, path: Path, error: type[DrakeTcError]) -> dict[str, ReadJoint]:
    """The same of a text.

    Args:
        text: Of a file.
        path: Where the file is or will be: its ending, and the folder of what it includes.
        error: Class of what is raised.

    Raises:
        DrakeTcError: of class `error`: a text that cannot be used; names file and reason.
    """
    try:
        if path.suffix.lower() == ".json":
            return {ANY_JOINT: bam_servo(_mapping(json.loads(text)))}
        return _of_xml(xml_tree(text), path)
    except ExpatError as problem:
        raise error(
            f"{path}: expected URDF, SDF or MJCF, or a BAM file *.json, got a text that is not XML: {problem}"
        ) from None
    except ValueError as problem:
        raise error(f"{path}: {problem}") from None


def _of_xml(root: ET.Element, path: Path) -> dict[str, ReadJoint]:
    readers: dict[str, Callable[[ET.Element], dict[str, ReadJoint]]] = {
        "robot": urdf_joints,
        "sdf": lambda tree: sdf_joints(tree, path),
        "mujoco": lambda tree: mjcf_joints(tree, path),
    }
    if _has_xacro(root):
        raise ValueError(
            f"expected {KINDS}, got a xacro file that is not expanded; `xacro FILE.xacro > FILE.urdf` expands it"
        )
    if root.tag not in readers:
        raise ValueError(f"expected {KINDS}, got <{root.tag}>")
    found = readers[root.tag](root)
    if not found:
        kinds = sorted({each.get("type", "hinge") for each in root.iter("joint")} - {"fixed", "hinge"})
        others = f"; joints of the types {', '.join(kinds)} are not read" if kinds else ""
        raise ValueError(f"it has no joint that moves with one degree of freedom and has a name{others}")
    return found


def _has_xacro(root: ET.Element) -> bool:
    """Whether elements have the prefix `xacro`, or one that is declared as xacro's."""
    declared = [pair for element in root.iter() for pair in element.attrib.items()]
    prefixes = {"xacro", *(name.removeprefix("xmlns:") for name, uri in declared if XACRO.fullmatch(uri))}
    return any(element.tag.partition(":")[0] in prefixes for element in root.iter() if ":" in element.tag)


def _mapping(document: object) -> Mapping[str, object]:
    if not isinstance(document, dict):
        raise ValueError(f"expected a parameter file of BAM, a mapping, got {type(document).__name__}")
    return document
