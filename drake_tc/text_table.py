"""A table for people, as commands print it."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class TextTable:
    """A table for people.

    Attributes:
        title: One line; empty for none.
        headings: One a column; the first column has names, the others numbers.
        rows: Texts.
    """

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def text_rows(
    names: Sequence[str], columns: Sequence[Sequence[float]], digits: str = ".3f"
) -> tuple[tuple[str, ...], ...]:
    """Rows of a TextTable: a name, then one number of each column."""
    return tuple((name, *(format(column[i], digits) for column in columns)) for i, name in enumerate(names))
