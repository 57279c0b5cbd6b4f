"""What changed since a model was made: as text, as HTML, as JSON, and as a page.

The history of joints: trends as sentences, the spread between units, and a picture of each joint.
"""

import base64
import math
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num

from drake_tc.config.quoted import json_value
from drake_tc.report.numbers import interval, percent, pretty_unit, significant
from drake_tc.report.pages import PageSection, PageTable, plain_page
from drake_tc.report.plots import svg
from drake_tc.watch.changes import Known
from drake_tc.watch.compare import ComparisonResult, EffectChange, JointComparison
from drake_tc.watch.history import FEWEST, Session, Trend, further_unit, trends
from drake_tc.watch.parameters import ParameterChange

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
        lines += _aligned([HEADINGS, *(line for p in joint.parameters for line in _rows(p))])
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
    table = PageTable(HEADINGS, [tuple(map(_in_html, *_rows(p))) for p in joint.parameters], numbers)
    name, about = f"changes-{joint.joint}", f"changes of the parameters of {joint.joint}"
    plots = [_svg(name, change_figure(joint), about)] if joint.parameters else []
    told = [*sentences(joint), "Brackets hold 95 % intervals. The log odds are those that the parameter changed."]
    return PageSection(joint.joint, told, plots=plots, tables=[table], aside=VERDICTS[joint.verdict])


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
        "unlikely": "is found in the new logs alone, and either contradicts the stored numbers or explains too little",
        "heat": "depends on the temperature and is no change of the joint",
    }
    return f"{e.title}{where} {words[e.status]} (log odds {significant(e.log_odds)}): {values}."


def _rows(p: ParameterChange) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The values of a parameter, and the intervals below them: side by side, three of them are wider than a page."""
    values, ends = zip(*(interval(k.value, *k.ci95) for k in (p.then, p.now, p.change)), strict=True)
    mark = "changed" if p.changed else "temperature" if p.heat else ""
    name = f"{label_of(f'{p.key}.{p.name}')} [{pretty_unit(p.unit) or '-'}]"
    return (name, *values, significant(p.log_odds), mark), ("", *ends, "", "")


def _in_html(value: str, below: str) -> str:
    return Markup("{}<br>{}").format(value, below) if below else value


def change_figure(joint: JointComparison) -> svg.NotebookFigure:
    """The change of each parameter over its stored value, with its interval."""
    shown = [p for p in joint.parameters if p.then.value]
    with svg.page_style(f"changes-{joint.joint}"):
        figure = svg.new_figure(6.4, 0.62 + 0.24 * len(shown))
        figure.subplots_adjust(left=0.34)
        axes = figure.add_subplot()
        axes.axvline(0.0, color=svg.MUTED, linewidth=0.8)
        for row, p in enumerate(reversed(shown)):
            low, high = (100.0 * end / abs(p.then.value) for end in p.change.ci95)
            colour = svg.BACKWARD if p.changed else svg.AFTER
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


MONTH = 30.0
AHEAD = 0.5
"""How far a trend is drawn beyond the last session, over the time that the sessions cover."""
COLOURS = (svg.AFTER, svg.BACKWARD, svg.REFINED, svg.MUTED)
COLUMNS = 2


def history_sentences(sessions: Sequence[Session]) -> list[str]:
    """One sentence for each parameter of a unit that drifts."""
    out = []
    for serial in dict.fromkeys(s.serial for s in sessions):
        for joint in dict.fromkeys(j for s in sessions for j in s.parameters):
            unit = _units(sessions, joint)
            for name, found in trends(sessions, serial, joint).items():
                if found.drifts:
                    owner = f"{serial}, {joint}" if serial else joint
                    out.append(f"{owner}: {label_of(name)} drifts by {_monthly(found, unit[name])}.")
    return out


def _units(sessions: Sequence[Session], joint: str) -> dict[str, str]:
    return {name: unit for s in sessions for name, unit in s.units.get(joint, {}).items()}


def _monthly(found: Trend, unit: str) -> str:
    value, ends = interval(*(MONTH * x for x in (found.slope, *found.slope_ci95)))
    return f"{value} {ends} {pretty_unit(unit)} a month".replace("  ", " ")


def history_page(sessions: Sequence[Session]) -> str:
    """A self-contained page."""
    joints = dict.fromkeys(j for s in sessions for j in s.parameters)
    sections = [_history_section(sessions, joint) for joint in joints]
    serials = {s.serial for s in sessions}
    most = max((sum(s.serial == serial for s in sessions) for serial in serials), default=0)
    lead = history_sentences(sessions) or ["No parameter drifts beyond its interval."]
    if most < FEWEST:
        lead = [f"A trend needs {FEWEST} sessions of a unit."]
    between = " of ".join(
        f"{count} {what}{'s' if count > 1 else ''}"
        for count, what in ((len(sessions), "session"), (len(serials), "unit"))
    )
    return plain_page("History", f"compare · {between}", lead, sections)


def _history_section(sessions: Sequence[Session], joint: str) -> PageSection:
    heads = ("unit", "parameter", "latest", "drift a month", "95 % interval", "of the value", "expected in a month")
    rows = []
    units = _units(sessions, joint)
    for serial in dict.fromkeys(s.serial for s in sessions):
        for name, found in trends(sessions, serial, joint).items():
            slope, ends = interval(*(MONTH * x for x in (found.slope, *found.slope_ci95)))
            latest, ahead = found.values[-1], found.at(found.days[-1] + MONTH)
            share = percent(MONTH * found.slope / abs(latest)) if latest else ""
            label = f"{label_of(name)} [{pretty_unit(units[name]) or '-'}]"
            rows.append(
                (serial or "-", label, interval(latest, *found.at(found.days[-1])[1:])[0], slope, ends, share,
                 " ".join(interval(*ahead)))
            )  # fmt: skip
    tables = [PageTable(heads, rows, heads[2:])] if rows else []
    between = _between_units(sessions, joint, units)
    if between:
        tables.append(PageTable(("parameter", "mean of the units", "a further unit, 95 %"), between))
    plot = _svg(f"history-{joint}", history_figure(sessions, joint), f"history of {joint}")
    return PageSection(joint, plots=[plot], tables=tables)


def _between_units(sessions: Sequence[Session], joint: str, units: dict[str, str]) -> list[tuple[str, str, str]]:
    """What a further unit may have, from the latest session of each."""
    latest = {s.serial: s for s in sessions if joint in s.parameters}
    rows = []
    for name in units if len(latest) > 1 else ():
        known = [s.parameters[joint][name] for s in latest.values() if name in s.parameters[joint]]
        if len(known) > 1:
            found = further_unit(known)
            value, ends = interval(found.value, *found.ci95)
            rows.append((f"{label_of(name)} [{pretty_unit(units[name]) or '-'}]", value, ends))
    return rows


def _svg(name: str, figure: svg.NotebookFigure, about: str) -> str:
    """A figure as an SVG element of a page."""
    with svg.page_style(name):
        return svg.to_svg(figure, about)


def history_figure(sessions: Sequence[Session], joint: str) -> svg.NotebookFigure:
    """Each parameter over time with intervals, the trend of each unit, and where it leads."""
    names = list(_units(sessions, joint))
    units = _units(sessions, joint)
    rows = -(-len(names) // COLUMNS)
    first = float(date2num(sessions[0].time))
    with svg.page_style(f"history-{joint}"):
        figure = svg.new_figure(7.2, 0.5 + 1.45 * rows)
        figure.subplots_adjust(left=0.12, right=0.98, hspace=0.65, wspace=0.32, top=1.0 - 0.3 / (0.5 + 1.45 * rows))
        for place, name in enumerate(names):
            axes = figure.add_subplot(rows, COLUMNS, place + 1)
            for number, serial in enumerate(dict.fromkeys(s.serial for s in sessions)):
                colour = COLOURS[number % len(COLOURS)]
                own = [s for s in sessions if s.serial == serial and name in s.parameters.get(joint, {})]
                known = [s.parameters[joint][name] for s in own]
                times = date2num([s.time for s in own])
                half = [1.96 * k.deviation for k in known]
                axes.errorbar(times, [k.value for k in known], half, fmt="o", color=colour, markersize=3.5,
                              elinewidth=1.0, label=serial or None)  # fmt: skip
                found = trends(sessions, serial, joint).get(name)
                if found is not None:
                    span = float(np.ptp(found.days))
                    days = np.linspace(found.days[0], found.days[-1] + AHEAD * span, 60)
                    value, low, high = np.array([found.at(d) for d in days]).T
                    when = first + days
                    axes.fill_between(when, low, high, color=svg.SHADE, linewidth=0.0)
                    past = days <= found.days[-1]
                    axes.plot(when[past], value[past], color=colour)
                    axes.plot(when[~past], value[~past], color=colour, linestyle=(0, (3, 2)))
            axes.set_title(f"{label_of(name)} [{pretty_unit(units[name]) or '-'}]")
            if len({s.time for s in sessions}) == 1:  # else the axis would span years
                axes.set_xlim(first - MONTH, first + MONTH)
            dates = AutoDateLocator(minticks=2, maxticks=4)
            axes.xaxis.set_major_locator(dates)
            axes.xaxis.set_major_formatter(ConciseDateFormatter(dates, show_offset=False))
        if len({s.serial for s in sessions}) > 1:
            figure.axes[0].legend(loc="best")
        return figure
