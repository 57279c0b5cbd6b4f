"""XML as simulators read it: by the names of tags as they are written, whether their prefixes are declared or not.

Drake's parsers of URDF and SDFormat files take `drake:rotor_inertia` for Drake's tag also where `xmlns:drake` is
missing or is another address, and no tag with another prefix, whatever that prefix stands for. Other undeclared
prefixes are no error either.
"""

import xml.etree.ElementTree as ET
from xml.parsers import expat

DRAKE = "{http://drake.mit.edu}"
"""Begin of the names of Drake's tags, `drake:` in a file."""
PREFIX = "drake:"


def xml_tree(text: str) -> ET.Element:
    """The root of a document. Names with another prefix than Drake's stay as they are written.

    Args:
        text: Of the file.

    Raises:
        ExpatError: it is no XML.
    """
    builder = ET.TreeBuilder()
    parser = expat.ParserCreate()
    parser.buffer_text = True

    def start(name: str, attributes: dict[str, str]) -> None:
        builder.start(_name(name), attributes)

    def end(name: str) -> None:
        builder.end(_name(name))

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.Parse(text, True)
    return builder.close()


def _name(written: str) -> str:
    return DRAKE + written.removeprefix(PREFIX) if written.startswith(PREFIX) else written
