"""Values and names in messages and JSON: short, on one line, with the nearest match of a misspelt name.

Values in messages: short and on one line, whatever a file holds.

Nearest match of a misspelt name, for messages.

Plain data for JSON files: what the format has no number for is null.
"""

import difflib
import math
import reprlib
from collections.abc import Iterable, Mapping
from typing import Any


class _Short(reprlib.Repr):
    """With true, false and null as files write them."""

    def repr_NoneType(self, value: None, level: int) -> str:
        return "null"

    def repr_bool(self, value: bool, level: int) -> str:
        return str(value).lower()


_SHORT = _Short()
_SHORT.maxlevel, _SHORT.maxstring, _SHORT.maxother, _SHORT.maxlong = 3, 80, 80, 40
_LONGEST_NAME = 60


def quoted(value: object) -> str:
    """`repr` of a value, cut where it is long or deep; true, false and null as files write them."""
    try:
        return _SHORT.repr(value)
    except Exception:  # a value whose repr fails, such as a whole number of more digits than Python prints
        return f"<{type(value).__name__}>"


def located(path: Iterable[str | int]) -> str:
    """A place in a document: `pushes[0].force`; names that are long or not printable are quoted."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            plain = part.isprintable() and 0 < len(part) <= _LONGEST_NAME
            text += ("." if text else "") + (part if plain else quoted(part))
    return text


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """'; did you mean ...?' when something in `known` is spelt like `name`; empty otherwise."""
    match = difflib.get_close_matches(name, list(known), n=1, cutoff=0.6)
    return f"; did you mean {match[0]!r}?" if match else ""


def json_value(value: Any) -> Any:
    """The same with None for infinity and NaN, however deep; arrays, numbers of numpy and tuples become plain."""
    if hasattr(value, "tolist"):
        return json_value(value.tolist())
    if isinstance(value, Mapping):
        return {key: json_value(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [json_value(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
