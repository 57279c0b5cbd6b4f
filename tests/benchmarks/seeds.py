"""Options and the loop over seeds that the benchmarks on simulated rigs share."""

import os
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Annotated, TypeVar

import typer

from drake_tc.analysis.sweep import processes
from drake_tc.cli.terminal import progress_bar

Report = Callable[[str, float], None]
Score = TypeVar("Score")

Out = Annotated[
    Path | None, typer.Option(help="Folder that keeps logs and reports. Results that are found there are reused.")
]
Seeds = Annotated[list[int] | None, typer.Option(help="Seed of the cases, 0 by default; may be repeated.")]
Jobs = Annotated[int, typer.Option(min=1, help="Number of cases in parallel.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")]
ALL_CORES = os.cpu_count() or 1


def by_seed(
    title: str,
    seeds: Sequence[int] | None,
    out: Path | None,
    jobs: int,
    run: Callable[[Path, int, Executor, Report], Score],
    *,
    quiet: bool,
) -> dict[int, Score]:
    """What `run` returns for each seed, in the order given and each seed once.

    Args:
        title: Of the progress bar.
        seeds: None for seed 0.
        out: Where files are kept, in a folder `seed_N` for each of several seeds; None for a scratch folder.
        jobs: Worker processes.
        run: Called with a folder, the seed, the worker processes and a report of progress in [0, 1].
        quiet: No progress is shown.
    """
    chosen = list(dict.fromkeys(seeds or [0]))
    scores: dict[int, Score] = {}
    with (
        tempfile.TemporaryDirectory() as scratch,
        progress_bar(title, quiet=quiet) as progress,
        processes(jobs) as pool,
    ):
        root = out or Path(scratch)
        for done, seed in enumerate(chosen):
            folder = root if len(chosen) == 1 else root / f"seed_{seed}"

            def report(text: str, share: float, done: int = done, seed: int = seed) -> None:
                progress(f"seed {seed}: {text}", (done + share) / len(chosen))

            scores[seed] = run(folder, seed, pool, report)
    return scores
