"""`drake-tc bench floor`: which contact approximation of Drake suits standing, slipping and rolling soles."""

import json
import sys
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from drake_tc.cli.progress import progress_bar


def bench_floor(
    duration: Annotated[float, typer.Option(min=0.1, help="Simulated seconds of the diagram that is timed.")] = 2.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")] = False,
) -> None:
    """Compare the contact approximations: a foot that stands, slides and rocks, a leaning robot, the time of a tick."""
    from drake_tc.benchmarks.floor_contact import floor_rows
    from drake_tc.registry import tsid_entry

    moved = tsid_entry().scenario("com_move").changed(duration=duration)
    reaching = tsid_entry().scenario("far_reach")
    with progress_bar("bench floor", quiet=as_json) as progress:
        rows = floor_rows(moved, reaching, progress)
    if as_json:
        print(json.dumps({"name": "floor", "rows": [row.to_json() for row in rows]}))
        return
    table = Table(box=None, padding=(0, 2))
    table.add_column("figure")
    for heading in ("value", "unit", "99 %"):
        table.add_column(heading, justify="left" if heading == "unit" else "right", no_wrap=True)
    for row in rows:
        last = f"{row.p99:.0f}" if row.n > 1 else ""
        table.add_row(row.name, f"{row.median:.4g}", row.unit, last)
    Console(file=sys.stdout, highlight=False).print(table)
