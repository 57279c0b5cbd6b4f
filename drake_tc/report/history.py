"""The history of joints: trends as sentences, the spread between units, and a picture of each joint."""

from collections.abc import Sequence

import numpy as np
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num

from drake_tc.report.comparison import label_of
from drake_tc.report.numbers import interval, percent, pretty_unit
from drake_tc.report.plain_page import PageSection, PageTable, plain_page
from drake_tc.report.plots.svg import (
    AFTER,
    BACKWARD,
    MUTED,
    REFINED,
    SHADE,
    NotebookFigure,
    new_figure,
    page_style,
    to_svg,
)
from drake_tc.watch.history import FEWEST, Session, Trend, further_unit, trends

MONTH = 30.0
AHEAD = 0.5
"""How far a trend is drawn beyond the last session, over the time that the sessions cover."""
COLOURS = (AFTER, BACKWARD, REFINED, MUTED)
COLUMNS = 2


def history_sentences(sessions: Sequence[Session]) -> list[str]:
    """One sentence for each parameter of a unit that drifts."""
    out = []
    for serial in dict.fromkeys(s.serial for s in sessions):
        for joint in dict.fromkeys(j for s in sessions for j in s.parameters):
            unit = _units(sessions, joint)
            for name, found in trends(sessions, serial, joint).items():
                if found.drifts:
                    out.append(
                        f"{_unit_name(serial)}{joint}: {label_of(name)} drifts by {_monthly(found, unit[name])}."
                    )
    return out


def _unit_name(serial: str) -> str:
    return f"{serial}, " if serial else ""


def _units(sessions: Sequence[Session], joint: str) -> dict[str, str]:
    return {name: unit for s in sessions for name, unit in s.units.get(joint, {}).items()}


def _monthly(found: Trend, unit: str) -> str:
    value, ends = interval(*(MONTH * x for x in (found.slope, *found.slope_ci95)))
    return f"{value} {ends} {pretty_unit(unit)} a month".replace("  ", " ")


def history_page(sessions: Sequence[Session]) -> str:
    """A self-contained page."""
    joints = dict.fromkeys(j for s in sessions for j in s.parameters)
    sections = [_section(sessions, joint) for joint in joints]
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


def _section(sessions: Sequence[Session], joint: str) -> PageSection:
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
    return PageSection(joint, plots=[history_picture(sessions, joint)], tables=tables)


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


def history_picture(sessions: Sequence[Session], joint: str) -> str:
    """`history_figure` as an SVG element."""
    with page_style(f"history-{joint}"):
        return to_svg(history_figure(sessions, joint), f"history of {joint}")


def history_figure(sessions: Sequence[Session], joint: str) -> NotebookFigure:
    """Each parameter over time with intervals, the trend of each unit, and where it leads."""
    names = list(_units(sessions, joint))
    units = _units(sessions, joint)
    rows = -(-len(names) // COLUMNS)
    first = float(date2num(sessions[0].time))
    with page_style(f"history-{joint}"):
        figure = new_figure(7.2, 0.5 + 1.45 * rows)
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
                    axes.fill_between(when, low, high, color=SHADE, linewidth=0.0)
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
