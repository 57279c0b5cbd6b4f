"""What changed since a model was made: as text, as HTML, as JSON, and as a page."""

import base64
import math
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from drake_tc.config.quoted import json_value
from drake_tc.report.numbers import interval, percent, pretty_unit, significant
from drake_tc.report.plain_page import PageSection, PageTable, plain_page
from drake_tc.report.plots.svg import AFTER, BACKWARD, MUTED, NotebookFigure, new_figure, page_style, to_svg
from drake_tc.watch.changes import Known
from drake_tc.watch.compare import ComparisonResult, EffectChange, JointComparison, ParameterChange

VERDICTS = {
    "unchanged": "Nothing changed that these logs show",
    "parameters_changed": "Parameters changed",
    "new_effect": "A new effect appeared",
    "cannot_tell": "These logs cannot tell",
}
HEADINGS = ("parameter", "then", "now", "change", "log odds", "")
WIDEST = 2.0
"""Largest relative change that the picture shows."""


def comparison_text(found: ComparisonResult) -> str:
    """The verdict and one table a joint."""
    lines = [f"verdict: {VERDICTS[found.verdict]} ({found.verdict})"]
    lines += [f"robot: {effect_sentence(each)}" for each in found.shared]
    for joint in found.joints.values():
        lines += [f"{joint.joint}: {VERDICTS[joint.verdict]}", *(f"  {line}" for line in sentences(joint))]
        lines += _aligned([HEADINGS, *(_row(p) for p in joint.parameters)])
    return "\n".join(lines)


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows of texts in columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  " + "  ".join(f"{t:<{w}}" for t, w in zip(row, widths, strict=True)).rstrip() for row in rows]


def comparison_html(found: ComparisonResult) -> str:
    """The same for a notebook, with the picture of each joint."""
    figures = [change_figure(joint) for joint in found.joints.values() if joint.parameters]
    images = [(f.screen_width, base64.b64encode(f.png()).decode("ascii")) for f in figures]
    pictures = [
        f'<img width="{width}" alt="changes" src="data:image/png;base64,{encoded}">' for width, encoded in images
    ]
    return f"<pre>{escape(comparison_text(found))}</pre>{''.join(pictures)}"


def comparison_page(found: ComparisonResult) -> str:
    """The self-contained report."""
    sections = [_section(joint) for joint in found.joints.values()]
    if found.shared:
        sections.insert(0, PageSection("Robot", [effect_sentence(each) for each in found.shared]))
    lead = [f"{VERDICTS[found.verdict]}.", f"New logs: {', '.join(Path(log).name for log in found.logs)}."]
    return plain_page("What changed", f"compare · {Path(found.model_file).name}", lead, sections)


def _section(joint: JointComparison) -> PageSection:
    numbers = HEADINGS[1:-1]
    table = PageTable(
        HEADINGS, [(name, *map(_stacked, cells)) for name, *cells in map(_row, joint.parameters)], numbers
    )
    plots = [change_picture(joint)] if joint.parameters else []
    return PageSection(joint.joint, sentences(joint), plots=plots, tables=[table], aside=VERDICTS[joint.verdict])


def sentences(joint: JointComparison) -> list[str]:
    """What is said of a joint beside the table."""
    out = [f"{joint.why[0].upper()}{joint.why[1:]}."] if joint.why else []
    out += [change_sentence(p) for p in joint.parameters if p.changed]
    out += [effect_sentence(e) for e in joint.effects if e.status != "present"]
    heat = [label_of(f"{p.key}.{p.name}") for p in joint.parameters if p.heat]
    then, now = joint.temperature
    if heat:
        out.append(
            f"{', '.join(heat)} differ, and so does the temperature ({then:.1f} °C then, {now:.1f} °C now), which "
            "may explain it: this is no change of the joint."
        )
    if math.isnan(now - then) and any(p.changed for p in joint.parameters):
        out.append("The temperature was not recorded in both, so a warmer gear cannot be told from wear.")
    pairs = [f"{a} and {b}" for a, b in joint.diagnosis.indistinguishable]
    if pairs:
        out.append(f"The logs cannot distinguish {', '.join(pairs)}.")
    left = f"{significant(joint.floors_then)} under the stored numbers, {significant(joint.floors_now)} fitted again"
    out.append(f"Error of the new logs over the noise floor: {left}.")
    return out


def label_of(name: str) -> str:
    """A parameter "effect.parameter" for people: one name where both are the same."""
    effect, _, parameter = name.rpartition(".")
    return parameter if parameter == effect else name


def change_sentence(p: ParameterChange) -> str:
    """A changed parameter in one sentence."""
    value, ends = interval(p.change.value, *p.change.ci95)
    share = f" ({percent(p.share)})" if math.isfinite(p.share) else ""
    other = (
        f", or else {' or '.join(map(label_of, p.alternatives))} did, which these logs do not distinguish"
        if p.alternatives
        else ""
    )
    return f"{label_of(f'{p.key}.{p.name}')} changed by {value} {ends} {pretty_unit(p.unit)}{share}{other}."


def effect_sentence(e: EffectChange) -> str:
    """An effect in one sentence."""
    values = ", ".join(f"{name} {' '.join(interval(k.value, *k.ci95)).strip()}" for name, k in e.parameters.items())
    where = f" of {e.where}" if e.where else ""
    words = {
        "appeared": "appeared",
        "present": "is still there",
        "gone": "is gone",
        "uncertain": "may have appeared",
        "heat": "depends on the temperature and is no change of the joint",
    }
    return f"{e.title}{where} {words[e.status]} (log odds {significant(e.log_odds)}): {values}."


def _row(p: ParameterChange) -> tuple[str, ...]:
    then, now = (" ".join(interval(k.value, *k.ci95)).strip() for k in (p.then, p.now))
    change, ends = interval(p.change.value, *p.change.ci95)
    mark = "changed" if p.changed else "temperature" if p.heat else ""
    name = f"{label_of(f'{p.key}.{p.name}')} [{pretty_unit(p.unit) or '-'}]"
    return (name, then, now, f"{change} {ends}".strip(), significant(p.log_odds), mark)


def _stacked(cell: str) -> str:
    """A value with its interval below it: side by side, three of them are wider than a page."""
    value, between, ends = cell.partition(" [")
    return Markup("{}<br>[{}").format(value, ends) if between else cell


def change_picture(joint: JointComparison) -> str:
    """`change_figure` as an SVG element."""
    with page_style(f"changes-{joint.joint}"):
        return to_svg(change_figure(joint), f"changes of the parameters of {joint.joint}")


def change_figure(joint: JointComparison) -> NotebookFigure:
    """The change of each parameter over its stored value, with its interval."""
    shown = [p for p in joint.parameters if p.then.value]
    with page_style(f"changes-{joint.joint}"):
        figure = new_figure(6.4, 0.62 + 0.24 * len(shown))
        figure.subplots_adjust(left=0.34)
        axes = figure.add_subplot()
        axes.axvline(0.0, color=MUTED, linewidth=0.8)
        for row, p in enumerate(reversed(shown)):
            low, high = (100.0 * end / abs(p.then.value) for end in p.change.ci95)
            colour = BACKWARD if p.changed else AFTER
            axes.plot([low, high], [row, row], color=colour, linewidth=2.2, solid_capstyle="butt")
            axes.plot(100.0 * p.share, row, "o", color=colour, markersize=4.5)
        axes.set_yticks(np.arange(len(shown)), [p.key if p.name == p.key else p.name for p in reversed(shown)])
        reach = max((abs(end) / abs(p.then.value) for p in shown for end in p.change.ci95), default=0.1)
        axes.set_xlim(*(100.0 * sign * 1.05 * min(reach, WIDEST) for sign in (-1.0, 1.0)))
        axes.set_xlabel("change since the model was made [% of the stored value]")
        return figure


def comparison_json(found: ComparisonResult) -> dict[str, Any]:
    """compare.json: see docs/same_joint_later.md."""
    out: dict[str, Any] = json_value(
        {
            "schema": 1,
            "verdict": found.verdict,
            "model": found.model_file,
            "rig": found.rig_file,
            "logs": list(found.logs),
            "joints": {name: _joint_json(joint) for name, joint in found.joints.items()},
            "shared": [_effect_json(each) for each in found.shared],
            "seconds": found.seconds,
        }
    )
    return out


def _joint_json(joint: JointComparison) -> dict[str, Any]:
    return {
        "verdict": joint.verdict,
        "why": joint.why or None,
        "floors": {"then": joint.floors_then, "now": joint.floors_now},
        "temperature": {"then": joint.temperature[0], "now": joint.temperature[1]},
        "parameters": [
            {
                "effect": p.key,
                "parameter": p.name,
                "unit": p.unit,
                "then": _known_json(p.then),
                "now": _known_json(p.now),
                "fitted": _known_json(p.fitted),
                "change": _known_json(p.change) | {"log_odds": p.log_odds},
                "changed": p.changed,
                "explained_by_temperature": p.heat,
                "alternatives": list(p.alternatives),
            }
            for p in joint.parameters
        ],
        "effects": [_effect_json(each) for each in joint.effects],
        "indistinguishable": [list(pair) for pair in joint.diagnosis.indistinguishable],
    }


def _known_json(known: Known) -> dict[str, Any]:
    return {"value": known.value, "ci95": list(known.ci95)}


def _effect_json(e: EffectChange) -> dict[str, Any]:
    return {
        "id": e.key,
        "where": e.where or None,
        "status": e.status,
        "log_odds": e.log_odds,
        "parameters": {name: _known_json(known) for name, known in e.parameters.items()},
    }
