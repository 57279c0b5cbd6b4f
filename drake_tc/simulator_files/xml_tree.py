"""XML as simulators read it: by the names of tags as they are written, whether their prefixes are declared or not.

Drake's parsers of URDF and SDFormat files take `drake:rotor_inertia` for Drake's tag also where `xmlns:drake` is
missing or is another address, and no tag with another prefix, whatever that prefix stands for. Other undeclared
prefixes are no error either.
"""

import math
import xml.etree.ElementTree as ET
from xml.parsers import expat

DRAKE = "{http://drake.mit.edu}"
"""Begin of the names of Drake's tags, `drake:` in a file."""
PREFIX = "drake:"


class Element(ET.Element):
    """An element that knows the line of its file in which it begins."""

    line = 0


def xml_tree(text: str) -> ET.Element:
    """The root of a document. Names with another prefix than Drake's stay as they are written.

    Args:
        text: Of the file.

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


def place(element: ET.Element) -> str:
    """The element and its line, for people: `<joint name='knee'> in line 7`."""
    name, tag = element.get("name"), element.tag.replace(DRAKE, PREFIX)
    return f"<{tag}{f' name={name!r}' if name else ''}>{f' in line {line}' if (line := line_of(element)) else ''}"


def line_of(element: ET.Element) -> int:
    """Line of the file in which the element begins; 0 where it is not known."""
    return int(getattr(element, "line", 0))


def finite(element: ET.Element, what: str, text: str) -> list[float]:
    """The finite numbers in a text.

    Args:
        element: Where it stands.
        what: Name of the attribute or tag.
        text: Numbers between blanks; may be empty.

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
