"""`drake-tc reproduce`: a table or figure of the papers, computed anew and held against expected values."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from drake_tc.cli.progress import progress_bar
from drake_tc.errors import ParamsError

if TYPE_CHECKING:
    from drake_tc.diagrams.papers.reproduction import Reproduction


def reproduce_command(
    name: Annotated[str, typer.Argument(help="A.table1, A.table2, ... or all; a wrong one lists those there are.")],
    seed: Annotated[int, typer.Option(help="Of all random numbers.")] = 0,
    figures: Annotated[Path | None, typer.Option(help="Folder for the figures (PNG).")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")] = False,
) -> None:
    """Compute a table or figure of the papers and say which expected values are met; simulated throughout."""
    from drake_tc.diagrams.papers.catalogue import REPRODUCTIONS, chosen

    results = []
    for id_ in chosen(name):
        with progress_bar(f"reproduce {id_}", quiet=as_json) as progress:
            result = REPRODUCTIONS[id_](seed, progress)
        results.append(result)
        if figures:
            _draw(result, figures)
        if not as_json:
            _print(result)
    if as_json:
        found = [result.to_json() for result in results]
        print(json.dumps(found[0] if name != "all" else found))


def _draw(result: "Reproduction", folder: Path) -> None:
    from matplotlib.figure import Figure

    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, draw in (result.figures or {}).items():
            figure = Figure(figsize=(9.0, 5.5), layout="constrained")
            draw(figure)
            figure.savefig(folder / f"{name}.png", dpi=120)
    except OSError as error:
        raise ParamsError(f"{folder}: figures cannot be written: {error.strerror or error}") from None


def _print(result: "Reproduction") -> None:
    console = Console(file=sys.stdout, highlight=False)
    for text in result.tables:
        table = Table(title=escape(text.title), title_justify="left", box=None, padding=(0, 1))
        for number, heading in enumerate(text.headings):
            table.add_column(escape(heading), justify="right" if number else "left", overflow="fold")
        for row in text.rows:
            table.add_row(*map(escape, row))
        console.print(table)
        console.print()
    table = Table(title=f"{result.id}: expected values", title_justify="left", box=None, padding=(0, 1))
    for heading in ("figure", "value", "wanted", "met"):
        table.add_column(heading, justify="left" if heading == "figure" else "right", overflow="fold")
    for row in result.rows:
        if row.expectation is not None:
            table.add_row(row.name, f"{row.value:.4g}", _wanted(row.expectation), "yes" if row.met else "NO")
    console.print(table)
    for row in result.rows:
        if row.met is False and row.expectation and row.expectation.reason:
            console.print(f"not met: {row.name}: {row.expectation.reason}", soft_wrap=True)
    for note in result.notes:
        console.print(escape(note))


def _wanted(expectation: Any) -> str:
    sign = {"min": ">=", "max": "<=", "within": "~"}[expectation.how]
    slack = f" +/- {expectation.tolerance:g}" if expectation.how == "within" else ""
    unit = "" if expectation.unit == "-" else expectation.unit
    return f"{sign} {expectation.expected:g}{slack} {unit}".strip()
