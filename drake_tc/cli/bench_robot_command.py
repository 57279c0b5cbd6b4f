"""`drake-tc bench robot`: simulated logs of a whole leg, one thing wrong in each, diagnosed from the files alone."""

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer
from rich.console import Console

from drake_tc.cli.bench_seeds import ALL_CORES, AsJson, Jobs, Out, Seeds, by_seed
from drake_tc.report.figure_row import FigureRow, rows_json
from drake_tc.report.figure_table import figure_table

if TYPE_CHECKING:
    from drake_tc.benchmarks.robot_rigs import RobotScore

Score = TypeVar("Score")


def bench_robot(
    cases: Annotated[
        int, typer.Option(min=1, help="Number of cases. 13 cases hold one of each kind, and two without any effect.")
    ] = 65,
    out: Out = None,
    seed: Seeds = None,
    tolerances: Annotated[
        float, typer.Option(min=0.0, help="Factor of the sensors' tolerances (0.1 N, 5 mN m, 0.01 m/s^2), such as 3.")
    ] = 1.0,
    jobs: Jobs = ALL_CORES,
    as_json: AsJson = False,
) -> None:
    """Diagnose simulated legs with one effect, one sensor error, one wrong link, or nothing wrong."""
    from drake_tc.benchmarks.robot_rigs import robot_benchmark, summary_rows

    scores = by_seed(
        "bench robot",
        seed,
        out,
        jobs,
        lambda folder, number, pool, report: robot_benchmark(folder, range(cases), number, pool, report, tolerances),
        quiet=as_json,
    )
    print_by_seed("robot", scores, summary_rows, lambda score: score, as_json=as_json)


def print_by_seed(
    name: str,
    scores: Mapping[int, Sequence[Score]],
    rows_of: Callable[[Sequence[Score]], list[FigureRow]],
    robot_of: Callable[[Score], "RobotScore"],
    *,
    as_json: bool,
) -> None:
    """Print the figures of all seeds together and of each, and the cases whose answer is not exact.

    Args:
        name: Of the benchmark.
        scores: By seed.
        rows_of: Figures of some scores.
        robot_of: Place and effect of a score.
        as_json: For programs.
    """
    everything = [score for group in scores.values() for score in group]
    missed = _missed({number: [robot_of(score) for score in group] for number, group in scores.items()})
    if as_json:
        document = rows_json(name, rows_of(everything)) | {"missed": missed}
        if len(scores) > 1:
            document["by_seed"] = {
                str(number): [row.to_json() for row in rows_of(group)] for number, group in scores.items()
            }
        print(json.dumps(document))
        return
    console = Console(file=sys.stdout, highlight=False)
    if len(scores) > 1:
        for number, group in scores.items():
            console.print(f"Seed {number}")
            console.print(figure_table(rows_of(group)))
        console.print(f"Seeds {', '.join(map(str, scores))} together")
    console.print(figure_table(rows_of(everything)))
    for miss in missed:
        reason = miss["failure"] or f"named {', '.join(miss['named']) or 'nothing'}"
        console.print(f"seed {miss['seed']}, {miss['name']}: {reason}", soft_wrap=True)


def _missed(scores: Mapping[int, Sequence["RobotScore"]]) -> list[dict[str, Any]]:
    """The cases whose answer is not exact."""
    return [
        {"seed": number, "name": s.name, "named": list(s.named), "failure": s.failure}
        for number, group in scores.items()
        for s in group
        if not s.exact
    ]
