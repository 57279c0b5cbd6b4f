"""JSON schemas of input files, for editors that complete and check YAML."""

from collections.abc import Mapping
from typing import Any

from drake_tc.config.keys import Keys

DIALECT = "https://json-schema.org/draft/2020-12/schema"
_OURS = ("unit", "absent", "expected", "title", "default")


def json_schema(model: type[Keys], title: str) -> dict[str, Any]:
    """The schema of a file (draft 2020-12); each key's description has its unit and its default."""
    schema: dict[str, Any] = _explained(model.model_json_schema())
    return {"$schema": DIALECT, "title": title, **schema}


def _explained(value: Any) -> Any:
    """The schema with unit and default in the descriptions, and without what only this library reads."""
    if isinstance(value, list):
        return [_explained(each) for each in value]
    if not isinstance(value, Mapping):
        return value
    if "absent" not in value:
        kept = {name: each for name, each in value.items() if name != "title" or not isinstance(each, str)}
        return {"anyOf" if name == "oneOf" else name: _explained(each) for name, each in kept.items()}
    default = value["absent"] or ("" if value.get("default") is None else f"{value['default']:g}")
    told = (("Unit", value["unit"]), ("Default", default))
    description = " ".join([value["description"], *(f"{name}: {text}." for name, text in told if text)])
    rest = {name: _explained(each) for name, each in value.items() if name not in _OURS}
    return {**rest, "description": description}
