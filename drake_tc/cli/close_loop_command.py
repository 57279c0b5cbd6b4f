"""`drake-tc close-loop`: residual, missing effect, better model, error before and after."""

import json
import math
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from drake_tc.analysis.executors import processes
from drake_tc.cli.out_files import Force, result_folder
from drake_tc.cli.progress import progress_bar
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.estimates import Estimate
from drake_tc.diagnosis.result.closed_loop import JointClosedLoop
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.diagnosis.result.to_json import result_json
from drake_tc.diagnosis.run import close_loop
from drake_tc.errors import LogError
from drake_tc.report.links_section import links_sentence, payload_sentences
from drake_tc.report.refinement_section import refinement_sentence
from drake_tc.report.words import REASONS, VERDICTS, capital, ranked_effects, unexplained, warnings

FILES = (
    "report.html",
    "report.json",
    "model_before.yaml",
    "model_after.yaml",
    "model_refined.yaml",
    "torque_uncertainty.yaml",
)
"""What the command writes; the refined model only where refining made free runs better."""


def close_loop_command(
    rig: Annotated[Path | None, typer.Option(help="Rig file (YAML): joint, drive, what is declared.")] = None,
    log: Annotated[list[Path] | None, typer.Option(help="A run to fit; repeat for more.")] = None,
    holdout: Annotated[list[Path] | None, typer.Option(help="A run that takes no part in fitting; repeat.")] = None,
    out: Annotated[Path, typer.Option(help="Folder for report.html, report.json and both models.")] = Path("out"),
    seed: Annotated[int, typer.Option(help="Seed of the resampling (and of the demo's rig).")] = 0,
    closed_loop: Annotated[
        bool,
        typer.Option(
            "--closed-loop/--no-closed-loop",
            help="Simulate the torque loop before and after (an upper bound: the plant is the model after).",
        ),
    ] = True,
    force: Force = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print report.json to stdout instead of the tables.")] = False,
) -> None:
    """Find what a joint's model lacks, add it, and report the error before and after.

    Without --rig, a demo: a simulated bench whose model lacks something is recorded first.
    """
    if rig is None and (log or holdout):
        raise LogError("--log and --holdout need --rig RIG.yaml, which says what the logs show")
    if rig is not None and not (log and holdout):
        raise LogError(
            "expected at least one --log RUN to fit and one --holdout RUN to judge by; got "
            f"{len(log or [])} and {len(holdout or [])}"
        )
    from drake_tc.diagrams.before_after.comparison import compare_loops
    from drake_tc.diagrams.bench.rig_free_run import rig_free_run

    read = [rig, *(log or []), *(holdout or [])]
    with (
        result_folder(out, "--out", names=FILES, inputs=read, force=force, error=LogError) as folder,
        progress_bar("close-loop", quiet=as_json) as progress,
        processes(2) as pool,
    ):
        if rig is None:
            rig, log, holdout = _demo(out / "demo_logs", seed, force, progress)
        options = replace(DiagnosisOptions(), seed=seed)
        result = close_loop(rig, log or [], holdout or [], options, rig_free_run, progress, pool)
        if closed_loop:
            found = compare_loops(result, seed, progress, pool)
            result = replace(result, closed_loop=found, seconds=result.seconds + found.seconds)
        progress("writing the report", 0.95)
        result = write_results(result, folder)
    if as_json:
        print(json.dumps(result_json(result), indent=1))
    else:
        print_summary(result, out)


def _demo(
    folder: Path, seed: int, force: bool, progress: Callable[[str, float], None]
) -> tuple[Path, list[Path], list[Path]]:
    """Rig file, runs to fit and runs to judge by of a simulated bench, recorded into `folder`."""
    from drake_tc.cli.demo import record_demo

    progress("recording a demo bench", 0.0)
    with result_folder(folder, "--out", force=force, error=LogError) as place:
        rig, log, holdout = record_demo(place, seed)
    return folder / rig.name, [folder / path.name for path in log], [folder / path.name for path in holdout]


def write_results(result: CloseLoopResult, out: Path) -> CloseLoopResult:
    """report.html, report.json, model_before.yaml, model_after.yaml and torque_uncertainty.yaml in `out`.

    And model_refined.yaml, where the refinement on free runs was accepted.
    """
    from drake_tc.control.torque_uncertainty_file import save_torque_uncertainty
    from drake_tc.diagnosis.result.models import models_of
    from drake_tc.diagnosis.result.torque_uncertainty import torque_uncertainty
    from drake_tc.report.html import write_report

    out.mkdir(parents=True, exist_ok=True)
    before, after = models_of(result, out)
    uncertainty = torque_uncertainty(result)
    save_torque_uncertainty(uncertainty, out / "torque_uncertainty.yaml")
    result = replace(result, model_before_yaml=before, model_after_yaml=after, uncertainty=uncertainty)
    (out / "report.json").write_text(json.dumps(result_json(result), indent=1) + "\n", encoding="utf-8")
    write_report(result, out / "report.html")
    return result


def print_summary(result: CloseLoopResult, out: Path) -> None:
    """Verdict and one table a joint on stdout."""
    console = Console(file=sys.stdout, highlight=False)
    ranking = ranked_effects(result)
    if len(ranking) > 1 and result.shared:
        listed = "; ".join(f"{name} of {where} ({100 * gain:.0f} %)" for name, where, gain in ranking)
        console.print(f"Found, by the held-out gain of all joints: {listed}")
    for cause in result.shared:
        values = ", ".join(f"{n} {p.value:.4g} {p.unit}" for n, p in cause.parameters.items())
        gain = f"held-out gain of all joints {100 * cause.heldout_gain:.0f} %"
        console.print(f"[bold]all joints[/bold]: + [bold]{cause.id}[/bold] of {cause.where}  {values}  ({gain})")
        for other, where in cause.indistinguishable:
            console.print(f"  ? {other} of {where} cannot be told apart from it by these logs")
    if result.links is not None:
        console.print(escape(links_sentence(result.links)))
        for sentence in payload_sentences(result.links):
            console.print(escape(sentence))
    for joint in result.joints.values():
        console.print(f"[bold]{joint.joint}[/bold]: {VERDICTS[joint.verdict]}")
        console.print(_errors_table(joint))
        if joint.verdict.startswith("unexplained"):
            console.print(f"  {escape(capital(unexplained(joint)))}")
        if joint.load is not None:
            title, load = joint.load
            console.print(f"  {title}: {', '.join(_with_interval(n, p) for n, p in load.items())}")
        for note in joint.load_notes:
            console.print(f"  ! {escape(note)}")
        if joint.refinement is not None:
            console.print(f"  {escape(refinement_sentence(joint.refinement))}")
        for effect in joint.effects:
            values = ", ".join(f"{n} {p.value:.4g} {p.unit}" for n, p in effect.parameters.items())
            console.print(f"  + [bold]{effect.id}[/bold]  {values}  (held-out gain {100 * effect.heldout_gain:.0f} %)")
        for withdrawn in joint.did_not_hold:
            console.print(f"  - {withdrawn.id} did not hold ({REASONS[withdrawn.reason]}): {escape(withdrawn.why)}")
        for moving in (p for p in joint.consistency if p.moves):
            where = "drive" if moving.effect == "drive" else moving.effect
            console.print(f"  * {where} {moving.name} differs by {moving.by}: {100 * moving.change:.0f} %")
        for warning in warnings(joint):
            console.print(f"  ! {escape(warning)}")
        if joint.next_experiment:
            console.print(f"  next: {joint.next_experiment}")
        loop = None if result.closed_loop is None else result.closed_loop.joints.get(joint.joint)
        if loop is not None and loop.changed:
            console.print(f"  closed loop, upper bound (its plant is the model after): {_tracking(loop)}")
    if result.closed_loop is not None:
        for note in result.closed_loop.notes:
            console.print(f"closed loop: {escape(note)}")
    if result.hints:
        console.print(f"rig file: {escape(' '.join(result.hints))}")
    console.print(f"{result.seconds:.1f} s; report: {out / 'report.html'}")


def _with_interval(name: str, estimate: Estimate) -> str:
    """A parameter with its 95 % interval; without one where the fit does not move it."""
    low, high = estimate.ci95
    interval = escape(f" [{low:.4g}, {high:.4g}]") if high > low else ""
    return f"{name.replace('_', ' ')} {estimate.value:.4g}{interval} {estimate.unit}"


def _tracking(loop: JointClosedLoop) -> str:
    """Tracking errors before and after, or that there are none."""
    figures = [1e3 * each.rms_error for each in (loop.before, loop.after)]
    if not all(math.isfinite(value) for value in figures):
        return "no tracking error; the report has the margins of the linear loop"
    return f"tracking error {figures[0]:.3g} mrad before, {figures[1]:.3g} mrad after"


def _errors_table(joint: JointResult) -> Table:
    table = Table(box=None, padding=(0, 2))
    for header in ("", "train", "held-out", escape("free run [rad]")):
        table.add_column(header, justify="left" if not header else "right")
    for name, errors in (("before", joint.before), ("after", joint.after)):
        free = "-" if errors.free_run_heldout is None else f"{errors.free_run_heldout:.3g}"
        table.add_row(name, f"{errors.train:.3g} {joint.unit}", f"{errors.heldout:.3g} {joint.unit}", free)
    refined = joint.refinement
    if refined is not None and refined.accepted:
        figures = [(refined.error_train, joint.unit), (refined.error_heldout, joint.unit)]
        cells = ["-" if value is None else f"{value:.3g} {unit}" for value, unit in figures]
        free = "-" if refined.free_run_heldout is None else f"{refined.free_run_heldout:.3g}"
        table.add_row("refined", *cells, free)
    table.add_row("noise floor", "", f"{joint.noise_floor:.3g} {joint.unit}", "")
    return table
