"""Figures as a table for people."""

from collections.abc import Sequence

from rich.markup import escape
from rich.table import Table

from drake_tc.report.figure_row import FigureRow


def figure_table(rows: Sequence[FigureRow], title: str | None = None) -> Table:
    """One line a figure; columns that would be empty are left out."""
    cells = [
        {
            "figure": row.name,
            "value": row.shown(row.value),
            "99 %": row.shown(row.highest) if row.p99 is not None else "",
            "n": str(row.n) if row.n != 1 else "",
            "expected": row.goal,
            "met": {None: "", True: "yes", False: "NO"}[row.met],
            "note": row.note,
        }
        for row in rows
    ]
    table = Table(title=title, title_justify="left", box=None, padding=(0, 2))
    shown = [name for name in cells[0] if any(each[name] for each in cells)] if cells else []
    for heading in shown:
        table.add_column(heading, justify="left" if heading in ("figure", "note") else "right", overflow="fold")
    for each in cells:
        table.add_row(*(escape(each[name]) for name in shown))
    return table
