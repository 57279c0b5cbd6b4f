"""`bench arms`: simulated logs of arms of several makers, diagnosed from the files alone, scored against the truth.

Each case has one thing wrong that no file says: an effect in one joint, a sensor, or nothing; and every arm's inertias
differ from its URDF. The rig fits the links (`load: {robot: fitted}`); the score says whether the intervals of the base
parameters hold the truth.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from drake_tc.diagnosis.search import Progress
from tests.benchmarks.figures import BenchmarkRow
from tests.benchmarks.interval_coverage import holds
from tests.benchmarks.robot_rigs import (
    RobotScore,
    interval_row,
    recorded_and_diagnosed,
    run_cases,
    score_report,
    summary_rows,
)

BASE_INTERVALS = "95 % intervals of base parameters hold the truth"


@dataclass(frozen=True)
class ArmScore:
    """How a case came out.

    Attributes:
        robot: Place, effect and the intervals of its parameters and of friction.
        base: For each base parameter, whether its 95 % interval holds the truth.
        drive: Of the arm. verdict, seconds: Of the report.
    """

    robot: RobotScore
    base: tuple[bool, ...]
    drive: str
    verdict: str
    seconds: float


def score_arm(name: str, truth: Mapping[str, Any], report: Mapping[str, Any]) -> ArmScore:
    """Score one report."""
    robot = score_report(name, truth, report)
    seconds = float(report.get("seconds", np.nan))
    return ArmScore(
        robot, base_intervals(truth, report), str(truth.get("drive", "")), report.get("verdict", ""), seconds
    )


def base_intervals(truth: Mapping[str, Any], report: Mapping[str, Any]) -> tuple[bool, ...]:
    """For each base parameter of the report, whether its interval holds the combination of the true parameters."""
    found = (report.get("links") or {}).get("base", [])
    return tuple(
        holds(entry["ci95"], sum(factor * truth["links"][member] for member, factor in entry["weights"].items()))
        for entry in found
    )


def run_case(folder: Path, number: int, seed: int) -> str:
    """Record case `number` in `folder` unless it is there, diagnose it unless its report is there; its name."""
    from tests.benchmarks.blind_arm.cases import arm_case, record_case

    case = arm_case(number, seed)
    return recorded_and_diagnosed(folder, case.name, partial(record_case, case))


def run_known_case(folder: Path, number: int, seed: int) -> str:
    """The same of an arm with known links."""
    from tests.benchmarks.blind_arm.known_links import known_case, record_known_case

    case = known_case(number, seed)
    return recorded_and_diagnosed(folder, case.name, partial(record_known_case, case))


def known_arm_benchmark(
    folder: Path,
    cases: Sequence[int],
    seed: int,
    executor: Executor,
    progress: Progress,
) -> list[ArmScore]:
    """`arm_benchmark` with the cases of `blind_arm.known_links`."""
    from tests.benchmarks.blind_arm.known_links import named_set_up

    run = partial(run_known_case, seed=seed)
    made = run_cases(folder, {"seed": seed, "links": "known"}, run, cases, executor, progress)
    return [score_arm(name, truth, named_set_up(report)) for name, truth, report in made]


def arm_benchmark(
    folder: Path,
    cases: Sequence[int],
    seed: int,
    executor: Executor,
    progress: Progress,
) -> list[ArmScore]:
    """Run cases side by side and score them.

    Args:
        folder: Gets rigs/, truth/ and reports/; what is there of the same seed is used again.
        cases: Their numbers.
        seed: Of all draws.
        executor: Runs them.
        progress: Told how far it is.

    Raises:
        DrakeTcError: A folder that holds cases of another seed.
    """
    made = run_cases(folder, seed, partial(run_case, seed=seed), cases, executor, progress)
    return [score_arm(*case) for case in made]


def arm_rows(scores: Sequence[ArmScore]) -> list[BenchmarkRow]:
    """Rows of figures as those of `bench robot`, and base parameters' intervals; both kinds of interval by drive."""
    rows = summary_rows([score.robot for score in scores], nulls=0.97)
    rows.append(interval_row(BASE_INTERVALS, [hit for score in scores for hit in score.base]))
    for drive in sorted({score.drive for score in scores}):
        group = [score for score in scores if score.drive == drive]
        friction = [hit for score in group for hit in score.robot.friction_intervals]
        rows.append(BenchmarkRow.share(f"base parameters, {drive}", [hit for score in group for hit in score.base]))
        rows.append(BenchmarkRow.share(f"friction, {drive}", friction))
    return [row for row in rows if row.n]
