"""A check as a page for a person (`check.html`) and as plain data (`check.json`)."""

import math
from dataclasses import asdict
from typing import Any

from drake_tc.config.quoted import json_value
from drake_tc.experiments.check.run import CheckResult, JointCheck
from drake_tc.experiments.check.visibility import Visibility, by_reason
from drake_tc.report.numbers import percent, pretty_unit, significant
from drake_tc.report.plain_page import PageSection, PageTable, plain_page
from drake_tc.report.sentences.words import capital

WORDS = {"seen": "seen", "weakly": "weakly seen", "not_seen": "not seen", "not_separable": "not separable"}


def check_page(result: CheckResult) -> str:
    """The HTML of a check."""
    sections = [section for name, joint in result.joints.items() for section in _joint(name, joint)]
    runs = PageTable(
        ("run", "length", "rate", "usable", "stretches", "repairs on reading"),
        [
            (
                run.name,
                f"{significant(run.seconds)} s",
                f"{significant(run.rate, 4)} Hz",
                percent(run.usable),
                str(run.stretches),
                " ".join(run.notes) or "none",
            )
            for run in result.runs
        ],
        ("length", "rate", "usable", "stretches"),
    )
    columns = PageTable(
        ("run", "column", "from", "to", "step"),
        [
            (c.run, c.column, significant(c.low), significant(c.high), significant(c.step) if c.step else "none")
            for c in result.columns
        ],
        ("from", "to", "step"),
    )
    sections.append(PageSection("Runs and columns", aside="in SI units", tables=(runs, columns)))
    lead = [summary(name, joint) for name, joint in result.joints.items()]
    return plain_page("What these logs can show", f"check · rig {result.rig_file.rpartition('/')[2]}", lead, sections)


def summary(name: str, joint: JointCheck) -> str:
    """One sentence: how many effects would be found, and what speaks against the columns."""
    if joint.effects is None:
        return f"{name}: the declared model cannot be fitted. {joint.refusal}"
    shown = [e for e in joint.effects.effects if e.status == "seen"]
    blurred = [e for e in joint.effects.effects if e.status == "not_separable"]
    possible = sum(not e.obstacle for e in joint.effects.effects)
    doubts = sum(f.level == "warning" for f in joint.findings)
    text = (
        f"{name}: of the {possible} effects that can be looked for, these logs would show {len(shown)} of typical "
        f"size, and {len(blurred)} that they cannot separate from another effect."
    )
    if not doubts:
        return text
    return text + (
        " One property of the columns is doubtful." if doubts == 1 else f" {doubts} properties are doubtful."
    )


def _joint(name: str, joint: JointCheck) -> list[PageSection]:
    if joint.effects is None:
        return [PageSection(name, warnings=(joint.refusal,))]
    good = [f.text for f in joint.findings if f.level != "warning"]
    doubtful = [f.text for f in joint.findings if f.level == "warning"]
    noise, unit = joint.effects.noise, pretty_unit(joint.effects.facts.units.torque)
    explain = (
        f"Noise leaves {significant(noise.floor)} {unit} of the torque balance; the most probable model leaves "
        f"{significant(noise.left)} {unit} with {significant(noise.independent)} independent samples. An effect is "
        "found from the size on at which close-loop would name it in 95 % of such logs, whatever most of its other "
        "parameters are. "
        "“Seen” compares this size with the typical size, from which on an effect matters to the user of a model."
    )
    table = PageTable(
        ("effect", "these logs", "found from", "typical", "unit", "why"),
        [_row(each) for each in joint.effects.effects if not each.obstacle],
        ("found from", "typical"),
    )
    labels = {each.key: _label(each) for each in joint.effects.effects}
    never = PageTable(
        ("cannot be looked for", "why"),
        [
            (", ".join(labels[key] for key in keys), f"{capital(reason)}.")
            for reason, keys in by_reason(joint.effects.effects).items()
        ],
        (),
    )
    aside = f"{joint.drive}, {significant(joint.seconds)} s in motion"
    return [
        PageSection(f"{name}: columns", good, doubtful, aside=aside),
        PageSection(f"{name}: effects", (explain,), tables=(table, *([never] if never.rows else []))),
    ]


def _row(found: Visibility) -> tuple[str, ...]:
    why = found.reason or (f"At these motions it is {found.why}." if found.why else "")
    return (
        _label(found),
        WORDS[found.status],
        _size(found.smallest),
        _size(found.size.typical),
        pretty_unit(found.size.unit),
        why,
    )


def _label(found: Visibility) -> str:
    return found.title if found.key == found.id else f"{found.title} ({found.key})"


def _size(value: float) -> str:
    return significant(value) if 0.0 < value < math.inf else "–"


def check_json(result: CheckResult) -> dict[str, Any]:
    """{"name": "check", "joints": {NAME: {"effects": [{"id", "status", "size", ...}], ...}}, "runs", "columns"}."""
    document = {
        "name": "check",
        "schema": 1,
        "rig": result.rig_file,
        "logs": list(result.logs),
        "joints": {name: _joint_json(each) for name, each in result.joints.items()},
        "runs": [asdict(run) for run in result.runs],
        "columns": [asdict(column) for column in result.columns],
        "seconds": result.seconds,
    }
    out: dict[str, Any] = json_value(document)
    return out


def _joint_json(joint: JointCheck) -> dict[str, Any]:
    found = joint.effects
    return {
        "drive": joint.drive,
        "rows": joint.rows,
        "seconds_in_motion": joint.seconds,
        "refusal": joint.refusal or None,
        "findings": [asdict(each) for each in joint.findings],
        "declared": None if found is None else asdict(found.numbers),
        "motion": None if found is None else asdict(found.facts),
        "noise": None
        if found is None
        else {"floor": found.noise.floor, "left": found.noise.left, "independent_samples": found.noise.independent},
        "effects": [] if found is None else [_effect(each) for each in found.effects],
    }


def _effect(found: Visibility) -> dict[str, Any]:
    return {
        "id": found.id,
        "key": found.key,
        "status": found.status,
        "size": {
            "name": found.size.name,
            "unit": found.size.unit,
            "typical": found.size.typical,
            "smallest": found.smallest,
            "easiest": found.easiest,
        },
        "not_separable_from": list(found.not_separable_from),
        "separable": found.separable,
        "confused_below": list(found.confused_below),
        "kept": found.kept,
        "reason": found.reason or None,
    }
