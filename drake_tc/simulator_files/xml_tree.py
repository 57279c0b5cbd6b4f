"""XML as simulators read it: by the names of tags as they are written, whether their prefixes are declared or not.

Drake's parsers of URDF and SDFormat files take `drake:rotor_inertia` for Drake's tag also where `xmlns:drake` is
missing or is another address, and no tag with another prefix, whatever that prefix stands for. Other undeclared
prefixes are no error either.
An MJCF file is one tree: what it includes is in its place, and elements have the attributes of their classes.
"""

import math
import os
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.parsers import expat
from xml.parsers.expat import ExpatError

DRAKE = "{http://drake.mit.edu}"
"""Begin of the names of Drake's tags, `drake:` in a file."""
PREFIX = "drake:"


class Element(ET.Element):
    """An element that knows the line of its file in which it begins."""

    line = 0


def xml_tree(text: str) -> ET.Element:
    """The root of a document. Names with another prefix than Drake's stay as they are written.

    Raises:
        ExpatError: it is no XML.
    """
    builder = ET.TreeBuilder(element_factory=Element)
    parser = expat.ParserCreate()
    parser.buffer_text = True

    def start(name: str, attributes: dict[str, str]) -> None:
        made = builder.start(_name(name), attributes)
        made.line = parser.CurrentLineNumber  # type: ignore[attr-defined]

    def end(name: str) -> None:
        builder.end(_name(name))

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.Parse(text, True)
    return builder.close()


def included_tree(path: Path, include: ET.Element) -> ET.Element:
    """The root of a file that an element includes.

    Raises:
        ValueError: it cannot be read, or is no XML; names the element.
    """
    try:
        return xml_tree(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, ExpatError) as problem:
        raise ValueError(
            f"{place(include)}: {path}: expected an XML file, got a text that is not XML: {problem}"
        ) from None


def place(element: ET.Element) -> str:
    """The element and its line, for people: `<joint name='knee'> in line 7`."""
    name, tag = element.get("name"), element.tag.replace(DRAKE, PREFIX)
    return f"<{tag}{f' name={name!r}' if name else ''}>{f' in line {line}' if (line := line_of(element)) else ''}"


def line_of(element: ET.Element) -> int:
    """Line of the file in which the element begins; 0 where it is not known."""
    return int(getattr(element, "line", 0))


def finite(element: ET.Element, what: str, text: str) -> list[float]:
    """The finite numbers in a text.

    Raises:
        ValueError: something else; names element, line and text.
    """
    try:
        found = [float(part) for part in text.split()]
    except ValueError:
        found = [math.nan]
    if not all(map(math.isfinite, found)):
        raise ValueError(f"{place(element)}: {what}: expected finite numbers, got {text.strip()!r}")
    return found


def _name(written: str) -> str:
    return DRAKE + written.removeprefix(PREFIX) if written.startswith(PREFIX) else written


Attributes = Mapping[str, str]


def included_path(file: str, folders: Sequence[Path]) -> Path | None:
    """The file that an `<include>` names, in the first folder that has it; None where none has."""
    return next((path for path in (folder / file for folder in folders) if path.is_file()), None)


def with_includes(root: ET.Element, path: Path) -> ET.Element:
    """The tree, changed, with every `<include>` replaced by the content of its file.

    Raises:
        ValueError: a file that is not there, is no XML or includes itself; names element and line.
    """

    def expand(element: ET.Element, folders: tuple[Path, ...], inside: tuple[Path, ...]) -> None:
        made: list[ET.Element] = []
        for each in element:
            if each.tag != "include":
                expand(each, folders, inside)
                made.append(each)
                continue
            name = each.get("file", "")
            found = included_path(name, folders)
            if found is None:
                raise ValueError(f"{place(each)}: file {name!r}: no such file in {folders[0]}")
            if found.resolve() in inside:
                raise ValueError(f"{place(each)}: file {name!r} includes itself")
            other = included_tree(found, each)
            expand(other, (*folders, found.parent), (*inside, found.resolve()))
            made += list(other)
        element[:] = made

    expand(root, (path.parent,), (path.resolve(),))
    return root


def in_degrees(root: ET.Element) -> bool:
    """Whether the angles of an MJCF file are in degrees: the last `<compiler>` that says so decides."""
    said = [each.get("angle") for each in root.findall("compiler") if each.get("angle")]
    return not said or said[-1] != "radian"


class Defaults:
    """The classes of defaults of a file."""

    def __init__(self, root: ET.Element) -> None:
        """Read them."""
        self._chain: dict[str, tuple[ET.Element, ...]] = {"": ()}
        tops: tuple[ET.Element, ...] = ()
        for top in root.findall("default"):
            tops = (*tops, top)
            self._chain[""] = self._chain[top.get("class", "main")] = tops
        for top in tops:
            self._read(top, tops)

    def _read(self, element: ET.Element, around: tuple[ET.Element, ...]) -> None:
        for nested in element.findall("default"):
            name = nested.get("class", "")
            self._chain[name] = (*self._chain.get(name, around), nested)
            self._read(nested, self._chain[name])

    def elements(self, element: ET.Element, around: str = "") -> Iterator[ET.Element]:
        """Elements of the classes that an element has, outermost first, in the order in which they count.

        Raises:
            ValueError: a class that the file does not have; names element and line.
        """
        name = element.get("class", around)
        if name not in (*self._chain, "main"):
            classes = ", ".join(filter(None, self._chain)) or "none"
            raise ValueError(f"{place(element)}: no default class {name!r}; classes here: {classes}")
        for level in self._chain.get(name, self._chain[""]):
            yield from (each for each in level if each.tag != "default")

    def attributes(self, element: ET.Element, around: str = "") -> Attributes:
        """Attributes of an element, those of its classes among them."""
        found: dict[str, str] = {}
        for each in (*self.elements(element, around), element):
            if each.tag == element.tag:
                found |= {name: _over(found.get(name, ""), name, text) for name, text in each.attrib.items()}
        return found


POLYNOMIALS = ("damping", "stiffness")
"""Attributes of which a shorter list leaves the further numbers of the class as they are."""


def _over(before: str, name: str, text: str) -> str:
    if name not in POLYNOMIALS:
        return text
    given = text.split()
    return " ".join((*given, *before.split()[len(given) :]))


def bodies(root: ET.Element) -> Iterator[tuple[ET.Element, list[tuple[ET.Element, str]]]]:
    """Each body with its own joints, and the class of defaults around each of these."""

    def own(parent: ET.Element, around: str) -> Iterator[tuple[ET.Element, str]]:
        inside = parent.get("childclass", around)
        for each in parent:
            if each.tag in ("joint", "freejoint"):
                yield each, inside
            elif each.tag == "frame":
                yield from own(each, inside)

    def walk(parent: ET.Element, around: str) -> Iterator[tuple[ET.Element, list[tuple[ET.Element, str]]]]:
        inside = parent.get("childclass", around)
        for each in parent:
            if each.tag == "body":
                yield each, list(own(each, inside))
                yield from walk(each, inside)
            elif each.tag in ("frame", "replicate"):
                yield from walk(each, inside)

    for world in root.findall("worldbody"):
        yield from walk(world, "")


Widths = tuple[int, int]
"""Numbers of a joint in q and in v."""
WIDTHS: Mapping[str, Widths] = {"hinge": (1, 1), "slide": (1, 1), "ball": (4, 3), "free": (7, 6)}


def states(root: ET.Element) -> dict[str, Widths]:
    """Joints of an MJCF file in the order of q and v, by name, or by a number for those without one."""
    defaults, found = Defaults(root), dict[str, Widths]()
    for joint, around in (each for _, own in bodies(root) for each in own):
        kind = "free" if joint.tag == "freejoint" else defaults.attributes(joint, around).get("type", "hinge")
        found[joint.get("name") or f"joint {len(found)}"] = WIDTHS[kind]
    return found


def mujoco_module() -> Any:
    """The module.

    Raises:
        ImportError: it is not installed.
        OSError: a library that it needs is missing.
    """
    os.environ.setdefault("MUJOCO_GL", "disable")  # nothing is drawn, so no display and no OpenGL are needed
    import mujoco  # type: ignore[import-untyped]

    return mujoco
