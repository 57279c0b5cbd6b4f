"""From pydantic's report to one line: file, key, what was expected, what came, the nearest match."""

import re
from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import ValidationError

from drake_tc.config.keys import HIDDEN, Keys
from drake_tc.config.quoted import located, quoted
from drake_tc.errors import DrakeTcError, ParamsError

_EXPECTED: Mapping[str, str] = {
    "dict_type": "a mapping",
    "model_type": "a mapping",
    "list_type": "a list",
    "string_type": "text",
    "float_type": "a number",
    "int_type": "a whole number",
    "bool_type": "true or false",
    "finite_number": "a finite number",
    "greater_than": "a number above {gt:g}",
    "literal_error": "{expected}",
    "missing": "a value",
    "too_short": "at least {min_length} entry",
}
"""What pydantic's types of error say was expected; other types keep pydantic's own sentence."""
_BEGINS_WITH_KEY = re.compile(r"\w+(\.\w+|\[\d+\])*: (expected|it belongs|unknown) ")
"""A text that continues the place."""

Document = TypeVar("Document", bound=Keys)


def validated(
    model: type[Document],
    document: object,
    source: str = "",
    error: type[DrakeTcError] = ParamsError,
    hint: str = "",
    within: str = "",
) -> Document:
    """The checked document.

    Args:
        model: What the document may say.
        document: Plain data.
        source: Where it comes from, for the message.
        error: What to raise.
        hint: Where the keys are explained; added where a key is unknown or missing.
        within: Place of the document in its file.

    Raises:
        DrakeTcError: of the kind `error`; the first thing that is wrong in the document, in one line.
    """
    try:
        return model.model_validate(document)
    except ValidationError as found:
        first: Any = found.errors(include_url=False)[0]
        text = _text(first)
        if hint and (text.startswith("unknown key") or " is missing; " in text):
            text = f"{text} ({hint})"
        place = _place((within, *first["loc"]) if within else first["loc"])
        raise error(message(source, place, text)) from None


def message(source: str, place: str, text: str) -> str:
    """The line of an error; a text that begins with a key continues the place."""
    if place and _BEGINS_WITH_KEY.match(text):
        place, text = f"{place}.{text}", ""
    return ": ".join(part for part in (source, place, text) if part)


def _place(location: tuple[str | int, ...]) -> str:
    parts = list(location)
    if parts and parts[-1] == "[key]":  # the message names the key itself
        parts = parts[:-2]
    return located(part for part in parts if not (isinstance(part, str) and part.startswith(HIDDEN)))


def _text(error: Mapping[str, Any]) -> str:
    context = error.get("ctx", {})
    if error["type"] == "value_error":
        return str(context["error"])
    if error["type"] in _EXPECTED:
        return f"expected {_EXPECTED[error['type']].format(**context)}, got {quoted(error['input'])}"
    return f"{error['msg']}, got {quoted(error['input'])}"
