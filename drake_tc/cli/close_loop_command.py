"""`drake-tc close-loop`: residual, missing effect, better model, error before and after; `drake-tc demo`."""

import json
import sys
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from drake_tc.cli.options import LARGEST_SEED, Declared, Force
from drake_tc.cli.out_files import result_folder
from drake_tc.cli.terminal import print_wide, progress_bar, tell_declared
from drake_tc.errors import LogError

if TYPE_CHECKING:
    from rich.console import Console

    from drake_tc.diagnosis.result.rig_result import CloseLoopResult

FILES = (
    "report.html",
    "report.json",
    "model_before.yaml",
    "model_after.yaml",
    "model_refined.yaml",
    "torque_uncertainty.yaml",
    "check.html",
    "check.json",
    "residuals.mcap",
)
"""What the command writes; the refined model only where refining made free runs better, others with their options."""
LOADED_BY_WORKERS = (
    "drake_tc.loops.joint_bench",
    "drake_tc.identification.output_error",
    "drake_tc.diagnosis.diagnose",
    "drake_tc.diagnosis.residual.structure",
    "sklearn.ensemble",
    "drake_tc.report.plots.residual_plots",
    "drake_tc.analysis.before_after.comparison",
)
"""What the worker processes need; loaded beside the imports, the reading and the search of this process."""


class ExportTarget(StrEnum):
    """Simulators in which an export can be tried."""

    mjcf = "mjcf"
    urdf = "urdf"
    drake_urdf = "drake-urdf"
    sdf = "sdf"
    bam = "bam"


@dataclass(frozen=True)
class _Files:
    """What the command reads."""

    rig: Path
    log: list[Path]
    holdout: list[Path]
    declared: Path | None = None


@dataclass(frozen=True, kw_only=True)
class RigFiles:
    """A rig file and its logs, or nothing for the demo's."""

    rig: Annotated[
        Path | None,
        typer.Option(help="Rig file (YAML): joints, drives, columns, and what your model already contains."),
    ] = None
    log: Annotated[list[Path] | None, typer.Option(help="A run to fit; repeat for more.")] = None
    holdout: Annotated[list[Path] | None, typer.Option(help="A run that only tests the result; repeat for more.")] = (
        None
    )
    declared: Declared = None

    def given(self) -> _Files | None:
        """The files; None where there is no rig.

        Raises:
            LogError: one of them is missing.
        """
        log, holdout = self.log or [], self.holdout or []
        if self.rig is None and (log or holdout):
            raise LogError(
                "expected --rig RIG.yaml with --log and --holdout, got none; it says what the columns of the logs are"
            )
        if self.rig is not None and not (log and holdout):
            raise LogError(
                "expected at least one --log RUN to fit and one --holdout RUN to test, got "
                f"{len(log)} and {len(holdout)}; of a single recording, give each half as a file of its own"
            )
        if self.declared is not None and self.rig is None:
            raise LogError(
                "expected --rig RIG.yaml with --declared, got none; it says what the columns of the logs are"
            )
        return None if self.rig is None else _Files(self.rig, log, holdout, self.declared)


@dataclass(frozen=True, kw_only=True)
class CloseLoopOptions:
    """Options of `drake-tc close-loop`."""

    files: RigFiles = RigFiles()
    out: Annotated[Path, typer.Option(help="Folder for report.html, report.json and the models.")] = Path("out")
    seed: Annotated[
        int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of what is drawn at random, and of the demo's rig.")
    ] = 0
    closed_loop: Annotated[
        bool,
        typer.Option(
            "--closed-loop/--no-closed-loop",
            help="Simulate torque control with both models. The plant is the model after, so the improvement is an"
            " upper bound.",
        ),
    ] = True
    check: Annotated[
        bool, typer.Option("--check/--no-check", help="Also write a check of the logs: check.html, check.json.")
    ] = False
    mcap: Annotated[
        bool,
        typer.Option(
            "--mcap",
            help="Also write residuals.mcap: measured and modelled effort and position over time, for Foxglove, Rerun"
            " or PlotJuggler.",
        ),
    ] = False
    try_export: Annotated[
        ExportTarget | None,
        typer.Option(
            help="Also run the model's export to this simulator on the held-out runs: in MuJoCo (mjcf), Drake"
            " (drake-urdf, urdf, sdf) or by BAM's equations (bam). The report compares its error with that of the model"
            " and of the file of --declared, and says what is lost."
        ),
    ] = None
    force: Force = False
    as_json: Annotated[bool, typer.Option("--json", help="Print report.json to stdout instead of the tables.")] = False


def close_loop_command(options: CloseLoopOptions) -> None:
    """Find what a joint's model lacks, add it, and report the error before and after.

    Without --rig it does what `drake-tc demo` does: a bench whose model lacks two effects is simulated and diagnosed.
    """
    from drake_tc.analysis.sweep import processes

    given, out, seed, to = options.files.given(), options.out, options.seed, options.try_export
    if given is not None:
        tell_declared("close-loop", given.rig, given.declared)
    read = [] if given is None else [given.rig, given.declared, *given.log, *given.holdout]
    with (
        result_folder(out, "--out", names=FILES, inputs=read, force=options.force) as folder,
        progress_bar("close-loop", quiet=options.as_json) as progress,
        processes(2, preload=LOADED_BY_WORKERS) as pool,
    ):
        from drake_tc.analysis.before_after.comparison import compare_loops
        from drake_tc.diagnosis.options import DiagnosisOptions
        from drake_tc.diagnosis.run import close_loop
        from drake_tc.loops.joint_bench import rig_free_run
        from drake_tc.report.data_files import FILE, require_rosbags, result_json, save_residuals

        files = _demo(out / "demo_logs", seed, options.force, progress) if given is None else given
        if to is not None:
            _require_runner(files.rig, to)
        if options.mcap:
            require_rosbags()
        if options.check:
            from drake_tc.cli.log_commands import write_check
            from drake_tc.experiments.check.run import check_rig

            write_check(check_rig(files.rig, files.log, progress, files.declared), folder)
        result = close_loop(
            files.rig,
            files.log,
            files.holdout,
            DiagnosisOptions(seed=seed),
            rig_free_run,
            progress,
            pool,
            files.declared,
        )
        if options.closed_loop and not result.has_wrong_set_up:
            found = compare_loops(result, seed, progress, pool)
            result = replace(result, closed_loop=found, seconds=result.seconds + found.seconds)
        if to is not None:
            progress(f"running the export to {to.value}", 0.0)
            result = _with_export(result, to, files)
        progress("writing the report", 0.95)
        result = write_results(result, folder, pool, out)
        if options.mcap:
            save_residuals(result, folder / FILE)
    if options.as_json:
        print(json.dumps(result_json(result), indent=1))
    else:
        print_summary(result, out)


def print_summary(result: "CloseLoopResult", out: Path) -> None:
    """Verdict, one table a joint, the trial of an export, and where the report is, on stdout."""
    from rich.console import Console

    from drake_tc.report.summary import say_result

    console = Console(file=sys.stdout, highlight=False)
    say_result(console, result)
    _print_export(console, result)
    console.print(f"{result.seconds:.1f} s; report: {out / 'report.html'}")


def _print_export(console: "Console", result: "CloseLoopResult") -> None:
    """Errors of the exported model beside those of the model, and what its simulator lacks."""
    from rich.markup import escape

    from drake_tc.report.sections import cells, headings
    from drake_tc.report.summary import say

    if result.export is None:
        return
    trial = result.export
    print_wide(
        headings(trial.rows, trial.runner),
        cells(trial.rows, {name: joint.units for name, joint in result.joints.items()}),
        left=("joint", "run"),
        title=f"RMS position error of free runs, {trial.model_file}",
    )
    for loss in trial.losses:
        say(console, f"  {escape(loss)}")


def demo_command(
    out: Annotated[Path, typer.Option(help="Folder for report.html, report.json, the models and the logs.")] = Path(
        "demo"
    ),
    seed: Annotated[
        int, typer.Option(min=0, max=LARGEST_SEED, help="Seed that picks the missing effects and the sensors' noise.")
    ] = 0,
    force: Force = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print report.json to stdout instead of the tables.")] = False,
) -> None:
    """Simulate a joint on a bench, and find what its model lacks.

    It records three logs of a simulated joint whose model lacks two effects, runs close-loop on them, and prints the
    path of the report in its last line. It needs no files, and takes less than a minute.
    """
    close_loop_command(CloseLoopOptions(out=out, seed=seed, force=force, as_json=as_json))
    if not as_json:
        print(out / "report.html")


def _require_runner(rig: Path, to: ExportTarget) -> None:
    """Refuse a trial that cannot run before the search, which takes longer.

    Raises:
        ParamsError: the simulator is not installed, or cannot run this rig.
    """
    from drake_tc.exchange.trial import require_runner
    from drake_tc.logs.rig import load_rig

    require_runner(to.value, load_rig(rig))


def _with_export(result: "CloseLoopResult", to: ExportTarget, files: _Files) -> "CloseLoopResult":
    """The result with the errors of the exported model, and of what the declared file had, on the held-out runs."""
    from drake_tc.diagnosis.result.models import simulation_models
    from drake_tc.exchange.trial import try_export
    from drake_tc.logs.prepare import load_runs
    from drake_tc.logs.rig import load_rig

    what = load_rig(files.rig, files.declared)
    runs = load_runs([*files.log, *files.holdout], what)
    file, models = simulation_models(result)
    parts = (runs[: len(files.log)], runs[len(files.log) :])
    return replace(result, export=try_export(models, file, to.value, what, parts, files.declared))


def _demo(folder: Path, seed: int, force: bool, progress: Callable[[str, float], None]) -> _Files:
    """Those of a simulated bench, recorded into `folder`."""
    from drake_tc.cli.demo import record_demo

    progress("recording a demo bench", 0.0)
    with result_folder(folder, "--out", force=force) as place:
        rig, log, holdout = record_demo(place, seed)
    return _Files(folder / rig.name, [folder / path.name for path in log], [folder / path.name for path in holdout])


def write_results(
    result: "CloseLoopResult", out: Path, executor: Executor | None = None, home: Path | None = None
) -> "CloseLoopResult":
    """report.html, report.json, model_before.yaml, model_after.yaml and torque_uncertainty.yaml in `out`.

    And model_refined.yaml, where the refinement on free runs was accepted. `executor` draws plots beside each other;
    `home` is the folder to which the results move, None: `out`.
    """
    from drake_tc.control.torque_uncertainty_file import save_torque_uncertainty
    from drake_tc.diagnosis.result.models import models_of
    from drake_tc.diagnosis.result.torque_uncertainty import torque_uncertainty
    from drake_tc.report.data_files import result_json
    from drake_tc.report.html import write_report

    out.mkdir(parents=True, exist_ok=True)
    before, after = models_of(result, out, home)
    uncertainty = torque_uncertainty(result)
    save_torque_uncertainty(uncertainty, out / "torque_uncertainty.yaml")
    result = replace(result, model_before_yaml=before, model_after_yaml=after, uncertainty=uncertainty)
    (out / "report.json").write_text(json.dumps(result_json(result), indent=1) + "\n", encoding="utf-8")
    write_report(result, out / "report.html", executor)
    return result
