"""JSON schema of the rig file, for editors that complete and check YAML."""

from collections.abc import Mapping
from typing import Any

from drake_tc.extensions import EFFECTS
from drake_tc.logs.effect_ids import EFFECT_IDS
from drake_tc.logs.rig_document.document import RigDocument

DIALECT = "https://json-schema.org/draft/2020-12/schema"
_OURS = ("unit", "absent", "expected", "title", "default")


def rig_schema() -> dict[str, Any]:
    """The schema of a rig file (draft 2020-12); each key's description has its unit and its default."""
    schema: dict[str, Any] = _explained(RigDocument.model_json_schema())
    _add_installed_effects(schema)
    joints = [{"required": [name]} for name in ("joint", "joints", "robot")]
    return {"$schema": DIALECT, "title": "drake_tc rig file", **schema, "anyOf": joints}


def _add_installed_effects(value: Any) -> None:
    """Let the schema know the effects of other packages that are installed here."""
    for each in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        _add_installed_effects(each)
    if isinstance(value, dict) and value.get("enum") == list(EFFECT_IDS):
        value["enum"] = [*EFFECT_IDS, *EFFECTS.names()]


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
