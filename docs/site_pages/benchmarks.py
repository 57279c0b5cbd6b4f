"""Tables of stored benchmark results, each with its command, commit and date; `record_benchmark.py` stores them."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from drake_tc.config.page import table

STORE = Path(__file__).parents[1] / "benchmarks"


def overview() -> str:
    """All stored results."""
    return "\n\n".join(_section(json.loads(path.read_text("utf-8"))) for path in sorted(STORE.glob("*.json")))


def _section(stored: Mapping[str, Any]) -> str:
    machine = ", ".join(f"{name} {value}" for name, value in stored["machine"].items())
    origin = f"Commit `{stored['commit'][:12]}`, {stored['date']}; {machine}."
    parts = [f"## {stored['title']}", stored["about"], f"    {stored['command']}", origin]
    parts.append(_rows(stored["result"]["rows"]))
    return "\n\n".join(part for part in parts if part)


def _rows(rows: Sequence[Mapping[str, Any]]) -> str:
    names: list[str] = []
    for row in rows:
        names += [name for name in row if name not in names]
    cells = [tuple(_cell(row.get(name)) for name in names) for row in rows]
    return table(tuple(name.replace("_", " ") for name in names), cells)


def _cell(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return ", ".join(map(_cell, value))
    return "–" if value is None else str(value).replace("[", "\\[").replace("<", "&lt;")
