"""Files of scenarios: many by name, one extending another, with changes laid over."""

from pathlib import Path
from typing import Any

from drake_tc.config.quoted import did_you_mean, quoted
from drake_tc.config.yaml_file import merged, parse_yaml, read_yaml
from drake_tc.errors import ParamsError


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
    changes = parse_yaml(text, "scenario text")
    if not isinstance(changes, dict):
        raise ParamsError(f"scenario text: expected a mapping of fields, got {quoted(text)}")
    return changes


def read_mapping(path: Path) -> dict[str, Any]:
    """A YAML file's top-level mapping.

    Raises:
        ParamsError: no such file, not YAML, or no mapping.
    """
    document = read_yaml(path)
    if not isinstance(document, dict):
        raise ParamsError(f"{path}: expected a mapping, got {quoted(document)}")
    return document


def _extended(path: Path, document: dict[str, Any], name: str, seen: tuple[str, ...]) -> dict[str, Any]:
    if name not in document:
        hint = did_you_mean(str(name), document)
        raise ParamsError(f"{path}: no scenario {quoted(name)}{hint}; scenarios here: {', '.join(document)}")
    if name in seen:
        raise ParamsError(f"{path}: {name}: extends itself ({' -> '.join((*seen, name))})")
    if not isinstance(document[name] or {}, dict):
        raise ParamsError(f"{path}: {name}: expected a mapping of fields, got {quoted(document[name])}")
    own = dict(document[name] or {})
    parent = own.pop("extends", None)
    if parent is not None and not isinstance(parent, str):
        raise ParamsError(f"{path}: {name}.extends: expected the name of a scenario, got {quoted(parent)}")
    return own if parent is None else merged(_extended(path, document, parent, (*seen, name)), own)
