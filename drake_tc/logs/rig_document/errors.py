"""From pydantic's report to one line: file, key, what was expected, what came, the nearest match."""

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from drake_tc.errors import RigError
from drake_tc.logs.rig_document.document import RigDocument
from drake_tc.logs.rig_document.keys import HIDDEN

HINT = "`drake-tc schema rig --page` explains every key"

_EXPECTED: Mapping[str, str] = {
    "dict_type": "a mapping",
    "model_type": "a mapping",
    "list_type": "a list",
    "string_type": "text",
    "float_type": "a number",
    "finite_number": "a finite number",
    "greater_than": "a number above {gt:g}",
    "missing": "a value",
}
"""What pydantic's types of error say was expected; other types keep pydantic's own sentence."""


def read_document(source: str, document: Mapping[str, Any]) -> RigDocument:
    """The checked document.

    Raises:
        RigError: The first thing that is wrong in it; one line.
    """
    try:
        return RigDocument.model_validate(document)
    except ValidationError as error:
        raise rig_error(source, error) from None


def rig_error(source: str, error: ValidationError) -> RigError:
    """The first error as one line: "file: key: expected ..., got ...; did you mean ...?"."""
    first: Mapping[str, Any] = error.errors(include_url=False)[0]
    location = [str(part) for part in first["loc"]]
    if location and location[-1] == "[key]":  # the message names the key itself
        location = location[:-2]
    where = [part for part in location if not part.startswith(HIDDEN)]
    return RigError(": ".join([source, *where, _text(first)]))


def _text(error: Mapping[str, Any]) -> str:
    context = error.get("ctx", {})
    if error["type"] == "value_error":
        text = str(context["error"])
        return f"{text} ({HINT})" if text.startswith("unknown key") or " is missing; " in text else text
    if error["type"] in _EXPECTED:
        return f"expected {_EXPECTED[error['type']].format(**context)}, got {error['input']!r}"
    return f"{error['msg']}, got {error['input']!r}"
