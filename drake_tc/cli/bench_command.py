"""`drake-tc bench`: benchmarks that print rows, for people or with --json for programs."""

import json
import os
import tempfile
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated

import typer

from drake_tc.blind.scoreboard import print_score
from drake_tc.cli.progress import progress_bar

bench_app = typer.Typer(help="Benchmarks: rows of figures, for people or with --json for programs.", no_args_is_help=True)


@bench_app.command("diagnosis")
def bench_diagnosis(
    scale: Annotated[str, typer.Option(help="smoke (about 30 rigs) or full (over 300).")] = "smoke",
    out: Annotated[Path | None, typer.Option(help="Keep rigs and reports here; rigs found here are reused.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of the rigs.")] = 0,
    jobs: Annotated[int, typer.Option(help="Rigs diagnosed side by side.")] = os.cpu_count() or 1,
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")] = False,
) -> None:
    """Blind benchmark: rigs are simulated by an independent code path; the diagnosis sees only their files."""
    from drake_tc.bench.blind_rigs import blind_benchmark

    if scale not in ("smoke", "full"):
        raise typer.BadParameter(f"wanted smoke or full, got {scale!r}", param_hint="--scale")
    with (
        tempfile.TemporaryDirectory() as scratch,
        progress_bar("bench diagnosis", quiet=as_json) as progress,
        ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool,
    ):
        score = blind_benchmark(out or Path(scratch), scale, seed, pool, progress)  # type: ignore[arg-type]
    if as_json:
        print(json.dumps(score.to_json()))
    else:
        print_score(score)
