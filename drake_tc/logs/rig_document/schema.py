"""The rig file as a whole: read it, and its JSON schema."""

from typing import Any

from drake_tc.config.schema import json_schema
from drake_tc.config.validation import validated
from drake_tc.errors import RigError
from drake_tc.extensions import EFFECTS
from drake_tc.logs.effect_ids import EFFECT_IDS
from drake_tc.logs.rig_document.document import RigDocument

HINT = "`drake-tc schema rig --page` explains every key"


def read_document(source: str, document: object) -> RigDocument:
    """The checked document.

    Raises:
        RigError: The first thing that is wrong in it; one line.
    """
    return validated(RigDocument, document, source, RigError, HINT)


def rig_schema() -> dict[str, Any]:
    """The schema of a rig file; it has `joint`, `joints` or `robot`."""
    schema = json_schema(RigDocument, "drake_tc rig file")
    _add_installed_effects(schema)
    joints = [{"required": [name]} for name in ("joint", "joints", "robot")]
    return {**schema, "anyOf": joints}


def _add_installed_effects(value: Any) -> None:
    """Let the schema know the effects of other packages that are installed here."""
    for each in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        _add_installed_effects(each)
    if isinstance(value, dict) and value.get("enum") == list(EFFECT_IDS):
        value["enum"] = [*EFFECT_IDS, *EFFECTS.names()]
