"""Errors of `close-loop` on public data sets, from the stored results of the gate (`tests/benchmarks/gate.json`)."""

import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from drake_tc.config.page import table
from drake_tc.diagnosis.shared.causes import TITLES
from drake_tc.effects.library import all_effects
from drake_tc.report.numbers import significant
from drake_tc.report.words import title_of

ROOT = Path(__file__).resolve().parents[2]
SETS = ROOT / "docs" / "public_sets.yaml"
GATE = ROOT / "tests" / "benchmarks" / "gate.json"
MODELS = ("before", "after", "least squares", "published")
RATIO = "after over the best"


def overview() -> str:
    """One table of all sets, with the commit and the date of the stored figures."""
    return overview_of(json.loads(GATE.read_text("utf-8"))["parts"].get("real"))


def overview_of(part: Mapping[str, Any] | None) -> str:
    """The same of one part of the gate.

    Args:
        part: Its rows, commit and date; None where none is stored.
    """
    sets: dict[str, dict[str, str]] = yaml.safe_load(SETS.read_text("utf-8"))
    rows = {row["name"]: row for row in part["rows"]} if part else {}
    heads = ("data set", "named", *MODELS, "after / best other")
    figures = [_figures(name, said["effort"], rows) for name, said in sets.items() if f"{name}: {RATIO}" in rows]
    unused = [f"`{name}`" for name in sets if f"{name}: {RATIO}" not in rows]
    facts = table(
        ("data set", "what is in it", "what is open"),
        [(f"`{name}`", said["contains"] + _source(said), said["open"]) for name, said in sets.items()],
    )
    if not part:
        return f"No figures are stored.\n\n{facts}"
    origin = f"Commit `{part['commit'][:12]}`, {part['date']}; `python -m tests.benchmarks gate --part real`"
    return "\n\n".join(
        (
            f"{origin}, {part['size']} size.",
            table(heads, figures),
            *(_share(row) for row in part["rows"] if row["unit"] == "share"),
            f"The stored run of this size has no figures of {', '.join(unused)}." if unused else "",
            facts,
        )
    )


def _source(said: Mapping[str, str]) -> str:
    """Where the recordings are published; "" for simulated ones."""
    return f" ([source]({said['source']}))" if "source" in said else ""


def _share(row: Mapping[str, Any]) -> str:
    missed = "" if row["met"] else ", missed"
    return (
        f"Share of {row['name']}: {100.0 * row['median']:.0f} % of {row['n']} "
        f"(goal: at least {100.0 * row['expected']:.0f} %{missed})."
    )


def _in_words(named: str) -> str:
    """A list of effects with their titles in place of their ids, which a narrow column cannot break."""
    known = {word for each in all_effects() for word in (each.id, each.key)} | set(TITLES)
    return re.sub(r"[a-z_.]+", lambda word: title_of(word[0]) if word[0] in known else word[0], named)


def _figures(name: str, unit: str, rows: Mapping[str, Mapping[str, Any]]) -> tuple[str, ...]:
    errors = []
    for model in MODELS:
        row = rows.get(f"{name}: {model}")
        errors.append("–" if row is None else f"{significant(row['median'])} {unit}".rstrip())
    ratio = rows[f"{name}: {RATIO}"]
    value, note = ratio["median"], ratio.get("note", "")
    named = re.search(r"named: (.*)", note)
    shown = significant(value) if value is not None and math.isfinite(value) else "–"
    missed = "" if ratio.get("met", True) else " (missed)"
    return (f"`{name}`", _in_words(named[1] if named else note), *errors, f"{shown}{missed}")
