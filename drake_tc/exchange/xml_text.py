"""XML files edited in place: comments, order and what is not touched stay, prefixes that are not declared too."""

from collections.abc import Sequence
from pathlib import Path
from xml.dom import expatbuilder, minidom
from xml.parsers.expat import ExpatError

from drake_tc.errors import ParamsError


def read_xml(path: Path, root: str) -> minidom.Document:
    """The document of a file.

    Args:
        path: Of the file.
        root: Name of its root; "": any.

    Raises:
        ParamsError: unreadable, no XML, or another root than `root`.
    """
    try:
        document = parsed(path.read_bytes())
    except OSError as error:
        raise ParamsError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (ExpatError, ValueError) as error:
        raise ParamsError(f"{path}: expected an XML file, got a text that is not XML: {error}") from None
    found = document.documentElement
    if found is None or (root and found.tagName != root):
        raise ParamsError(
            f"{path}: expected <{root}> at the top, got <{'nothing' if found is None else found.tagName}>"
        )
    return document


def parsed(content: bytes | str) -> minidom.Document:
    """The document of a text; names are those that are written, as in `drake_tc.simulator_files.xml_tree`."""
    return expatbuilder.parseString(content, namespaces=False)


def to_text(document: minidom.Document) -> str:
    """The file's text, with an XML declaration on a line of its own."""
    body = "".join(node.toxml() + "\n" for node in document.childNodes)
    return f'<?xml version="1.0"?>\n{body}'


def child(parent: minidom.Element, tag: str) -> minidom.Element:
    """The first child of a name, appended where there is none, indented as its neighbours are."""
    for node in parent.childNodes:
        if isinstance(node, minidom.Element) and node.tagName == tag:
            return node
    return append(parent, tag)


def append(parent: minidom.Element, tag: str) -> minidom.Element:
    """A new last child on a line of its own."""
    made = element(parent, tag)
    before, last = parent.previousSibling, parent.lastChild
    indent = before.data.rpartition("\n")[2] if isinstance(before, minidom.Text) and "\n" in before.data else ""
    if last is not None and isinstance(last, minidom.Text) and not last.data.strip():
        parent.removeChild(last)
    parent.appendChild(text(parent, f"\n{indent}  "))
    parent.appendChild(made)
    parent.appendChild(text(parent, f"\n{indent}"))
    return made


def top(document: minidom.Document) -> minidom.Element:
    """The document's root."""
    root = document.documentElement
    if root is None:
        raise ParamsError("expected an XML document with an element, got none")
    return root


def element(near: minidom.Element, tag: str) -> minidom.Element:
    """A new element for the document of another; it has no place yet."""
    return _document(near).createElement(tag)


def imported(near: minidom.Element, other: minidom.Element) -> minidom.Element:
    """A copy of another document's element for the document of an element; it has no place yet."""
    copied = _document(near).importNode(other, True)
    if not isinstance(copied, minidom.Element):
        raise ParamsError(f"<{other.tagName}> cannot be copied")
    return copied


def text(near: minidom.Element, content: str) -> minidom.Text:
    """A new text for the document of an element; it has no place yet."""
    return _document(near).createTextNode(content)


def _document(near: minidom.Element) -> minidom.Document:
    document = near.ownerDocument
    if document is None:
        raise ParamsError(f"<{near.tagName}> belongs to no XML document")
    return document


def put(element: minidom.Element, **attributes: float | str | None) -> None:
    """Set attributes; numbers with ten digits; None removes one."""
    for name, value in attributes.items():
        if value is None:
            if element.hasAttribute(name):
                element.removeAttribute(name)
        else:
            element.setAttribute(name, number(value) if isinstance(value, float | int) else value)


def number(value: float) -> str:
    """A number as text that reads back within 1e-10."""
    return f"{value:.10g}"


def named(document: minidom.Document, tag: str, inside: Sequence[str]) -> dict[str, minidom.Element]:
    """Elements of a tag by their attribute `name`.

    Args:
        document: Of the file.
        tag: Theirs.
        inside: Tags of their parents; elements in others, such as a coupling `<joint>`, have names of their own.
    """
    found = (each for each in document.getElementsByTagName(tag) if each.hasAttribute("name"))
    return {e.getAttribute("name"): e for e in found if e.parentNode is not None and e.parentNode.nodeName in inside}
