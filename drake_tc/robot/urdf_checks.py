"""What a URDF must be before a plant is built of it: a tree of links with possible masses, limits and joint types."""

import math
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from drake_tc.config.quoted import quoted
from drake_tc.errors import ParamsError

MOVABLE = ("revolute", "continuous", "prismatic")
"""Types of one degree of freedom: those that can be driven, or locked at a position."""
KINDS = (*MOVABLE, "fixed")
_MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
_SLACK, _NOTHING = 1e-6, 1e-15
"""Of the largest moment of inertia, as files round; and an inertia that is none [kg m^2]."""

HEAVIEST = 1e9
"""Mass [kg] and moments of inertia [kg m^2] of links stay below it: products of larger ones may overflow."""


def numbers(where: str, text: str | None, count: int) -> tuple[float, ...]:
    """The finite numbers in an attribute.

    Raises:
        ParamsError: others, or not as many; `where` stands before the message.
    """
    try:
        values = tuple(float(part) for part in (text or "").split())
    except ValueError:
        values = ()
    if len(values) != count or not all(map(math.isfinite, values)):
        what = "a finite number" if count == 1 else f"{count} finite numbers"
        raise ParamsError(f"{where}: expected {what}, got {'none' if text is None else quoted(text)}")
    return values


def check_names(path: Path, root: ET.Element) -> None:
    """Refuse a link or joint that is there twice.

    Raises:
        ParamsError: one is.
    """
    for tag in ("link", "joint"):
        counts = Counter(element.get("name") for element in root.findall(tag))
        twice = next((name for name, count in counts.items() if name and count > 1), None)
        if twice is not None:
            raise ParamsError(f"{path}: {tag} {quoted(twice)} is there twice; expected different names")


def check_inertials(path: Path, root: ET.Element) -> None:
    """Refuse masses below zero and inertias that no body has.

    Raises:
        ParamsError: a link has one, or what stands there is no number.
    """
    for link in root.findall("link"):
        inertial = link.find("inertial")
        if inertial is None:
            continue
        where = f"{path}: link {quoted(link.get('name'))}"
        mass, inertia = inertial.find("mass"), inertial.find("inertia")
        if mass is not None:
            (value,) = numbers(f"{where} mass", mass.get("value"), 1)
            if not 0.0 <= value < HEAVIEST:
                raise ParamsError(f"{where} mass: expected a number from 0 to {HEAVIEST:g} [kg], got {value:g}")
        if inertia is not None:
            _check_inertia(where, inertia)
        origin = inertial.find("origin")
        for name in ("xyz", "rpy") if origin is not None else ():
            if origin is not None and origin.get(name) is not None:
                numbers(f"{where} inertial {name}", origin.get(name), 3)


def _check_inertia(where: str, element: ET.Element) -> None:
    """The moments of inertia are numbers, and none about any axis is negative."""
    given = {
        name: numbers(f"{where} {name}", element.get(name, "0" if name[1] != name[2] else None), 1)[0]
        for name in _MOMENTS
    }
    xx, yy, zz, xy, xz, yz = (given[name] for name in _MOMENTS)
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    scale = float(np.max(np.abs(matrix)))
    if scale >= HEAVIEST:
        raise ParamsError(f"{where} inertia: expected moments below {HEAVIEST:g} [kg m^2], got {scale:g}")
    if scale > _NOTHING and float(np.linalg.eigvalsh(matrix / scale)[0]) < -_SLACK:
        raise ParamsError(f"{where} inertia: expected moments of inertia >= 0 about every axis, got {quoted(given)}")


def check_kind(where: str, kind: str) -> None:
    """Refuse a type of joint that is neither fixed nor of one degree of freedom.

    Raises:
        ParamsError: it is.
    """
    if kind not in KINDS:
        raise ParamsError(f"{where}: type {quoted(kind)} cannot be simulated; expected one of {', '.join(KINDS)}")


def check_mimics(path: Path, leaders: Mapping[str, str], movable: Iterable[str]) -> None:
    """Refuse joints that follow what does not move, or each other.

    Args:
        path: The file.
        leaders: Joint to the joint that it follows.
        movable: Joints of one degree of freedom.

    Raises:
        ParamsError: one does.
    """
    known = set(movable)
    for joint in leaders:
        at, seen = joint, {joint}
        while at in leaders:
            at = leaders[at]
            if at not in known:
                raise ParamsError(f"{path}: joint {quoted(joint)} mimic: no joint {quoted(at)} that moves")
            if at in seen:
                raise ParamsError(f"{path}: joint {quoted(joint)} mimic: the joints follow each other in a loop")
            seen.add(at)


def check_tree(path: Path, links: Iterable[str], ends: Mapping[str, tuple[str, str]]) -> None:
    """Refuse links that do not hang together as one tree.

    Args:
        path: The file.
        links: Their names.
        ends: Joint to its parent and child.

    Raises:
        ParamsError: a joint names a link that is not there, a link hangs on two joints, links form a loop or nothing
            connects them.
    """
    known = set(links)
    above: dict[str, str] = {}
    for joint, (parent, child) in ends.items():
        for link in (parent, child):
            if link not in known:
                raise ParamsError(f"{path}: joint {quoted(joint)}: no link {quoted(link)}")
        if child in above:
            raise ParamsError(
                f"{path}: link {quoted(child)} hangs on two joints, {quoted(above[child])} and {quoted(joint)};"
                " expected a tree"
            )
        above[child] = joint
    for link in known:
        seen = {link}
        while link in above:
            link = ends[above[link]][0]
            if link in seen:
                raise ParamsError(f"{path}: joint {quoted(above[link])} closes a loop; expected a tree")
            seen.add(link)
    roots = [link for link in links if link not in above]
    if len(roots) > 1:
        raise ParamsError(
            f"{path}: no joint connects {quoted(roots[0])} and {quoted(roots[1])}; expected one tree of links"
        )
