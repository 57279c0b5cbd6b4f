"""A rehearsal as JSON and as a page with its power curve."""

from dataclasses import asdict
from typing import Any

import numpy as np

from drake_tc.config.quoted import json_value
from drake_tc.experiments.rehearsal.run import Rehearsal, half_power
from drake_tc.report.numbers import percent, pretty_unit, significant
from drake_tc.report.plain_page import PageSection, PageTable, plain_page
from drake_tc.report.plots.svg import BACKWARD, FORWARD, new_figure, page_style, to_svg

FILES = ("rehearsal.html", "rehearsal.json")


def rehearsal_json(found: Rehearsal) -> dict[str, Any]:
    """The whole rehearsal as plain data."""
    out: dict[str, Any] = json_value(
        {
            "name": "rehearse",
            "schema": 1,
            "joint": found.joint,
            "effect": found.effect,
            "size": asdict(found.size),
            "predicted_smallest": found.predicted,
            "found_from": half_power(found.points),
            "points": [asdict(each) for each in found.points],
            "trials": [asdict(each) for each in found.trials],
        }
    )
    return out


def summary(found: Rehearsal) -> str:
    """One sentence: from which size on the effect is found."""
    size, unit = half_power(found.points), pretty_unit(found.size.unit)
    if not np.isfinite(size):
        return f"{found.joint}: none of the tried sizes of {found.effect} is found in half of the trials."
    return f"{found.joint}: {found.effect} is found in half of the trials or more from {significant(size)} {unit} on."


def rehearsal_page(found: Rehearsal) -> str:
    """The page."""
    unit = pretty_unit(found.size.unit)
    rows = [
        (
            significant(p.size) if p.size else "0 (nothing missing)",
            f"{p.found} of {p.trials}",
            f"{percent(p.interval[0])} to {percent(p.interval[1])}",
            str(p.alone),
            ", ".join(f"{name} ({count})" for name, count in p.others.items()) or "–",
        )
        for p in found.points
    ]
    headings = (f"{found.size.name} [{unit or '-'}]", "found", "95 % interval", "alone", "named instead")
    table = PageTable(headings, rows, (headings[0], "found", "95 % interval", "alone"))
    predicted = significant(found.predicted) if np.isfinite(found.predicted) else "none"
    how = (
        "Each trial simulates the joint with the runs’ own motions, loads, sensors and noise by a simulator that "
        "shares no formula with the diagnosis, and diagnoses the simulated runs without knowing what was put in. "
        f"The check of these logs predicts a smallest size of {predicted} {unit}."
    )
    section = PageSection(found.effect, (how,), plots=(_plot(found),), tables=(table,))
    return plain_page("Would it have been found?", f"rehearse · joint {found.joint}", (summary(found),), (section,))


def _plot(found: Rehearsal) -> str:
    """Share found over the size."""
    points = [p for p in found.points if p.size > 0.0]
    size = np.array([p.size for p in points])
    share = np.array([p.found / p.trials for p in points])
    low, high = np.array([p.interval for p in points]).T
    with page_style("power"):
        figure = new_figure(6.0, 3.0)
        axes = figure.add_subplot(1, 1, 1)
        axes.errorbar(size, share, yerr=[share - low, high - share], color=FORWARD, marker="o", markersize=3.5)
        if np.isfinite(found.predicted) and found.predicted > 0.0:
            axes.axvline(found.predicted, color=BACKWARD, linestyle="--", linewidth=0.9)
        axes.set_xscale("log")
        axes.set_ylim(-0.03, 1.03)
        axes.set_xlabel(f"{found.size.name} [{found.size.unit}]; dashed: predicted by the check")
        axes.set_ylabel("share found")
        return to_svg(figure, f"share of trials in which {found.effect} is found, over its size")
