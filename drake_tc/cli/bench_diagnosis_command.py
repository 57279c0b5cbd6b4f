"""`drake-tc bench diagnosis`: simulated rigs whose truth no file tells, diagnosed from the files alone."""

import json
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from drake_tc.cli.bench_seeds import ALL_CORES, AsJson, Jobs, Out, Seeds, by_seed

if TYPE_CHECKING:
    from drake_tc.benchmarks.blind.score import BenchmarkScore


def bench_diagnosis(
    scale: Annotated[str, typer.Option(help="smoke (about 35 rigs) or full (about 340).")] = "smoke",
    group: Annotated[
        list[str] | None, typer.Option(help="Part of the rigs: nulls, singles, pairs or outside; may be repeated.")
    ] = None,
    kind: Annotated[
        list[str] | None, typer.Option(help="Kind of rigs, such as stribeck or drifting_noise; may be repeated.")
    ] = None,
    out: Out = None,
    seed: Seeds = None,
    jobs: Jobs = ALL_CORES,
    as_json: AsJson = False,
) -> None:
    """Diagnose simulated joints. Code of its own simulates them, and the diagnosis sees only their files."""
    from drake_tc.benchmarks.blind.scoreboard import print_score
    from drake_tc.benchmarks.blind_rigs import BlindOptions, blind_benchmark

    if scale not in ("smoke", "full"):
        raise typer.BadParameter(f"expected smoke or full, got {scale!r}", param_hint="--scale")
    options = BlindOptions(scale, tuple(group or ()), tuple(kind or ()))  # type: ignore[arg-type]
    scores = by_seed(
        "bench diagnosis",
        seed,
        out,
        jobs,
        lambda folder, number, pool, report: blind_benchmark(folder, options, number, pool, report),
        quiet=as_json,
    )
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


def scores_json(scores: dict[int, "BenchmarkScore"]) -> dict[str, object]:
    """The contract of `bench`: name and rows, of all seeds together.

    Beside them `kinds` has the right answers by group, kind and strength, and `by_seed` the rows of each seed where
    there are several.
    """
    from drake_tc.benchmarks.blind.score_kinds import kind_table

    score = _together(scores)
    document = score.to_json() | {"kinds": kind_table(score.outcomes).to_dict("records")}
    if len(scores) > 1:
        document["by_seed"] = {str(seed): one.to_json()["rows"] for seed, one in scores.items()}
    return document


def _together(scores: dict[int, "BenchmarkScore"]) -> "BenchmarkScore":
    from drake_tc.benchmarks.blind.score import score_outcomes

    return score_outcomes([outcome for score in scores.values() for outcome in score.outcomes])
