"""Read a file of another simulator, whichever of them it is."""

import json
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from pathlib import Path
from xml.parsers.expat import ExpatError

from drake_tc.config.files import is_file
from drake_tc.errors import DrakeTcError
from drake_tc.simulator_files.bam import bam_servo
from drake_tc.simulator_files.mjcf import mjcf_joints
from drake_tc.simulator_files.terms import ReadJoint
from drake_tc.simulator_files.urdf import sdf_joints, urdf_joints
from drake_tc.simulator_files.xml_tree import xml_tree

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
        raise error(f"{path}: not XML: {problem}") from None
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
