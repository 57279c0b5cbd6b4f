"""`drake-tc bench diagnosis`: simulated rigs whose truth no file tells, diagnosed from the files alone."""

import json
import os
import tempfile
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from drake_tc.blind.score import BenchmarkScore, score_outcomes
from drake_tc.blind.score_kinds import kind_table
from drake_tc.blind.scoreboard import print_score
from drake_tc.cli.progress import progress_bar

if TYPE_CHECKING:
    from drake_tc.bench.blind_rigs import BlindOptions


def bench_diagnosis(
    scale: Annotated[str, typer.Option(help="smoke (about 35 rigs) or full (about 340).")] = "smoke",
    group: Annotated[
        list[str] | None, typer.Option(help="Part of the rigs: nulls, singles, pairs or outside; may be repeated.")
    ] = None,
    kind: Annotated[
        list[str] | None, typer.Option(help="Kind of rigs, such as stribeck or drifting_noise; may be repeated.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Keep rigs and reports here; rigs found here are reused.")] = None,
    seed: Annotated[list[int] | None, typer.Option(help="Seed of the rigs, 0 by default; may be repeated.")] = None,
    jobs: Annotated[int, typer.Option(help="Rigs diagnosed side by side.")] = os.cpu_count() or 1,
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")] = False,
) -> None:
    """Blind benchmark: rigs are simulated by an independent code path; the diagnosis sees only their files."""
    from drake_tc.bench.blind_rigs import BlindOptions

    if scale not in ("smoke", "full"):
        raise typer.BadParameter(f"expected smoke or full, got {scale!r}", param_hint="--scale")
    options = BlindOptions(scale, tuple(group or ()), tuple(kind or ()))  # type: ignore[arg-type]
    seeds = list(dict.fromkeys(seed or [0]))
    scores = _run(options, seeds, out, jobs, quiet=as_json)
    if as_json:
        print(json.dumps(scores_json(scores)))
        return
    for number, score in scores.items():
        if len(scores) > 1:
            Console().print(f"Seed {number}")
        print_score(score)
    if len(scores) > 1:
        Console().print(f"Seeds {', '.join(map(str, scores))} together")
        print_score(_together(scores))


def scores_json(scores: dict[int, BenchmarkScore]) -> dict[str, object]:
    """The contract of `bench`: name and rows, of all seeds together.

    Beside them `kinds` has the right answers by group, kind and strength, and `by_seed` the rows of each seed where
    there are several.
    """
    score = _together(scores)
    document = score.to_json() | {"kinds": kind_table(score.outcomes).to_dict("records")}
    if len(scores) > 1:
        document["by_seed"] = {str(seed): one.to_json()["rows"] for seed, one in scores.items()}
    return document


def _together(scores: dict[int, BenchmarkScore]) -> BenchmarkScore:
    return score_outcomes([outcome for score in scores.values() for outcome in score.outcomes])


def _run(
    options: "BlindOptions", seeds: list[int], out: Path | None, jobs: int, *, quiet: bool
) -> dict[int, BenchmarkScore]:
    """The score of each seed; several seeds have a folder `seed_N` each."""
    from drake_tc.bench.blind_rigs import blind_benchmark

    scores = {}
    with (
        tempfile.TemporaryDirectory() as scratch,
        progress_bar("bench diagnosis", quiet=quiet) as progress,
        ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool,
    ):
        root = out or Path(scratch)
        for done, seed in enumerate(seeds):
            folder = root if len(seeds) == 1 else root / f"seed_{seed}"

            def report(text: str, share: float, done: int = done, seed: int = seed) -> None:
                progress(f"seed {seed}: {text}", (done + share) / len(seeds))

            scores[seed] = blind_benchmark(folder, options, seed, pool, report)
    return scores
