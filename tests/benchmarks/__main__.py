"""`python -m tests.benchmarks NAME`: benchmarks that print rows of figures, for people or with --json for programs."""

import json
import os
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer
from rich.console import Console
from rich.table import Table

from drake_tc.cli.entry import leave, restart_tuned
from drake_tc.cli.main import run_app
from drake_tc.cli.options import UnusedSeed
from drake_tc.cli.terminal import progress_bar
from drake_tc.config.quoted import json_value
from tests.benchmarks.figures import BenchmarkRow, figure_table, rows_json
from tests.benchmarks.seeds import ALL_CORES, AsJson, Jobs, Out, Seeds, by_seed

if TYPE_CHECKING:
    from tests.benchmarks.blind.score import BenchmarkScore
    from tests.benchmarks.evidence.load_loop import LoadCase
    from tests.benchmarks.evidence.loop import LoopCase
    from tests.benchmarks.robot_rigs import RobotScore

PROGRAM = "python -m tests.benchmarks"
SOLVERS = ("daqp", "quadprog", "piqp", "proxqp", "clarabel", "osqp")
Score = TypeVar("Score")
Report = Callable[[str, float], None]
Data = Annotated[Path, typer.Option(help="Folder that holds the public data sets, or the set itself.")]
Sets = Annotated[list[str] | None, typer.Option("--set", help="A data set; repeat for more. Default: all.")]

app = typer.Typer(
    name=PROGRAM, help="Benchmarks: rows of figures, with --json for programs.", add_completion=False,
    rich_markup_mode=None, pretty_exceptions_enable=False,
)  # fmt: skip


def run(arguments: Sequence[str]) -> int:
    """Run one benchmark and return its exit code, as `drake_tc.cli.main.run` does; nothing at all lists them."""
    return run_app(app, PROGRAM, arguments)


def print_rows(name: str, rows: Sequence[BenchmarkRow], *, as_json: bool) -> None:
    """Figures on stdout, as a table for people or as one JSON document."""
    if as_json:
        print(json.dumps(rows_json(name, rows)))
    else:
        Console(file=sys.stdout, highlight=False).print(figure_table(rows))


def _simple(name: str, short: str, text: str, rows: Callable[[Report], list[BenchmarkRow]]) -> None:
    """A benchmark without options of its own."""

    def command(as_json: AsJson = False, seed: UnusedSeed = 0) -> None:
        with progress_bar(f"bench {name}", quiet=as_json) as progress:
            table = rows(progress)
        print_rows(name, table, as_json=as_json)

    app.command(name, short_help=short, help=text)(command)


def _public(name: str, short: str, text: str, rows: Callable[[Path, Report], list[BenchmarkRow]]) -> None:
    """A benchmark on a public data set."""

    def command(data: Data, as_json: AsJson = False, seed: UnusedSeed = 0) -> None:
        with progress_bar(f"bench {name}", quiet=as_json) as progress:
            table = rows(data, progress)
        print_rows(name, table, as_json=as_json)

    app.command(name, short_help=short, help=text)(command)


@app.command("diagnosis", short_help="Diagnosis of simulated joints.")
def diagnosis(
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
    from tests.benchmarks.blind.scoreboard import print_score
    from tests.benchmarks.blind_rigs import BlindOptions, blind_benchmark

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


def scores_json(scores: Mapping[int, "BenchmarkScore"]) -> dict[str, object]:
    """The document of `diagnosis`: name and rows, of all seeds together.

    Beside them `kinds` has the right answers by group, kind and strength, and `by_seed` the rows of each seed where
    there are several.
    """
    from tests.benchmarks.blind.score_kinds import kind_table

    score = _together(scores)
    document = score.to_json() | {"kinds": kind_table(score.outcomes).to_dict("records")}
    if len(scores) > 1:
        document["by_seed"] = {str(seed): one.to_json()["rows"] for seed, one in scores.items()}
    return document


def _together(scores: Mapping[int, "BenchmarkScore"]) -> "BenchmarkScore":
    from tests.benchmarks.blind.score import score_outcomes

    return score_outcomes([outcome for score in scores.values() for outcome in score.outcomes])


@app.command("months", short_help="The same joint later.")
def months_benchmark(
    count: Annotated[
        int, typer.Option(min=0, help="Number of joints. 10 joints hold one of each kind of change.")
    ] = 20,
    histories: Annotated[int, typer.Option(min=0, help="Number of other joints, with a history of sessions.")] = 0,
    out: Out = None,
    seed: Seeds = None,
    jobs: Jobs = ALL_CORES,
    as_json: AsJson = False,
) -> None:
    """Compare simulated joints with their models after wear, backlash, a slip, a payload, new grease, or nothing.

    Joints with a history are recorded in six sessions each, for their trends.
    """
    from tests.benchmarks.histories import history_rows, told_histories
    from tests.benchmarks.months import month_rows, months

    told = by_seed(
        "bench months",
        seed,
        out,
        jobs,
        lambda folder, number, pool, report: (
            months(number, count, folder, pool, report),
            told_histories(number, histories, folder, pool, report),
        ),
        quiet=as_json,
    )
    rows = month_rows([each for found, _ in told.values() for each in found]) if count else []
    trends = [each for _, found in told.values() for each in found]
    rows += history_rows(trends) if trends else []
    if as_json:
        cases = [asdict(each) | {"seed": number} for number, (found, _) in told.items() for each in found]
        drifts = [asdict(each) | {"seed": number} for number, (_, found) in told.items() for each in found]
        print(json.dumps(json_value(rows_json("months", rows) | {"cases": cases, "trends": drifts})))
        return
    print_rows("", rows, as_json=False)


@app.command("monitor", short_help="Alarms of the model monitor.")
def monitor_benchmark(
    joints: Annotated[int, typer.Option(min=2, help="Number of joints.")] = 40,
    hours: Annotated[float, typer.Option(min=0.01, help="Joint-hours without a change.")] = 10.0,
    loop_hours: Annotated[
        float, typer.Option(min=0.01, help="Joint-hours without a change of each simulated robot.")
    ] = 1.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of joints, motions and noise.")] = 0,
    as_json: AsJson = False,
) -> None:
    """Measure false alarms, delays and the cost of a tick of ModelMonitor at 1 kHz, on joints with noisy signals.

    Then the same in the torque loops of a leg and of an arm, whose plants, drives and sensors are simulated.
    """
    from tests.benchmarks.monitor_hours import monitor_rows
    from tests.benchmarks.monitored_loops import loop_rows

    with progress_bar("bench monitor", quiet=as_json) as progress:
        rows = [*monitor_rows(joints, hours, seed, progress), *loop_rows(loop_hours, seed, progress)]
    print_rows("monitor", rows, as_json=as_json)


@app.command("real-time", short_help="Deadlines of a real-time controller.")
def real_time(
    seconds: Annotated[
        float, typer.Option(min=1.0, max=3600.0, help="Length of a round [s]; 600 for ten minutes.")
    ] = 10.0,
    rounds: Annotated[int, typer.Option(min=1, help="Rounds; the best one is printed.")] = 3,
    as_json: AsJson = False,
    seed: UnusedSeed = 0,
) -> None:
    """A controller at 1 kHz against the simulated leg in another process: missed deadlines and jitter."""
    from tests.benchmarks.real_time import real_time_rows

    with progress_bar("bench real-time", quiet=as_json) as progress:
        table = real_time_rows(seconds, rounds, progress)
    print_rows("real-time", table, as_json=as_json)


@app.command("check", short_help="What a check predicts.")
def check(
    kind: Annotated[list[str] | None, typer.Option(help="Effect, such as stribeck; repeat. Default: all.")] = None,
    strength: Annotated[
        list[float] | None,
        typer.Option(min=1e-6, help="Strength of the effects, 1 for the middle one; repeat. Default: 0.04, 0.3 and 1."),
    ] = None,
    out: Out = None,
    seed: Seeds = None,
    jobs: Jobs = ALL_CORES,
    as_json: AsJson = False,
) -> None:
    """Count whether the diagnosis finds the effects that a check predicts to be visible, and no others."""
    from tests.benchmarks.evidence.predicted import STRENGTHS, prediction_rows, predictions

    strengths = tuple(dict.fromkeys(strength or STRENGTHS))
    found = by_seed(
        "bench check",
        seed,
        out,
        jobs,
        lambda folder, number, pool, report: predictions(folder, kind or (), number, pool, report, strengths),
        quiet=as_json,
    )
    every = [each for part in found.values() for each in part]
    rows = prediction_rows(every)
    if as_json:
        print(json.dumps(rows_json("check", rows) | {"rigs": [asdict(each) for each in every]}))
        return
    print_rows("", rows, as_json=False)
    for each in every:
        if (each.predicted == "seen") != each.found and each.predicted != "between":
            named = ", ".join(each.named) or "nothing"
            print(f"{each.name}: {each.size:.3g}, found from {each.smallest:.3g}; named: {named}")


@app.command("experiments", short_help="Designed experiments.")
def experiments(
    seed: Annotated[int, typer.Option(help="Seed of the joints, motions and noise.")] = 1,
    pair: Annotated[list[int] | None, typer.Option(help="Number of a pair, from 0; repeat. Default: all.")] = None,
    size: Annotated[
        float, typer.Option(min=0.01, help="Factor by which the sizes of all effects are multiplied.")
    ] = 1.0,
    loads: Annotated[
        bool, typer.Option("--loads", help="Pairs that motions hardly separate, designed with known loads as well.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Count how often a designed experiment, and how often a sinusoid, separates two effects that logs left open."""
    from tests.benchmarks.evidence.load_loop import load_rows, run_load_cases
    from tests.benchmarks.evidence.loop import decided_rows, run_cases
    from tests.benchmarks.evidence.pairs import LOAD_PAIRS, PAIRS

    known = LOAD_PAIRS if loads else PAIRS
    pairs = [known[i].scaled(size) for i in (pair or range(len(known)))]
    with progress_bar("bench experiments", quiet=as_json) as progress:
        if loads:
            with_loads = run_load_cases(pairs, seed, progress)
            rows, cases = load_rows(with_loads), [asdict(case) for case in with_loads]
            lines = [_load_line(case) for case in with_loads]
        else:
            without = run_cases(pairs, seed, progress)
            rows, cases, lines = decided_rows(without), [asdict(case) for case in without], list(map(_line, without))
    if as_json:
        print(json.dumps(rows_json("experiments", rows) | {"cases": cases}))
        return
    print_rows("", rows, as_json=False)
    print("\n".join(lines))


def _line(case: "LoopCase") -> str:
    words = case.refusal or (
        f"after the designed run: {case.designed} (predicted probability {case.predicted:.2f}); "
        f"after the sinusoid: {case.default}"
    )
    return f"{case.truth} against {case.other}: after the first logs: {case.first}; {words}"


def _load_line(case: "LoadCase") -> str:
    without = f"{case.unloaded} (predicted probability {case.predicted_unloaded:.2f})"
    loaded = f"{case.loaded} (predicted probability {case.predicted:.2f})"
    return (
        f"{case.truth} against {case.other}: after the first logs: {case.first}; "
        f"without loads: {case.refusal or without}; with loads: {case.loads_refusal or loaded}"
    )


@app.command("design-arm", short_help="Designed motion of an arm.")
def design_arm(
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
    from tests.benchmarks.blind_arm.arms import REFERENCE, arm_named
    from tests.benchmarks.evidence.arm_intervals import KINDS, arm_comparison, comparison_rows
    from tests.benchmarks.evidence.arm_runs import MOTIONS

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


@app.command("robot", short_help="Diagnosis of a simulated leg.")
def robot(
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
    from tests.benchmarks.robot_rigs import robot_benchmark, summary_rows

    scores = by_seed(
        "bench robot",
        seed,
        out,
        jobs,
        lambda folder, number, pool, report: robot_benchmark(folder, range(cases), number, pool, report, tolerances),
        quiet=as_json,
    )
    _print_by_seed("robot", scores, summary_rows, lambda score: score, as_json=as_json)


@app.command("arms", short_help="Diagnosis of simulated arms.")
def arms(
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
    from tests.benchmarks.arm_rigs import arm_benchmark, arm_rows, known_arm_benchmark

    benchmark = known_arm_benchmark if known_links else arm_benchmark
    scores = by_seed(
        "bench arms",
        seed,
        out,
        jobs,
        lambda folder, number, pool, report: benchmark(folder, range(cases), number, pool, report),
        quiet=as_json,
    )
    name = "arms with known links" if known_links else "arms"
    _print_by_seed(name, scores, arm_rows, lambda score: score.robot, as_json=as_json)


def _print_by_seed(
    name: str,
    scores: Mapping[int, Sequence[Score]],
    rows_of: Callable[[Sequence[Score]], list[BenchmarkRow]],
    robot_of: Callable[[Score], "RobotScore"],
    *,
    as_json: bool,
) -> None:
    """Print the figures of all seeds together and of each, and the cases whose answer is not exact."""
    everything = [score for group in scores.values() for score in group]
    missed = [
        {"seed": number, "name": s.name, "named": list(s.named), "failure": s.failure}
        for number, group in scores.items()
        for s in map(robot_of, group)
        if not s.exact
    ]
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
        named: Any = miss["named"]
        reason = miss["failure"] or f"named {', '.join(named) or 'nothing'}"
        console.print(f"seed {miss['seed']}, {miss['name']}: {reason}", soft_wrap=True)


def _close_loop(progress: Report) -> list[BenchmarkRow]:
    from drake_tc.cli.demo import record_demo
    from tests.benchmarks.close_loop_speed import SpeedCase, cost_rows, write_runs

    with tempfile.TemporaryDirectory() as scratch:
        folders = [Path(scratch) / name for name in ("short", "long", "demo")]
        progress("recording", 0.0)
        for folder in folders:
            folder.mkdir()
        short, long = write_runs(folders[0], 30.0), write_runs(folders[1], 334.0)
        rig, logs, holdout = record_demo(folders[2], 0)
        demo = SpeedCase("90 000 samples of the demo's bench, two effects", rig, tuple(logs), tuple(holdout))
        rows = []
        for number, case in enumerate((short, demo, long)):
            progress(case.name, 0.2 + 0.25 * number)
            rows += cost_rows([case])
    return rows


def _long_bag(progress: Report) -> list[BenchmarkRow]:
    from tests.benchmarks.close_loop_speed import cost_rows
    from tests.benchmarks.long_bag import write_bag

    with tempfile.TemporaryDirectory() as scratch:
        progress("recording", 0.0)
        case = write_bag(Path(scratch), 600.0, 60.0)
        progress(case.name, 0.2)
        return cost_rows([case])


def _leg(progress: Report) -> list[BenchmarkRow]:
    from tests.benchmarks.leg_timing import leg_timings

    return leg_timings(progress)


def _sweep(progress: Report) -> list[BenchmarkRow]:
    from tests.benchmarks.sweep_speed import sweep_rows

    return sweep_rows(progress)


_simple(
    "close-loop",
    "Time and memory of close-loop.",
    "Measure time and memory of `drake-tc close-loop` for one joint with 90 000 and with 10^6 samples.",
    _close_loop,
)
_simple(
    "long-bag",
    "Time and memory of close-loop on a bag of ten minutes.",
    "Measure time and memory of `drake-tc close-loop` on a bag of ten minutes at 1 kHz with stamps that scatter.",
    _long_bag,
)
_simple(
    "leg",
    "Time of a leg's tick.",
    "Time a tick of the leg's loops with all stages on, and the torque estimate of a leg and of a humanoid.",
    _leg,
)
_simple(
    "sweep",
    "Speed of parameter sweeps.",
    "Time sweeps: the speed-up of two processes over one, and a stability map of 10^4 loops.",
    _sweep,
)


@app.command("tick", short_help="Time of a whole-body tick.")
def tick(
    scenario_name: Annotated[str, typer.Option(help="Motion along which ticks are timed.")] = "com_move",
    scenario_file: Annotated[Path | None, typer.Option(help="Scenario file (YAML) of your own.")] = None,
    duration: Annotated[float, typer.Option(help="Simulated seconds.")] = 2.0,
    as_json: AsJson = False,
    seed: UnusedSeed = 0,
) -> None:
    """Time a tick of robust TSID by robustness measure and stage, and the whole diagram."""
    from drake_tc.registry import tsid_entry
    from tests.benchmarks.tsid_timing import tick_timings

    scenario = tsid_entry().scenario(scenario_name, scenario_file).changed(duration=duration)
    with progress_bar("bench tick", quiet=as_json) as progress:
        rows = tick_timings(scenario, progress)
    print_rows("tick", rows, as_json=as_json)


@app.command("floor", short_help="Contact approximations.")
def floor(
    duration: Annotated[float, typer.Option(min=0.1, help="Simulated seconds of the diagram that is timed.")] = 2.0,
    as_json: AsJson = False,
    seed: UnusedSeed = 0,
) -> None:
    """Compare contact approximations: a foot that stands, slides and rocks, a leaning robot, and the time of a tick."""
    from drake_tc.registry import tsid_entry
    from tests.benchmarks.floor_contact import floor_rows

    moved = tsid_entry().scenario("com_move").changed(duration=duration)
    reaching = tsid_entry().scenario("far_reach")
    with progress_bar("bench floor", quiet=as_json) as progress:
        rows = floor_rows(moved, reaching, progress)
    print_rows("floor", rows, as_json=as_json)


@app.command("qp", short_help="Solvers of quadratic programs.")
def qp(
    solver: Annotated[
        list[str] | None, typer.Option(help="A solver to time; may be repeated. Default: all installed ones.")
    ] = None,
    controller: Annotated[Path | None, typer.Option(help="Controller file; the humanoid's by default.")] = None,
    ticks: Annotated[int, typer.Option(min=20, help="Number of problems of each motion.")] = 400,
    as_json: AsJson = False,
    seed: UnusedSeed = 0,
) -> None:
    """Solve quadratic programs along robot motions by each solver: time of cold and warm starts, and accuracy."""
    from drake_tc.tsid.configuration import load_law
    from tests.benchmarks.qp import humanoid_controller, qp_rows
    from tests.benchmarks.qp_solvers import unavailable

    missing = {} if solver else {name: why for name in SOLVERS if (why := unavailable(name)) is not None}
    for why in missing.values():
        print(f"{PROGRAM}: not timed: {why}", file=sys.stderr)
    names = solver or [name for name in SOLVERS if name not in missing]
    law = load_law(controller or humanoid_controller())
    with progress_bar("bench qp", quiet=as_json) as progress:
        rows = qp_rows(law, names, progress, ticks)
    if as_json:
        print(json.dumps(rows_json("qp", rows)))
        return
    table = Table(box=None, padding=(0, 2))
    for heading in ("solver", "motion", "start"):
        table.add_column(heading, no_wrap=True)
    for heading in ("median us", "99 % us", "not solved", "residual", "problems"):
        table.add_column(heading, justify="right", no_wrap=True)
    for timing, unsolved, worst in zip(rows[::3], rows[1::3], rows[2::3], strict=True):
        cells = f"{timing.value:.0f}", f"{timing.highest:.0f}", f"{unsolved.value:.0f}", f"{worst.value:.1e}"
        table.add_row(*timing.name.split(", "), *cells, str(timing.n))
    Console(file=sys.stdout, highlight=False).print(table)


@app.command("real-logs", short_help="close-loop on public logs.")
def real_logs(
    data: Annotated[Path, typer.Option(help="Folder that holds the public data sets.")],
    name: Annotated[
        list[str] | None, typer.Option("--set", help="A data set, or SET/CASE; repeat for more. Default: all.")
    ] = None,
    as_json: AsJson = False,
    seed: UnusedSeed = 0,
) -> None:
    """Run close-loop on public logs with the committed rig files, and check what it claims on each held-out run."""
    from tests.benchmarks.real_log_table import claims_document, print_case, print_summary
    from tests.benchmarks.real_logs import real_log_claims

    with progress_bar("bench real-logs", quiet=as_json) as progress:
        sets = real_log_claims(data, name or (), progress, (lambda case: None) if as_json else print_case)
    if as_json:
        print(json.dumps(claims_document(sets)))
    else:
        print_summary(sets)


@app.command("real-robots", short_help="Public logs: fitted links.")
def real_robots(data: Data, name: Sets = None, as_json: AsJson = False, seed: UnusedSeed = 0) -> None:
    """Compare close-loop with fitted links with plain least squares: held-out errors by joint, and a known payload."""
    from tests.benchmarks.real_robots import rows

    with progress_bar("bench real-robots", quiet=as_json) as progress:
        table = rows(data, name or (), progress)
    print_rows("real-robots", table, as_json=as_json)


def _real_bam(data: Path, progress: Report) -> list[BenchmarkRow]:
    from drake_tc.analysis.sweep import processes
    from drake_tc.loops.joint_bench import rig_free_run
    from tests.benchmarks.real_bam import real_bam_rows

    with processes(os.cpu_count() or 1) as pool:
        return real_bam_rows(data, rig_free_run, progress, pool)


def _real_dfki(data: Path, progress: Report) -> list[BenchmarkRow]:
    from tests.benchmarks.real_dfki import rows

    return rows(data)


def _real_tmotor(data: Path, progress: Report) -> list[BenchmarkRow]:
    from tests.benchmarks.real_tmotor import rows

    return rows(data)


def _real_uart(data: Path, progress: Report) -> list[BenchmarkRow]:
    from tests.benchmarks.real_uart import rows

    return rows(data)


def _real_icub(data: Path, progress: Report) -> list[BenchmarkRow]:
    from tests.benchmarks.real_icub import rows

    return rows(data, progress)


def _real_sessions(data: Path, progress: Report) -> list[BenchmarkRow]:
    from tests.benchmarks.real_sessions import session_rows

    return session_rows(data, progress)


_public(
    "real-sessions",
    "compare on public logs.",
    "Compare public recordings of one joint in several sessions; what changed between them is not known.",
    _real_sessions,
)
_public(
    "real-bam",
    "Public logs: XL330 pendulum.",
    "XL330 pendulum: print the position error of free runs on held-out trajectories, at every gain.",
    _real_bam,
)
_public(
    "real-dfki",
    "Public logs: AK80-6 pendulum.",
    "AK80-6 simple pendulum: print the torque residual on held-out runs.",
    _real_dfki,
)
_public(
    "real-tmotor",
    "Public logs: AK80-9 on a bench.",
    "AK80-9 with a torque sensor: print the torque error on held-out logs beside that of the published model.",
    _real_tmotor,
)
_public(
    "real-uart",
    "Public logs: backlash stand.",
    "Feetech servos on a backlash stand: separate backlash from dead zone, and compare with the published values.",
    _real_uart,
)
_public(
    "real-icub",
    "Public logs: walking humanoid.",
    "Walking humanoid: compare the base estimate with motion capture and with the published leg odometry.",
    _real_icub,
)


@app.command("gate", short_help="All goals of the diagnosis.")
def gate(
    part: Annotated[
        list[str] | None,
        typer.Option(help="blind, hard, coverage, real, arms, leg or time; may be repeated. Default: all."),
    ] = None,
    size: Annotated[str, typer.Option(help="small (a few minutes) or full (hours; what the gate demands).")] = "small",
    seed: Annotated[int, typer.Option(min=0, help="Seed of the rigs.")] = 1,
    data: Annotated[Path | None, typer.Option(help="Folder of public data sets. Default: ../shared/data.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder that keeps the rigs, for further runs.")] = None,
    store: Annotated[Path | None, typer.Option(help="File to which the results are added.")] = None,
    jobs: Jobs = ALL_CORES,
    as_json: AsJson = False,
) -> None:
    """Score the diagnosis on everything that it has to reach.

    The results are shown beside the stored ones, where these are of the same size and seed.
    """
    from drake_tc.analysis.sweep import processes
    from drake_tc.cli.terminal import print_wide
    from tests.benchmarks import gate as gates
    from tests.benchmarks.gate_parts import SIZES, GateRuns

    if size not in SIZES:
        raise typer.BadParameter(f"expected small or full, got {size!r}", param_hint="--size")
    names, results, stored = gates.chosen_parts(part or ()), {}, gates.load_results(gates.STORED)
    with (
        tempfile.TemporaryDirectory() as scratch,
        progress_bar("gate", quiet=as_json) as progress,
        processes(jobs) as pool,
    ):
        runs = GateRuns(size, seed, out or Path(scratch), data or gates.DATA, pool, progress)
        for name in names:
            progress(name, 0.0)
            results[name] = gates.run_part(name, runs)
            if store:
                gates.store_results(store, {name: results[name]})
    if as_json:
        rows = [row | {"name": f"{name}/{row['name']}"} for name, one in results.items() for row in one["rows"]]
        print(json.dumps({"name": "gate", "rows": rows, "parts": results}))
        return
    print_wide(("figure", "reach", "now", "met", "stored", "met"), gates.table(results, stored), left=("figure",))
    for name, one in results.items():
        for row in one["rows"]:
            if row.get("note") and row.get("met") is not True:
                print(f"{name}: {row['name']}: {row['note']}")


if __name__ == "__main__":
    restart_tuned(sys.argv[1:], simulates=True)
    leave(run(sys.argv[1:]))
