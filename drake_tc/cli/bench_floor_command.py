"""`drake-tc bench floor`: which contact approximation of Drake suits standing, slipping and rolling soles."""

from typing import Annotated

import typer

from drake_tc.cli.bench_table import print_rows
from drake_tc.cli.progress import progress_bar
from drake_tc.cli.seed_option import UnusedSeed


def bench_floor(
    duration: Annotated[float, typer.Option(min=0.1, help="Simulated seconds of the diagram that is timed.")] = 2.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")] = False,
    seed: UnusedSeed = 0,
) -> None:
    """Compare contact approximations: a foot that stands, slides and rocks, a leaning robot, and the time of a tick."""
    from drake_tc.benchmarks.floor_contact import floor_rows
    from drake_tc.registry import tsid_entry

    moved = tsid_entry().scenario("com_move").changed(duration=duration)
    reaching = tsid_entry().scenario("far_reach")
    with progress_bar("bench floor", quiet=as_json) as progress:
        rows = floor_rows(moved, reaching, progress)
    print_rows("floor", rows, as_json=as_json)
