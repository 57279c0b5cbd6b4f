"""An MJCF file as one tree: what it includes is in its place, and elements have the attributes of their classes.

MuJoCo, where it is installed.
"""

import os
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.parsers.expat import ExpatError

from drake_tc.simulator_files.xml_tree import place, xml_tree

Attributes = Mapping[str, str]


def included_path(file: str, folders: Sequence[Path]) -> Path | None:
    """The file that an `<include>` names, in the first folder that has it; None where none has.

    Args:
        file: Its attribute `file`.
        folders: That of the file that is loaded, and those of the files that include each other.
    """
    return next((path for path in (folder / file for folder in folders) if path.is_file()), None)


def with_includes(root: ET.Element, path: Path) -> ET.Element:
    """The tree with every `<include>` replaced by the content of its file.

    Args:
        root: `<mujoco>`; it is changed.
        path: Of its file.

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
            try:
                other = xml_tree(found.read_text(encoding="utf-8"))
            except (OSError, UnicodeDecodeError, ExpatError) as problem:
                raise ValueError(f"{place(each)}: {found}: not XML: {problem}") from None
            expand(other, (*folders, found.parent), (*inside, found.resolve()))
            made += list(other)
        element[:] = made

    expand(root, (path.parent,), (path.resolve(),))
    return root


class Defaults:
    """The classes of defaults of a file."""

    def __init__(self, root: ET.Element) -> None:
        """Read them.

        Args:
            root: `<mujoco>` with its includes.
        """
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

        Args:
            element: Of the model.
            around: Class of the bodies around it.
        """
        name = element.get("class", around)
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
            if each.tag == "joint":
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


def mujoco_module() -> Any:
    """The module.

    Raises:
        ImportError: it is not installed.
        OSError: a library that it needs is missing.
    """
    os.environ.setdefault("MUJOCO_GL", "disable")  # nothing is drawn, so no display and no OpenGL are needed
    import mujoco  # type: ignore[import-untyped]

    return mujoco
