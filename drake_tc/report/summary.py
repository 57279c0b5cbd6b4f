"""What was found, as text: verdict, errors, effects with their intervals, and warnings of each joint.

The command prints it, and a result in a notebook or a Python shell shows it.
"""

import base64
import html
import io
import math

from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from drake_tc.config.joint_units import JointUnits
from drake_tc.diagnosis.problem.parameters import Estimate
from drake_tc.diagnosis.result.applications import JointClosedLoop
from drake_tc.diagnosis.result.errors import mean_absolute_errors
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.report import words
from drake_tc.report.notes import experiment_sentence, note_sentences, set_up_sentences, warnings
from drake_tc.report.numbers import NOT_IDENTIFIED, pretty_unit
from drake_tc.report.plots.time_plots import residual_figure
from drake_tc.report.sections import links_sentence, payload_sentences, refinement_sentence

HANGING = 4
"""Columns by which the lines of a broken text are indented beyond its first."""
WIDTH = 110
"""Columns of a text that is not printed to a terminal."""


def result_text(found: CloseLoopResult | JointResult) -> str:
    """What was found, as plain text."""
    console = _recording()
    _say_found(console, found)
    return console.export_text(styles=False).rstrip()


def result_html(found: CloseLoopResult | JointResult) -> str:
    """What was found, as an HTML fragment: the text, and the residual of each joint."""
    console = _recording()
    _say_found(console, found)
    text = console.export_html(inline_styles=True, code_format="<pre>{code}</pre>")
    joints = [found] if isinstance(found, JointResult) else list(found.joints.values())
    return text + "".join(_picture(joint) for joint in joints)


def _recording() -> Console:
    """A console that keeps what it prints, the same in every terminal."""
    return Console(
        file=io.StringIO(),
        width=WIDTH,
        record=True,
        highlight=False,
        color_system=None,
        force_terminal=False,
        force_jupyter=False,
    )


def _say_found(console: Console, found: CloseLoopResult | JointResult) -> None:
    if isinstance(found, JointResult):
        _say_joint(console, found)
        return
    console.print(f"[bold]verdict[/bold]: {words.verdict_words(found)} ({found.verdict})")
    say_result(console, found)


def _picture(joint: JointResult) -> str:
    """The residual over time as an image element."""
    figure = residual_figure(joint)
    encoded = base64.b64encode(figure.png()).decode("ascii")
    about = html.escape(f"residual of {joint.joint} over time on the held-out runs")
    return f'<img width="{figure.screen_width}" alt="{about}" src="data:image/png;base64,{encoded}">'


def say_result(console: Console, result: CloseLoopResult) -> None:
    """Print verdict and one table a joint."""
    for line in set_up_sentences(result.set_up):
        say(console, f"[bold]set-up[/bold]: {escape(line)}")
    _say_robot(console, result)
    for joint in result.joints.values():
        _say_joint(console, joint)
        loop = None if result.closed_loop is None else result.closed_loop.joints.get(joint.joint)
        if loop is not None and loop.changed:
            say(console, f"  closed loop: {_tracking(loop, joint.units)}")
    if result.closed_loop is not None:
        for note in result.closed_loop.notes:
            say(console, f"closed loop: {escape(note)}")
    if result.hints:
        say(console, f"rig file or log: {escape(' '.join(result.hints))}")


def say(console: Console, markup: str) -> None:
    """Print one text; where it is broken, its further lines are indented."""
    text = Text.from_markup(markup)
    indent = len(text.plain) - len(text.plain.lstrip())
    body = text[indent:]
    lines = body.wrap(console, max(console.width - indent - HANGING, 20))
    for number, line in enumerate(lines):
        line.rstrip()
        console.print(Text(" " * (indent + HANGING * (number > 0))) + line)


def _say_robot(console: Console, result: CloseLoopResult) -> None:
    """What several joints share."""
    for note in note_sentences(result.notes):
        say(console, f"[bold]all joints[/bold]: ! {escape(note)}")
    ranking = words.ranked_effects(result)
    if len(ranking) > 1 and result.shared:
        listed = "; ".join(f"{name} of {where} ({100 * gain:.0f} %)" for name, where, gain in ranking)
        say(console, f"Found, by the held-out gain of all joints: {listed}")
    for cause in result.shared:
        values = ", ".join(_parameter(n, p) for n, p in cause.parameters.items())
        gain = f"held-out gain of all joints {100 * cause.heldout_gain:.0f} %"
        where = f"the encoder of {cause.where}" if cause.where in result.joints else cause.where
        say(console, f"[bold]all joints[/bold]: + [bold]{cause.id}[/bold] of {where}  {values}  ({gain})")
        for other, where in cause.indistinguishable:
            say(console, f"  ? these logs cannot distinguish it from {other} of {where}")
    if result.links is not None:
        say(console, escape(links_sentence(result.links, wrong_set_up=result.has_wrong_set_up)))
        for sentence in () if result.has_wrong_set_up else payload_sentences(result.links):
            say(console, escape(sentence))


def _say_joint(console: Console, joint: JointResult) -> None:
    """Print verdict, errors, effects and warnings of one joint."""
    console.print(f"[bold]{joint.joint}[/bold]: {words.verdict_words(joint)}")
    console.print(_errors_table(joint))
    if joint.verdict.startswith("unexplained") and not joint.set_up_wrong:
        say(console, f"  {escape(words.capital(words.unexplained(joint)))}")
        if smooth := words.remainder_sentence(joint):
            say(console, f"  {escape(smooth)}")
    if joint.load is not None:
        title, load = joint.load
        say(console, f"  {title}: {', '.join(_parameter(n.replace('_', ' '), p) for n, p in load.items())}")
    for note in note_sentences(joint.load_notes, joint.units):
        say(console, f"  ! {escape(note)}")
    if joint.refinement is not None:
        say(console, f"  Refinement on free runs: {escape(refinement_sentence(joint.refinement, joint.units))}")
    for effect in joint.effects:
        values = ", ".join(_parameter(n, p) for n, p in effect.parameters.items())
        gain = f"held-out gain {100 * effect.heldout_gain:.0f} %"
        say(console, f"  + [bold]{effect.key}[/bold]  {values}  ({gain})")
    for withdrawn in joint.did_not_hold:
        say(console, f"  - {withdrawn.key} did not hold. {words.REASONS[withdrawn.reason][1]}")
    for warning in warnings(joint):
        say(console, f"  ! {escape(warning)}")
    if joint.next_experiment is not None:
        say(console, f"  next: {escape(experiment_sentence(joint.next_experiment, joint.units))}")


def _parameter(name: str, estimate: Estimate) -> str:
    """A parameter with its 95 % interval; without one where the fit does not move it."""
    shown, unit = f"{name} {estimate.value:.4g}", pretty_unit(estimate.unit)
    if not estimate.is_identified:
        return f"{shown} {unit}".rstrip() + f" ({NOT_IDENTIFIED})"
    low, high = estimate.ci95
    interval = escape(f" [{low:.4g}, {high:.4g}]") if high > low else ""
    return f"{shown}{interval} {unit}".rstrip()


def _tracking(loop: JointClosedLoop, units: JointUnits) -> str:
    """Tracking errors before and after, or why there are none."""
    if not loop.reference.size:
        return "tracking was not simulated; the report lists the margins of the linear loop"
    figures = [1e3 * each.rms_error for each in (loop.before, loop.after)]
    if not all(math.isfinite(value) for value in figures):
        return (
            "no tracking error (not simulated to the end with both models); the report lists the margins of the linear "
            "loop"
        )
    return units.text(
        f"tracking error {figures[0]:.3g} mrad before, {figures[1]:.3g} mrad after; simulated with the model after as "
        "plant, so the improvement is an upper bound"
    )


def _errors_table(joint: JointResult) -> Table:
    """Errors before and after; the free runs where they were simulated."""
    unit, absolute = joint.unit, mean_absolute_errors(joint)
    rows: list[tuple[str, float | None, float | None, float | None]] = []
    for name, errors in (("before", joint.before), ("after", joint.after)):
        rows.append((f"RMS error {name}", errors.train, errors.heldout, errors.free_run_heldout))
    refined = joint.refinement
    if refined is not None and refined.accepted:
        rows.append(("RMS error refined", refined.error_train, refined.error_heldout, refined.free_run_heldout))
    for name, mean in absolute.items():
        rows.append((f"mean absolute {name}", mean["train"], mean["heldout"], mean["free_run_heldout"]))
    free_run = any(free is not None for *_, free in rows)
    table = Table(box=None, padding=(0, 2))
    headers = ["", "training", "held-out", *([escape(f"free run [{joint.units.position}]")] if free_run else [])]
    for header in headers:
        table.add_column(header, justify="left" if not header else "right")
    for name, train, heldout, free in rows:
        cells = (_figure(train, f" {unit}"), _figure(heldout, f" {unit}"), _figure(free))
        table.add_row(name, *cells[: len(headers) - 1])
    table.add_row("noise floor", "", _figure(joint.noise_floor, f" {unit}"))
    if joint.noise_floor > 0.0:
        table.add_row("after / noise floor", "", _figure(words.floors_left(joint)))
    return table


def _figure(value: float | None, unit: str = "") -> str:
    return "-" if value is None else f"{value:.3g}{unit}"
