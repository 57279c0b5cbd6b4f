"""`drake-tc bench tick`: what a tick of robust TSID costs on a whole robot."""

from pathlib import Path
from typing import Annotated

import typer

from drake_tc.cli.bench_table import print_rows
from drake_tc.cli.progress import progress_bar
from drake_tc.cli.seed_option import UnusedSeed


def bench_tick(
    scenario_name: Annotated[str, typer.Option(help="Motion along which ticks are timed.")] = "com_move",
    scenario_file: Annotated[Path | None, typer.Option(help="Scenario file (YAML) of your own.")] = None,
    duration: Annotated[float, typer.Option(help="Simulated seconds.")] = 2.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")] = False,
    seed: UnusedSeed = 0,
) -> None:
    """Time a tick of robust TSID by robustness measure and stage, and the whole diagram."""
    from drake_tc.benchmarks.tsid_timing import tick_timings
    from drake_tc.registry import tsid_entry

    scenario = tsid_entry().scenario(scenario_name, scenario_file).changed(duration=duration)
    with progress_bar("bench tick", quiet=as_json) as progress:
        rows = tick_timings(scenario, progress)
    print_rows("tick", rows, as_json=as_json)
