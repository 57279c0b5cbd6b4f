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
    known_links: Annotated[
        bool,
        typer.Option(
            "--known-links",
            help="Arms whose URDF is right but for one link, a payload, or an encoder's zero. 24 cases hold one of "
            "each joint's effects, two of each of these, and three without any.",
        ),
    ] = False,
) -> None:
    """Diagnose simulated arms whose links are fitted and that have one effect, one sensor error, or nothing wrong.

    With --known-links, the links are taken as the URDF has them, and one of these may be wrong.

    Needs `pip install "drake-tc[robots]"`.
    """
    from drake_tc.benchmarks.arm_rigs import arm_benchmark, arm_rows, known_arm_benchmark

    benchmark = known_arm_benchmark if known_links else arm_benchmark
    scores = by_seed(
        "bench arms",
        seed,
        out,
        jobs,
        lambda folder, number, pool, report: benchmark(folder, range(cases), number, pool, report),
        quiet=as_json,
    )
    print_by_seed(
        "arms with known links" if known_links else "arms", scores, arm_rows, lambda score: score.robot, as_json=as_json
    )
