"""Tables of stored benchmark results, each with its command, commit and date; `record_benchmark.py` stores them."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from drake_tc.config.page import table
from drake_tc.report.figure_row import FigureRow
from drake_tc.report.figure_table import figure_cells

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
    cells = figure_cells([FigureRow.of_json(row) for row in rows])
    return table(tuple(cells[0]), [tuple(map(_plain, each.values())) for each in cells])


def _plain(text: str) -> str:
    return text.replace("[", "\\[").replace("<", "&lt;")
