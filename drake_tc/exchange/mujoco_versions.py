"""Which version of MuJoCo a written MJCF file needs for the terms of its joints.

    delay of an actuator                                               MuJoCo 3.5
    damping of more than one number (a polynomial of the speed)        MuJoCo 3.7
    <dcmotor>                                                          MuJoCo 3.7
    <dcmotor> without input, <pid>                                     MuJoCo 3.12

Each version loads a file with the term and gives the force that it means; the version before refuses the file.
"""

import re
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from xml.dom import minidom

from drake_tc.exchange.projection import Projection
from drake_tc.exchange.xml_text import parsed
from drake_tc.simulator_files.mjcf import ACTUATORS, PLAY

Version = tuple[int, ...]
DELAY = "the delay of an actuator"
POLYNOMIAL = "damping as a polynomial of the speed"
DCMOTOR = "the actuator dcmotor"
PASSIVE = "friction as a dcmotor without input"
PID = "the actuator pid"
SINCE: dict[str, Version] = {PASSIVE: (3, 12), PID: (3, 12), POLYNOMIAL: (3, 7), DCMOTOR: (3, 7), DELAY: (3, 5)}
"""Term of an MJCF file to the first version that has it, newest first."""


def installed_mujoco() -> str | None:
    """Version of MuJoCo in this Python; None where it is not installed."""
    try:
        return version("mujoco")
    except PackageNotFoundError:
        return None


def version_sentence(text: str, joints: Sequence[str], *, installed: str | None) -> str:
    """The version that the terms of these joints need, and whether it is installed; "" where any version has them.

    Args:
        text: Of an MJCF file.
        joints: Names of those that were written.
        installed: Version of MuJoCo; None: none is installed.
    """
    needs = _needs(text, joints)
    if not needs:
        return ""
    by_version: dict[Version, list[str]] = {}
    for term, names in needs.items():
        by_version.setdefault(SINCE[term], []).append(f"{term} ({', '.join(names)})")
    needed = "; ".join(f"{_dotted(since)} or newer for {' and '.join(terms)}" for since, terms in by_version.items())
    told = f"; MuJoCo {installed} is installed, which refuses it" if too_old(text, joints, installed=installed) else ""
    return f"The file needs MuJoCo {needed}{told}."


def too_old(text: str, joints: Sequence[str], *, installed: str | None) -> str:
    """Why the installed version cannot load the file, as a clause; "" where it can.

    Args:
        text: Of an MJCF file.
        joints: Names of those that were written.
        installed: Version of MuJoCo; None: none is installed.
    """
    if installed is None:
        return ""
    newer = [term for term in _needs(text, joints) if _numbers(installed) < SINCE[term]]
    if not newer:
        return ""
    needed = _dotted(max(SINCE[term] for term in newer))
    return f"MuJoCo {installed} is installed, but {needed} or newer is needed for {' and '.join(newer)}"


def file_notes(text: str, projections: Sequence[Projection]) -> list[str]:
    """Sentences on the version of MuJoCo that a file needs, and on a dcmotor that the file cannot have.

    Args:
        text: Of an MJCF file.
        projections: What was written into it.
    """
    needed = version_sentence(text, [each.joint for each in projections], installed=installed_mujoco())
    return [*([needed] if needed else []), *plain_motors(text, projections)]


def plain_motors(text: str, projections: Sequence[Projection]) -> list[str]:
    """Sentences on drives that could be a dcmotor but for the limit of force that the user's file has.

    Args:
        text: Of an MJCF file.
        projections: What was written into it.
    """
    drives = [each for each in _elements(text, ACTUATORS) if each.getAttribute("input") != "none"]
    kinds = {each.getAttribute("joint"): each.tagName for each in drives}
    return [
        f"{each.joint}: the file limits the force of the actuator, which MuJoCo's dcmotor cannot: a motor was written,"
        " and the back-EMF stays a part of the damping."
        for each in projections
        if each.terms.drive == "voltage" and each.terms.torque_constant and kinds.get(each.joint) != "dcmotor"
    ]


def _needs(text: str, joints: Sequence[str]) -> dict[str, list[str]]:
    """Term to the joints that have it, in the order of `SINCE`."""
    found: dict[str, list[str]] = {term: [] for term in SINCE}
    for element in _elements(text, ("joint",)):
        name = element.getAttribute("name").removesuffix(PLAY)
        if name in joints and len(element.getAttribute("damping").split()) > 1 and name not in found[POLYNOMIAL]:
            found[POLYNOMIAL].append(name)
    for element in _elements(text, ACTUATORS):
        name = element.getAttribute("joint")
        passive = element.getAttribute("input") == "none"
        if name in joints and element.tagName == "dcmotor":
            found[PASSIVE if passive else DCMOTOR].append(name)
        if name in joints and element.tagName == "pid":
            found[PID].append(name)
        if name in joints and element.hasAttribute("delay"):
            found[DELAY].append(name)
    return {term: names for term, names in found.items() if names}


def _elements(text: str, tags: Sequence[str]) -> list[minidom.Element]:
    document = parsed(text)
    return [element for tag in tags for element in document.getElementsByTagName(tag)]


def _numbers(dotted: str) -> Version:
    """(3, 17) of "3.17.0"."""
    return tuple(int(part) for part in re.findall(r"\d+", dotted)[:2])


def _dotted(numbers: Version) -> str:
    return ".".join(map(str, numbers))
