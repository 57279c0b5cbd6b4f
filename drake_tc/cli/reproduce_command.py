"""`drake-tc reproduce`: a table or figure of the papers, computed anew and held against expected values."""

import json
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from drake_tc.cli.options import LARGEST_SEED, Force
from drake_tc.cli.out_files import result_folder
from drake_tc.cli.terminal import progress_bar

if TYPE_CHECKING:
    from drake_tc.report.figure_row import Reproduction
    from drake_tc.types import TextTable


def reproduce_command(
    name: Annotated[str, typer.Argument(help="Id such as A.table2, or all. An unknown id prints the available ids.")],
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of all random numbers.")] = 0,
    figures: Annotated[Path | None, typer.Option(help="Folder for the figures (PNG).")] = None,
    force: Force = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")] = False,
) -> None:
    """Compute a table or figure of a paper by simulation, and compare it with the printed values."""
    from drake_tc.registry import reproductions

    known = reproductions(name)
    results, drawn = [], []
    for id_, compute in known.items():
        with ExitStack() as stack:
            folder = stack.enter_context(result_folder(figures, "--figures", force=force)) if figures else None
            progress = stack.enter_context(progress_bar(f"reproduce {id_}", quiet=as_json))
            result = compute(seed, progress)
            files = [figures / name for name in _draw(result, folder)] if figures and folder else []
        results.append(result)
        drawn += files
        if not as_json:
            _print(result)
            for file in files:
                print(file)
    if as_json:
        for file in drawn:
            print(file, file=sys.stderr)
        found = [result.to_json() for result in results]
        print(json.dumps(found[0] if name != "all" else found))


def _draw(result: "Reproduction", folder: Path) -> list[str]:
    """Draw all figures into a folder; returns their files' names."""
    from matplotlib.figure import Figure

    files = []
    for name, draw in (result.figures or {}).items():
        figure = Figure(figsize=(9.0, 5.5), layout="constrained")
        draw(figure)
        figure.savefig(folder / f"{name}.png", dpi=120)
        files.append(f"{name}.png")
    return files


def _print(result: "Reproduction") -> None:
    console = Console(file=sys.stdout, highlight=False)
    for text in result.tables:
        _print_table(console, text)
    table = Table(title=f"{result.id}: expected values", title_justify="left", box=None, padding=(0, 1))
    for heading in ("figure", "value", "expected", "met"):
        table.add_column(heading, justify="left" if heading == "figure" else "right", overflow="fold")
    for row in result.rows:
        if row.expected is not None:
            table.add_row(escape(row.name), f"{row.value:.4g}", row.goal, "yes" if row.met else "NO")
    console.print(table)
    for row in result.rows:
        if row.met is False:
            console.print(escape(f"not met: {row.name}: {row.note or 'no reason known'}"))
    for note in result.notes:
        console.print(escape(note))


def _print_table(console: Console, text: "TextTable") -> None:
    """As a table where its cells fit; else, in a narrow terminal, each row as a line, so that no number is broken."""
    cells = [max(map(len, column)) for column in zip(*text.rows, strict=True)]
    spare = console.width - sum(cells) - 2 * len(cells)
    if spare >= 0:
        table = Table(title=escape(text.title), title_justify="left", box=None, padding=(0, 1), pad_edge=False)
        more = [max(0, len(heading) - cell) for heading, cell in zip(text.headings, cells, strict=True)]
        share = min(1.0, spare / max(1, sum(more)))
        for number, (heading, cell, wish) in enumerate(zip(text.headings, cells, more, strict=True)):
            justify: Literal["left", "right"] = "right" if number else "left"
            table.add_column(escape(heading), justify=justify, width=cell + int(share * wish), overflow="fold")
        for row in text.rows:
            table.add_row(*map(escape, row))
        console.print(table)
    else:
        console.print(escape(text.title))
        for name, *values in text.rows:
            pairs = (f"{heading} {value}" for heading, value in zip(text.headings[1:], values, strict=True))
            console.print(escape(f"{name}: {', '.join(pairs)}"))
    console.print()
