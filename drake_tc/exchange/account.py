"""What an export loses, in sentences, and as a page beside the errors of free runs."""

from collections.abc import Sequence

from drake_tc.exchange.comparison import RunErrors
from drake_tc.exchange.projection import COMMANDS, Projection, Vocabulary
from drake_tc.report.numbers import significant
from drake_tc.report.plain_page import PageSection, PageTable, plain_page


def sentences(projections: Sequence[Projection], target: Vocabulary) -> list[str]:
    """What is lost, joint by joint.

    Args:
        projections: One a joint.
        target: What they are projected to.
    """
    lines = []
    for each in projections:
        if each.refit is not None:
            r = each.refit
            where = (
                f"the recorded speeds (up to {r.speed:.3g} rad/s)" if r.recorded else f"speeds up to {r.speed:g} rad/s"
            )
            lines.append(
                f"{each.joint}: {target.name} has no {' and '.join(r.effects)}: dry and viscous friction were refitted"
                f" over {where}; RMS error of the friction torque {r.refitted:.3g} N m, {r.dropped:.3g} without the"
                " refit."
            )
        for loss in each.losses:
            has = f"has {loss.effect} only in part" if loss.partly else f"has no {loss.effect}"
            lines.append(f"{each.joint}: {target.name} {has}{f': {loss.why}' if loss.why else ''}.")
    return lines or [f"{target.name} expresses all effects of this model."]


def headings(runner: str) -> tuple[str, ...]:
    """Of the table of errors.

    Args:
        runner: What runs the export, such as "MuJoCo".
    """
    return ("joint", "run", "our model, Drake", f"export, {runner}", f"your file, {runner}")


def cells(rows: Sequence[RunErrors]) -> list[tuple[str, ...]]:
    """Of the table of errors, in rad.

    Args:
        rows: One a joint and run.
    """
    return [
        (r.joint, r.run, *("-" if v is None else f"{v:.3g} rad" for v in (r.model, r.export, r.original))) for r in rows
    ]


def export_page(
    projections: Sequence[Projection], target: Vocabulary, rows: Sequence[RunErrors], runner: str, source: str
) -> str:
    """The HTML of an export: what is lost, errors of free runs, and the terms that were written.

    Args:
        projections: One a joint.
        target: What they are projected to.
        rows: Errors; empty where nothing was run.
        runner: What ran the export; "" where nothing did.
        source: Name of the model's file.
    """
    said = sentences(projections, target)
    sections = []
    if rows:
        table = PageTable(headings(runner), cells(rows), headings(runner)[2:])
        how = (
            "Each model is driven by the recorded command alone, from the first sample on, under the recorded or known"
            " load. A run that becomes unstable has no error."
        )
        title = "RMS error of the free-running position on held-out runs"
        sections.append(PageSection(title, paragraphs=[how], tables=(table,)))
    names = ("joint", "term", "value")
    sections.append(
        PageSection("What was written", tables=(PageTable(names, _terms(projections, target), ("value",)),))
    )
    return plain_page(f"The model in {target.name}", f"export · {source}", said, sections)


def _terms(projections: Sequence[Projection], target: Vocabulary) -> list[tuple[str, str, str]]:
    rows = []
    for each in projections:
        t = each.terms
        found: list[tuple[str, float | None, str]] = [
            ("torque for one unit of command", t.kp if t.drive in target.drives else None, f"N·m/{COMMANDS[t.drive]}"),
            ("rotor inertia at the joint", t.armature, "kg·m²"),
            ("viscous friction", t.damping, "N·m·s/rad"),
            ("quadratic friction", t.quadratic, "N·m·s²/rad²"),
            ("dry friction", t.frictionloss, "N·m"),
            ("Stribeck peak", t.stribeck.height if t.stribeck else None, "N·m"),
            ("Stribeck velocity", t.stribeck.velocity if t.stribeck else None, "rad/s"),
            ("Stribeck exponent", t.stribeck.exponent if t.stribeck else None, ""),
            ("friction under load, share of the load", t.load_friction, ""),
            ("delay of the command", t.delay, "s"),
            ("limit of the torque", t.torque_limit, "N·m"),
            ("play of the gear", t.backlash, "rad"),
        ]
        rows += [(each.joint, name, f"{significant(value, 5)} {unit}".strip()) for name, value, unit in found if value]
    return rows
