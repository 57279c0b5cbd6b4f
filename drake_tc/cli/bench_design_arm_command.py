"""`drake-tc bench design-arm`: what a designed motion of a whole arm gains over growing sinusoids."""

import json
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from drake_tc.cli.bench_seeds import AsJson
from drake_tc.cli.bench_table import print_rows
from drake_tc.cli.progress import progress_bar
from drake_tc.config.json_values import json_value
from drake_tc.report.figure_row import rows_json


def bench_design_arm(
    arm: Annotated[
        str | None,
        typer.Option(help="Name of an arm. An unknown name prints the available arms. Default: an arm of six joints."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder that keeps the logs.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the arm, the design, the motions and the noise.")] = 1,
    as_json: AsJson = False,
) -> None:
    """Compare the intervals that close-loop states after a designed motion of an arm and after growing sinusoids.

    Both motions take 30 s, keep the same limits, and are simulated twice with the same noise. The links of the
    simulated arm differ from its URDF and are fitted. Needs `pip install "drake-tc[robots]"`.
    """
    from drake_tc.benchmarks.blind_arm.arms import REFERENCE, arm_named
    from drake_tc.experiments.evidence.arm_intervals import KINDS, arm_comparison, comparison_rows
    from drake_tc.experiments.evidence.arm_runs import MOTIONS

    chosen = arm_named(arm or REFERENCE)
    with (
        tempfile.TemporaryDirectory() as scratch,
        progress_bar("bench design-arm", quiet=as_json) as progress,
    ):
        made = arm_comparison(chosen, seed, out or Path(scratch), progress)
    rows = comparison_rows(made)
    if as_json:
        details = {"arm": made.arm, "ratios": {kind: made.ratios(kind) for kind in KINDS}, **asdict(made)}
        print(json.dumps(rows_json("design-arm", rows) | json_value(details)))
        return
    print_rows("", rows, as_json=False)
    for name in MOTIONS:
        if made.named[name]:
            print(f"{name}: named, although nothing is missing: {', '.join(made.named[name])}")
