"""`drake-tc bench arms`: simulated arms of several makers, one thing wrong in each, diagnosed from the files alone."""

from typing import Annotated

import typer

from drake_tc.cli.bench_robot_command import print_by_seed
from drake_tc.cli.bench_seeds import ALL_CORES, AsJson, Jobs, Out, Seeds, by_seed


def bench_arms(
    cases: Annotated[
        int, typer.Option(min=1, help="Number of cases. 16 cases hold one of each kind, and two without any effect.")
    ] = 48,
    out: Out = None,
    seed: Seeds = None,
    jobs: Jobs = ALL_CORES,
    as_json: AsJson = False,
) -> None:
    """Diagnose simulated arms whose links are fitted and that have one effect, one sensor error, or nothing wrong.

    Needs `pip install "drake-tc[robots]"`.
    """
    from drake_tc.benchmarks.arm_rigs import arm_benchmark, arm_rows

    scores = by_seed(
        "bench arms",
        seed,
        out,
        jobs,
        lambda folder, number, pool, report: arm_benchmark(folder, range(cases), number, pool, report),
        quiet=as_json,
    )
    print_by_seed("arms", scores, arm_rows, lambda score: score.robot, as_json=as_json)
