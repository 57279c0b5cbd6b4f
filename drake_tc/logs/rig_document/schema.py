"""JSON schema of the rig file, for editors that complete and check YAML."""

from collections.abc import Mapping
from typing import Any

from drake_tc.logs.rig_document.document import RigDocument

DIALECT = "https://json-schema.org/draft/2020-12/schema"
_OURS = ("unit", "absent", "expected", "title", "default")


def rig_schema() -> dict[str, Any]:
    """The schema of a rig file (draft 2020-12); each key's description has its unit and its default."""
    schema: dict[str, Any] = _explained(RigDocument.model_json_schema())
    joints = [{"required": [name]} for name in ("joint", "joints", "robot")]
    return {"$schema": DIALECT, "title": "drake_tc rig file", **schema, "anyOf": joints}


def default_text(field: Mapping[str, Any]) -> str:
    """What holds when a key is absent, from its entry in pydantic's schema; empty for a required key."""
    if field.get("absent"):
        return str(field["absent"])
    return "" if field.get("default") is None else f"{field['default']:g}"


def _explained(value: Any) -> Any:
    """The schema with unit and default in the descriptions, and without what only this library reads."""
    if isinstance(value, list):
        return [_explained(each) for each in value if each != {"type": "null"}]
    if not isinstance(value, Mapping):
        return value
    if "absent" not in value:
        return {name: _explained(each) for name, each in value.items() if name != "title" or not isinstance(each, str)}
    unit, default = value["unit"], default_text(value)
    description = value["description"] + (f" Unit: {unit}." if unit else "") + (f" Default: {default}." if default else "")
    rest = {name: _explained(each) for name, each in value.items() if name not in _OURS}
    return {**rest, "description": description}
