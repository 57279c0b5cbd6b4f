"""`front_door`: names of a package that are imported from their modules when they are first used."""

import ast
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any


def front_door(package: str) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """`__all__`, `__getattr__` and `__dir__` of a package, from the imports in its `__init__.pyi`.

    Type checkers read the same file (https://scientific-python.org/specs/spec-0001).

    Args:
        package: Its `__name__`.
    """
    stub = Path(str(sys.modules[package].__file__)).with_suffix(".pyi")
    imports = [node for node in ast.parse(stub.read_text(encoding="utf-8")).body if isinstance(node, ast.ImportFrom)]
    homes = {alias.name: str(node.module) for node in imports for alias in node.names}

    def get(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"{package} has no {name!r}; public names: {', '.join(sorted(homes))}")
        return getattr(import_module(homes[name]), name)

    def listed() -> list[str]:
        return sorted({*homes, *vars(sys.modules[package])})

    return sorted(homes), get, listed
