"""Files of scenarios: many by name, one extending another, with changes laid over."""

from pathlib import Path
from typing import Any

import yaml

from drake_tc.errors import ParamsError
from drake_tc.loops.scenarios.strict_yaml import read_mapping
from drake_tc.yaml_file import merged


def scenario_names(path: Path) -> list[str]:
    """The scenarios of a file, in its order.

    Raises:
        ParamsError: the file cannot be read.
    """
    return list(read_mapping(path))


def read_scenario(path: Path, name: str, text: str | None = None) -> dict[str, Any]:
    """The fields of the scenario `name` of a file, with the fields in `text` (YAML) changed.

    Args:
        path: Scenario file.
        name: Scenario.
        text: YAML mapping of fields to change, like `{duration: 3.0, gains: {k6: 0.25}}`.

    Raises:
        ParamsError: no such file or scenario, or text that is no mapping.
    """
    document = _extended(path, read_mapping(path), name, ())
    return document if text is None else merged(document, changes_in(text))


def changes_in(text: str) -> dict[str, Any]:
    """The fields in a YAML text.

    Raises:
        ParamsError: text that is no mapping.
    """
    try:
        changes = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ParamsError(f"scenario text: not valid YAML: {' '.join(str(error).split())}") from None
    if not isinstance(changes, dict):
        raise ParamsError(f"scenario text: wanted a mapping of fields; got {text!r}")
    return changes


def _extended(path: Path, document: dict[str, Any], name: str, seen: tuple[str, ...]) -> dict[str, Any]:
    if name not in document:
        raise ParamsError(f"{path}: no scenario {name!r}; scenarios here: {', '.join(document)}")
    if name in seen:
        raise ParamsError(f"{path}: {name}: extends itself ({' -> '.join((*seen, name))})")
    if not isinstance(document[name] or {}, dict):
        raise ParamsError(f"{path}: {name}: wanted a mapping of fields; got {document[name]!r}")
    own = dict(document[name] or {})
    parent = own.pop("extends", None)
    return own if parent is None else merged(_extended(path, document, parent, (*seen, name)), own)
