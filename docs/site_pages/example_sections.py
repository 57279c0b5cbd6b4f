"""Griffe extension: `Example:` of a docstring is the section that mkdocstrings shows as code, `Examples:`."""

from typing import Any

import griffe


class ExampleSections(griffe.Extension):
    """Renames the sections while the package is read."""

    def on_object(self, *, obj: Any, **_: Any) -> None:
        """Called for every module, class, function and attribute."""
        if obj.docstring is not None:
            obj.docstring.value = obj.docstring.value.replace("\nExample:\n", "\nExamples:\n")
