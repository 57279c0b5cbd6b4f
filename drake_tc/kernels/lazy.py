"""Compiled functions by name, so that Numba is imported where one of them is called and not before."""

from collections.abc import Callable
from importlib import import_module
from typing import Any


class Kernel:
    """A compiled function by name; its module is imported, and with it Numba, at the first call."""

    def __init__(self, module: str, name: str) -> None:
        """Keep the names.

        Args:
            module: Below `drake_tc.kernels`.
            name: Of the entry.
        """
        self._module, self._name = module, name
        self._entry: Callable[..., Any] | None = None

    def __call__(self, *arguments: Any) -> Any:
        """Call the entry."""
        entry = self._entry
        if entry is None:
            entry = self.entry()
        return entry(*arguments)

    def entry(self) -> Callable[..., Any]:
        """The compiled function itself."""
        if self._entry is None:
            self._entry = getattr(import_module(f"drake_tc.kernels.{self._module}"), self._name)
        return self._entry
