"""YAML files read strictly: one document of mappings, lists, texts, numbers, true, false and null; nothing is guessed.

Numbers are those of YAML 1.2 (`1e-4` is one), dates are texts, keys are texts. A key that is given twice, a tag, a
merged mapping, and what is deeper, longer or larger than any file of this library are errors that name line and key.
"""

import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from drake_tc.config.quoted import located, quoted
from drake_tc.errors import DrakeTcError, ParamsError

DEEPEST = 50
"""Levels of mappings and lists."""
LARGEST = 2**24
"""Size of a file [bytes]."""
MOST_REPEATED = 10_000
"""Values that aliases may repeat, counted as if they were written out."""
MOST_DIGITS = 40
"""Digits of a whole number."""

_TOO_DEEP = f"expected at most {DEEPEST} levels of mappings and lists"
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_TEXT = "tag:yaml.org,2002:str"
_CONSTANTS: Mapping[str, bool | None] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE", "yes", "Yes", "YES", "on", "On", "ON"), True),
    **dict.fromkeys(("false", "False", "FALSE", "no", "No", "NO", "off", "Off", "OFF"), False),
}
_WHOLE = re.compile(r"[-+]?[0-9]+|0x[0-9a-fA-F]+|0o[0-7]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")

_Path = tuple[str | int, ...]


def read_yaml(path: Path, kind: str = "YAML file", error: type[DrakeTcError] = ParamsError) -> Any:
    """The document in a file.

    Args:
        path: The file.
        kind: What it is expected to be, for the message.
        error: What to raise.

    Raises:
        DrakeTcError: of the kind `error`; the file cannot be read, or is not what this module reads.
    """
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST + 1)
    except FileNotFoundError:
        raise error(f"{path}: no such {kind}") from None
    except (OSError, ValueError) as found:
        raise error(f"{path}: cannot be read: {getattr(found, 'strerror', None) or found}") from None
    if len(content) > LARGEST:
        raise error(f"{path}: expected a {kind} of at most {LARGEST >> 20} MiB")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as found:
        raise error(f"{path}: expected a {kind} in UTF-8; byte {found.start} is not, as in a binary file") from None
    return parse_yaml(text, str(path), error)


def parse_yaml(text: str, source: str, error: type[DrakeTcError] = ParamsError) -> Any:
    """The document in a text.

    Args:
        text: YAML.
        source: Where it comes from, for the message.
        error: What to raise.

    Raises:
        DrakeTcError: of the kind `error`; not what this module reads.
    """
    try:
        return _Document(text).value()
    except ParamsError as found:
        raise error(f"{source}: {found}") from None
    except yaml.YAMLError as found:
        mark = getattr(found, "problem_mark", None)
        problem = getattr(found, "problem", None) or " ".join(str(found).split())
        if mark is not None and "nesting depth" in problem:  # libYAML's own limit; it reads ahead of its events
            raise error(f"{source}: line {mark.line + 1}: {_TOO_DEEP}") from None
        where = f" at line {mark.line + 1}" if mark is not None else ""
        raise error(f"{source}: not valid YAML{where}: {problem}") from None
    except UnicodeError as found:
        raise error(f"{source}: not valid YAML: {found}") from None


def merged(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """`base` with `changes`, mapping by mapping."""
    result = dict(base)
    for key, value in changes.items():
        both = isinstance(value, Mapping) and isinstance(result.get(key), Mapping)
        result[key] = merged(result[key], value) if both else value
    return result


class _Document:
    """Values from the parser's events."""

    def __init__(self, text: str) -> None:
        self._events: Iterator[Any] = yaml.parse(text, Loader=_LOADER)
        self._anchors: dict[str, tuple[Any, int]] = {}
        self._count = 0
        self._repeated = 0

    def value(self) -> Any:
        next(self._events)  # the stream's start
        if isinstance(next(self._events), yaml.StreamEndEvent):
            return None
        value = self._value(next(self._events), ())
        next(self._events)  # the document's end
        event = next(self._events)
        if not isinstance(event, yaml.StreamEndEvent):
            raise _refused(event, (), "expected one document; a second one begins")
        return value

    def _value(self, event: Any, path: _Path) -> Any:
        if isinstance(event, yaml.AliasEvent):
            return self._alias(event, path)
        self._count += 1
        before = self._count
        if isinstance(event, yaml.ScalarEvent):
            value = _scalar(event, path)
        else:
            if len(path) >= DEEPEST:
                raise _refused(event, path[:3], _TOO_DEEP)
            if event.tag is not None:
                raise _tag(event, path)
            mapping = isinstance(event, yaml.MappingStartEvent)
            value = self._mapping(path) if mapping else self._list(path)
        if event.anchor is not None:
            self._anchors[event.anchor] = value, self._count - before + 1
        return value

    def _alias(self, event: Any, path: _Path) -> Any:
        if event.anchor not in self._anchors:
            raise _refused(event, path, f"the alias *{event.anchor} names nothing that is complete above it")
        value, size = self._anchors[event.anchor]
        self._count += size
        self._repeated += size
        if self._repeated > MOST_REPEATED:
            raise _refused(event, path, f"expected aliases that repeat at most {MOST_REPEATED} values")
        return value

    def _list(self, path: _Path) -> list[Any]:
        items: list[Any] = []
        while not isinstance(event := next(self._events), yaml.SequenceEndEvent):
            items.append(self._value(event, (*path, len(items))))
        return items

    def _mapping(self, path: _Path) -> dict[str, Any]:
        mapping: dict[str, Any] = {}
        while not isinstance(event := next(self._events), yaml.MappingEndEvent):
            if not isinstance(event, yaml.ScalarEvent):
                raise _refused(event, path, "expected a key that is one word or number, got a list, mapping or alias")
            if event.tag not in (None, "!", _TEXT):
                raise _tag(event, path)
            key = str(event.value)
            if key == "<<" and event.implicit[0]:
                raise _refused(event, path, "expected the keys themselves; '<<', which merges a mapping, is not read")
            if key in mapping:
                raise _refused(event, path, f"key {quoted(key)} is given twice")
            mapping[key] = self._value(next(self._events), (*path, key))
        return mapping


def _scalar(event: Any, path: _Path) -> Any:
    text = str(event.value)
    if event.tag not in (None, "!", _TEXT):
        raise _tag(event, path)
    if event.tag is not None or not event.implicit[0]:
        return text
    if text in _CONSTANTS:
        return _CONSTANTS[text]
    if _WHOLE.fullmatch(text):
        if len(text) > MOST_DIGITS:
            raise _refused(event, path, f"expected a number of at most {MOST_DIGITS} digits, got {len(text)}")
        return int(text, 16 if text[:2] == "0x" else 8 if text[:2] == "0o" else 10)
    if not _FLOAT.fullmatch(text):
        return text
    if text[-1] in "fFnN":  # .inf, .nan
        return float(text.replace(".", ""))
    value = float(text)
    if math.isinf(value):
        raise _refused(event, path, f"expected a number below 1.8e308, got {quoted(text)}")
    return value


def _tag(event: Any, path: _Path) -> ParamsError:
    tag = str(event.tag).replace("tag:yaml.org,2002:", "!!")
    return _refused(event, path, f"expected the value itself; the tag {quoted(tag)} is not read")


def _refused(event: Any, path: _Path, text: str) -> ParamsError:
    place = located(path)
    return ParamsError(f"line {event.start_mark.line + 1}: {place}{': ' if place else ''}{text}")
