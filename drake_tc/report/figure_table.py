"""Figures as a table for people."""

from collections.abc import Sequence

from rich.markup import escape
from rich.table import Table

from drake_tc.report.figure_row import FigureRow


def figure_cells(rows: Sequence[FigureRow]) -> list[dict[str, str]]:
    """Heading to text, figure by figure; headings under which all texts would be empty are left out."""
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
    shown = [name for name in cells[0] if any(each[name] for each in cells)] if cells else []
    return [{name: each[name] for name in shown} for each in cells]


def figure_table(rows: Sequence[FigureRow], title: str | None = None) -> Table:
    """One line a figure, with the columns of `figure_cells`."""
    cells = figure_cells(rows)
    table = Table(title=title, title_justify="left", box=None, padding=(0, 2))
    for heading in cells[0] if cells else ():
        table.add_column(heading, justify="left" if heading in ("figure", "note") else "right", overflow="fold")
    for each in cells:
        table.add_row(*map(escape, each.values()))
    return table
