"""Scenario files: what all of them have, their checks, and how they are read.

`ScenarioBase`: how every scenario is read from its file, and changed.

Files of scenarios: many by name, one extending another, with changes laid over.

What every scenario's fields must be, whatever it runs.
"""

import math
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, ClassVar, Self

from drake_tc.config.quoted import did_you_mean, quoted
from drake_tc.config.records import check_choices, read_record
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


class ScenarioBase:
    """Base of the frozen dataclasses that are scenarios; `source`, where one has it, is the folder of its files."""

    SCHEMA: ClassVar[str] = ""
    """What `drake-tc schema` calls its file."""

    @classmethod
    def load(cls, path: Path, name: str, text: str | None = None) -> Self:
        """The scenario `name` of a file, with the fields in `text` changed.

        Args:
            path: Scenario file.
            name: Scenario.
            text: YAML mapping of fields to change, like `{duration: 3.0, gains: {k6: 0.25}}`.

        Raises:
            ParamsError: no such file or scenario, an unknown field, or a value that is not possible.
        """
        kind: Any = cls
        folder = {"source": str(path.parent)} if any(field.name == "source" for field in fields(kind)) else {}
        document = read_scenario(path, name, text)
        hint = f"`drake-tc schema {cls.SCHEMA} --page` explains every key" if cls.SCHEMA else ""
        return read_record(cls, document, str(path), hint=hint, more=folder, within=name)

    def changed(self, **changes: Any) -> Self:
        """The same with other values; those that are None stay."""
        own: Any = self
        other: Self = replace(own, **{name: value for name, value in changes.items() if value is not None})
        return other

    def path(self, name: str) -> Path:
        """A file that the scenario names, relative to the file it stands in."""
        own: Any = self
        return Path(own.source) / name


SEEDS = 2**64
"""How many seeds there are: what the counter-based generators take as a key."""


def check_seed(seed: object) -> None:
    """A seed is what the generators take.

    Raises:
        ParamsError: it is not.
    """
    if not isinstance(seed, int) or isinstance(seed, bool) or not 0 <= seed < SEEDS:
        raise ParamsError(f"seed: expected a whole number from 0 to 2^64 - 1, got {seed!r}")


def check_run(scenario: Any, times: Sequence[str]) -> None:
    """Fields of choice by their `Literal`s, times [s], the seed and the factors of the links' masses.

    Args:
        scenario: With `seed` and `masses`.
        times: Fields that are positive times.

    Raises:
        ParamsError: a value that is not possible; names the field.
    """
    check_choices(scenario)
    for name in times:
        if not 0.0 < getattr(scenario, name) < math.inf:
            raise ParamsError(f"{name}: expected a positive number [s], got {getattr(scenario, name)!r}")
    check_seed(scenario.seed)
    for link, factor in scenario.masses.items():
        if not 0.0 < factor < math.inf:
            raise ParamsError(f"masses.{link}: expected a positive factor, got {factor}")
