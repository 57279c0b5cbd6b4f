"""What `drake-tc close-loop` prints: verdict, errors, effects and warnings of each joint."""

import math
import sys
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from drake_tc.cli.terminal import print_wide
from drake_tc.config.joint_units import JointUnits
from drake_tc.diagnosis.problem.estimates import Estimate
from drake_tc.diagnosis.result.closed_loop import JointClosedLoop
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.diagnosis.result.run_errors import mean_absolute_errors
from drake_tc.report.numbers import NOT_IDENTIFIED, pretty_unit
from drake_tc.report.sections import cells, headings, links_sentence, payload_sentences, refinement_sentence
from drake_tc.report.sentences.experiments import experiment_sentence
from drake_tc.report.sentences.notes import note_sentences, warnings
from drake_tc.report.sentences.set_up import set_up_sentences
from drake_tc.report.words import REASONS, capital, ranked_effects, unexplained, verdict_words

HANGING = 4
"""Columns by which the lines of a broken text are indented beyond its first."""


def print_summary(result: CloseLoopResult, out: Path) -> None:
    """Verdict and one table a joint on stdout."""
    console = Console(file=sys.stdout, highlight=False)
    for line in set_up_sentences(result.set_up):
        _say(console, f"[bold]set-up[/bold]: {escape(line)}")
    _print_robot(console, result)
    for joint in result.joints.values():
        _print_joint(console, joint)
        loop = None if result.closed_loop is None else result.closed_loop.joints.get(joint.joint)
        if loop is not None and loop.changed:
            simulated = " (simulated with the model after as plant, so an upper bound)" if loop.reference.size else ""
            _say(console, f"  closed loop{simulated}: {_tracking(loop, joint.units)}")
    if result.closed_loop is not None:
        for note in result.closed_loop.notes:
            _say(console, f"closed loop: {escape(note)}")
    _print_export(console, result)
    if result.hints:
        _say(console, f"rig file or log: {escape(' '.join(result.hints))}")
    console.print(f"{result.seconds:.1f} s; report: {out / 'report.html'}")


def _say(console: Console, markup: str) -> None:
    """Print one text; where it is broken, its further lines are indented."""
    text = Text.from_markup(markup)
    indent = len(text.plain) - len(text.plain.lstrip())
    body = text[indent:]
    lines = body.wrap(console, max(console.width - indent - HANGING, 20))
    for number, line in enumerate(lines):
        line.rstrip()
        console.print(Text(" " * (indent + HANGING * (number > 0))) + line)


def _print_robot(console: Console, result: CloseLoopResult) -> None:
    """What no single joint owns."""
    for note in note_sentences(result.notes):
        _say(console, f"[bold]all joints[/bold]: ! {escape(note)}")
    ranking = ranked_effects(result)
    if len(ranking) > 1 and result.shared:
        listed = "; ".join(f"{name} of {where} ({100 * gain:.0f} %)" for name, where, gain in ranking)
        _say(console, f"Found, by the held-out gain of all joints: {listed}")
    for cause in result.shared:
        values = ", ".join(_value(n, p) for n, p in cause.parameters.items())
        gain = f"held-out gain of all joints {100 * cause.heldout_gain:.0f} %"
        where = f"the encoder of {cause.where}" if cause.where in result.joints else cause.where
        _say(console, f"[bold]all joints[/bold]: + [bold]{cause.id}[/bold] of {where}  {values}  ({gain})")
        for other, where in cause.indistinguishable:
            _say(console, f"  ? these logs cannot distinguish it from {other} of {where}")
    if result.links is not None:
        _say(console, escape(links_sentence(result.links, wrong_set_up=result.has_wrong_set_up)))
        for sentence in () if result.has_wrong_set_up else payload_sentences(result.links):
            _say(console, escape(sentence))


def _print_joint(console: Console, joint: JointResult) -> None:
    console.print(f"[bold]{joint.joint}[/bold]: {verdict_words(joint)}")
    console.print(_errors_table(joint))
    if joint.verdict.startswith("unexplained") and not joint.set_up_wrong:
        _say(console, f"  {escape(capital(unexplained(joint)))}")
    if joint.load is not None:
        title, load = joint.load
        _say(console, f"  {title}: {', '.join(_with_interval(n, p) for n, p in load.items())}")
    for note in note_sentences(joint.load_notes, joint.units):
        _say(console, f"  ! {escape(note)}")
    if joint.refinement is not None:
        _say(console, f"  {escape(refinement_sentence(joint.refinement, joint.units))}")
    for effect in joint.effects:
        values = ", ".join(_value(n, p) for n, p in effect.parameters.items())
        gain = f"held-out gain {100 * effect.heldout_gain:.0f} %"
        _say(console, f"  + [bold]{effect.key}[/bold]  {values}  ({gain})")
    for withdrawn in joint.did_not_hold:
        _say(console, f"  - {withdrawn.key} did not hold: {REASONS[withdrawn.reason][1]}")
    for warning in warnings(joint):
        _say(console, f"  ! {escape(warning)}")
    if joint.next_experiment is not None:
        _say(console, f"  next: {escape(experiment_sentence(joint.next_experiment, joint.units))}")


def _value(name: str, estimate: Estimate) -> str:
    shown = f"{name} {estimate.value:.4g} {pretty_unit(estimate.unit)}".rstrip()
    return shown if estimate.is_identified else f"{shown} ({NOT_IDENTIFIED})"


def _with_interval(name: str, estimate: Estimate) -> str:
    """A parameter with its 95 % interval; without one where the fit does not move it."""
    if not estimate.is_identified:
        return _value(name.replace("_", " "), estimate)
    low, high = estimate.ci95
    interval = escape(f" [{low:.4g}, {high:.4g}]") if high > low else ""
    return f"{name.replace('_', ' ')} {estimate.value:.4g}{interval} {pretty_unit(estimate.unit)}".rstrip()


def _tracking(loop: JointClosedLoop, units: JointUnits) -> str:
    """Tracking errors before and after, or why there are none."""
    if not loop.reference.size:
        return "tracking was not simulated; the report lists the linear loop's margins"
    figures = [1e3 * each.rms_error for each in (loop.before, loop.after)]
    if not all(math.isfinite(value) for value in figures):
        return (
            "no tracking error (not simulated to the end with both models); the report lists the linear loop's margins"
        )
    return units.text(f"tracking error {figures[0]:.3g} mrad before, {figures[1]:.3g} mrad after")


def _print_export(console: Console, result: CloseLoopResult) -> None:
    """Errors of the exported model beside those of the model, and what its simulator lacks."""
    if result.export is None:
        return
    trial = result.export
    title = f"RMS position error of free runs, {trial.model_file}"
    print_wide(
        headings(trial.rows, trial.runner),
        cells(trial.rows, {name: joint.units for name, joint in result.joints.items()}),
        left=("joint", "run"),
        title=title,
    )
    for loss in trial.losses:
        _say(console, f"  {escape(loss)}")


def _errors_table(joint: JointResult) -> Table:
    table = Table(box=None, padding=(0, 2))
    for header in ("", "train", "held-out", escape(f"free run [{joint.units.position}]")):
        table.add_column(header, justify="left" if not header else "right")
    absolute = mean_absolute_errors(joint)
    for name, errors in (("before", joint.before), ("after", joint.after)):
        free = "-" if errors.free_run_heldout is None else f"{errors.free_run_heldout:.3g}"
        table.add_row(name, f"{errors.train:.3g} {joint.unit}", f"{errors.heldout:.3g} {joint.unit}", free)
        figures = [(absolute[name]["train"], f" {joint.unit}"), (absolute[name]["heldout"], f" {joint.unit}")]
        figures.append((absolute[name]["free_run_heldout"], ""))
        table.add_row("  mean absolute", *("-" if value is None else f"{value:.3g}{unit}" for value, unit in figures))
    refined = joint.refinement
    if refined is not None and refined.accepted:
        figures = [(refined.error_train, joint.unit), (refined.error_heldout, joint.unit)]
        cells = ["-" if value is None else f"{value:.3g} {unit}" for value, unit in figures]
        free = "-" if refined.free_run_heldout is None else f"{refined.free_run_heldout:.3g}"
        table.add_row("refined", *cells, free)
    table.add_row("noise floor", "", f"{joint.noise_floor:.3g} {joint.unit}", "")
    return table
