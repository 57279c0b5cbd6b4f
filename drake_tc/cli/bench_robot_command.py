"""`drake-tc bench robot`: simulated logs of a whole leg, one thing wrong in each, diagnosed from the files alone."""

import json
import os
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from drake_tc.bench.robot_rigs import RobotScore, robot_benchmark, summary_rows
from drake_tc.cli.progress import progress_bar


def bench_robot(
    cases: Annotated[int, typer.Option(min=1, help="How many; 13 hold one of each kind and two nulls.")] = 65,
    out: Annotated[Path | None, typer.Option(help="Keep logs and reports here; those found here are reused.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the cases.")] = 0,
    jobs: Annotated[int, typer.Option(min=1, help="Cases side by side.")] = os.cpu_count() or 1,
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")] = False,
) -> None:
    """Blind benchmark of a robot's rig: an effect in one joint, a sensor's error, a wrong link, or nothing."""
    with (
        tempfile.TemporaryDirectory() as scratch,
        progress_bar("bench robot", quiet=as_json) as progress,
        ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool,
    ):
        scores = robot_benchmark(out or Path(scratch), range(cases), seed, pool, progress)
    rows = summary_rows(scores)
    if as_json:
        missed = [{"name": s.name, "named": list(s.named)} for s in scores if not s.exact]
        print(json.dumps({"name": "robot", "rows": rows, "missed": missed}))
        return
    _print(rows, scores)


def _print(rows: list[dict[str, object]], scores: list[RobotScore]) -> None:
    console = Console(file=sys.stdout, highlight=False)
    table = Table(box=None, padding=(0, 2))
    table.add_column("figure")
    for heading in ("reached", "wanted", "cases"):
        table.add_column(heading, justify="right")
    for row in rows:
        wanted = "" if row["expected"] is None else f">= {row['expected']:.0f} %"
        table.add_row(str(row["name"]), f"{row['value']:.1f} %", wanted, str(row["n"]))
    console.print(table)
    for score in scores:
        if not score.exact:
            console.print(f"{score.name}: named {', '.join(score.named) or 'nothing'}")
