"""Tables whose numbers are never cut: in a narrow terminal the lines are longer than it is wide."""

import sys
from collections.abc import Iterable, Sequence
from typing import TextIO

from rich.console import Console
from rich.markup import escape
from rich.table import Table

_NO_END = 10_000
"""Columns of a console in which nothing is cut."""


def print_wide(
    headings: Sequence[str],
    rows: Iterable[Sequence[str]],
    left: Sequence[str] = (),
    title: str = "",
    file: TextIO | None = None,
) -> None:
    """Print a table, as wide as its cells are.

    Args:
        headings: Of the columns.
        rows: Texts, one a column.
        left: Headings of columns that stand to the left; the others to the right.
        title: Above.
        file: Where to; None: stdout.
    """
    file = file or sys.stdout
    table = Table(box=None, padding=(0, 1), pad_edge=False, title=escape(title) or None, title_justify="left")
    for heading in headings:
        table.add_column(escape(heading), justify="left" if heading in left else "right", no_wrap=True)
    for row in rows:
        table.add_row(*map(escape, row))
    endless = Console(file=file, width=_NO_END)
    width = max(Console(file=file).width, endless.measure(table).maximum, len(title))
    Console(file=file, highlight=False, width=width).print(table)
