"""`ScenarioBase`: how every scenario is read from its file, and changed."""

from dataclasses import fields, replace
from pathlib import Path
from typing import Any, Self

from drake_tc.loops.scenarios.files import read_scenario
from drake_tc.loops.scenarios.strict_yaml import from_mapping


class ScenarioBase:
    """Base of the frozen dataclasses that are scenarios; `source`, where one has it, is the folder of its files."""

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
        scenario: Self = from_mapping(cls, folder | read_scenario(path, name, text), f"{path}: {name}")
        return scenario

    def changed(self, **changes: Any) -> Self:
        """The same with other values; those that are None stay."""
        own: Any = self
        other: Self = replace(own, **{name: value for name, value in changes.items() if value is not None})
        return other

    def path(self, name: str) -> Path:
        """A file that the scenario names, relative to the file it stands in."""
        own: Any = self
        return Path(own.source) / name
