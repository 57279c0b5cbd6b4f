"""`drake-tc bench qp`: which solver of quadratic programs suits a 1 kHz controller of a whole robot."""

import json
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from drake_tc.cli.progress import progress_bar
from drake_tc.cli.seed_option import UnusedSeed
from drake_tc.report.figure_row import rows_json

COMPARED = ("daqp", "quadprog", "piqp", "proxqp", "clarabel", "osqp")


def bench_qp(
    solver: Annotated[
        list[str] | None, typer.Option(help="A solver to time; may be repeated. Default: all installed ones.")
    ] = None,
    controller: Annotated[Path | None, typer.Option(help="Controller file; the humanoid's by default.")] = None,
    ticks: Annotated[int, typer.Option(min=20, help="Number of problems of each motion.")] = 400,
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")] = False,
    seed: UnusedSeed = 0,
) -> None:
    """Solve quadratic programs along robot motions by each solver: time of cold and warm starts, and accuracy."""
    from drake_tc.benchmarks.qp import qp_rows
    from drake_tc.tsid.configuration import load_law
    from drake_tc.tsid.qp.choose import unavailable

    missing = {} if solver else {name: why for name in COMPARED if (why := unavailable(name)) is not None}
    for why in missing.values():
        print(f"drake-tc: not timed: {why}", file=sys.stderr)
    names = solver or [name for name in COMPARED if name not in missing]
    law = load_law(controller or humanoid_controller())
    with progress_bar("bench qp", quiet=as_json) as progress:
        rows = qp_rows(law, names, progress, ticks)
    if as_json:
        print(json.dumps(rows_json("qp", rows)))
        return
    table = Table(box=None, padding=(0, 2))
    for heading in ("solver", "motion", "start"):
        table.add_column(heading, no_wrap=True)
    for heading in ("median us", "99 % us", "not solved", "residual", "problems"):
        table.add_column(heading, justify="right", no_wrap=True)
    for timing, unsolved, worst in zip(rows[::3], rows[1::3], rows[2::3], strict=True):
        cells = f"{timing.value:.0f}", f"{timing.highest:.0f}", f"{unsolved.value:.0f}", f"{worst.value:.1e}"
        table.add_row(*timing.name.split(", "), *cells, str(timing.n))
    Console(file=sys.stdout, highlight=False).print(table)


def humanoid_controller() -> Path:
    """The controller file of the humanoid's first scenario."""
    from drake_tc.registry import tsid_entry

    scenario = tsid_entry().scenario("balance")
    return scenario.path(scenario.controller)
