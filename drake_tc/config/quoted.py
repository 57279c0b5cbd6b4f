"""Values in messages: short and on one line, whatever a file holds."""

import reprlib
from collections.abc import Iterable


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
