"""`drake-tc bench tick`: what a tick of robust TSID costs on a whole robot."""

import json
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from drake_tc.cli.progress import progress_bar


def bench_tick(
    scenario_name: Annotated[str, typer.Option(help="Motion along which ticks are timed.")] = "com_move",
    scenario_file: Annotated[Path | None, typer.Option(help="Scenario file (YAML) of your own.")] = None,
    duration: Annotated[float, typer.Option(help="Simulated seconds.")] = 2.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")] = False,
) -> None:
    """A tick of robust TSID, everything included, by measure of robustness and stage; and the diagram as a whole."""
    from drake_tc.diagrams.registry import tsid_entry
    from drake_tc.diagrams.tsid.timing import tick_timings

    scenario = tsid_entry().scenario(scenario_name, scenario_file).changed(duration=duration)
    with progress_bar("bench tick", quiet=as_json) as progress:
        rows = tick_timings(scenario, progress)
    if as_json:
        print(json.dumps({"name": "tick", "rows": [row.to_json() for row in rows]}))
        return
    table = Table(box=None, padding=(0, 2))
    table.add_column("what")
    for heading in ("median us", "99 % us", "n"):
        table.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        table.add_row(row.name, f"{row.median:.0f}", f"{row.p99:.0f}", str(row.n))
    Console(file=sys.stdout, highlight=False).print(table)
