"""Tables of stored benchmark results, each with its command, commit and date; `record_benchmark.py` stores them."""

import json
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from drake_tc.config.page import table
from tests.benchmarks.figures import BenchmarkRow, figure_cells

STORE = Path(__file__).parents[1] / "benchmarks"
COMMANDS = STORE / "commands.yaml"


def overview() -> str:
    """All stored results, and the commands whose results are not stored."""
    stored = sorted(STORE.glob("*.json"))
    sections = [_section(json.loads(path.read_text("utf-8"))) for path in stored]
    commands = yaml.safe_load(COMMANDS.read_text("utf-8"))
    return "\n\n".join(sections + _missing(commands, {path.stem for path in stored}))


def _missing(commands: Mapping[str, Mapping[str, str]], stored: Collection[str]) -> list[str]:
    """The benchmarks without a result; no section where all have one."""
    rows = [(name, said["title"], f"`{said['command']}`") for name, said in commands.items() if name not in stored]
    if not rows:
        return []
    about = (
        f"{len(rows)} of the {len(commands)} benchmarks have no stored result, so this page shows no figures for them."
        ' `make benchmark-records NAMES="..."` with names of the first column runs them and stores what they print.'
    )
    return ["## Benchmarks without a stored result", about, table(("name", "benchmark", "command"), rows)]


def _section(stored: Mapping[str, Any]) -> str:
    machine = ", ".join(f"{name} {value}" for name, value in stored["machine"].items())
    origin = f"Commit `{stored['commit'][:12]}`, {stored['date']}; {machine}."
    parts = [f"## {stored['title']}", stored["about"], f"    {stored['command']}", origin]
    parts.append(_rows(stored["result"]["rows"]))
    return "\n\n".join(part for part in parts if part)


def _rows(rows: Sequence[Mapping[str, Any]]) -> str:
    cells = figure_cells([BenchmarkRow.of_json(row) for row in rows])
    return table(tuple(cells[0]), [tuple(map(_plain, each.values())) for each in cells])


def _plain(text: str) -> str:
    return text.replace("[", "\\[").replace("<", "&lt;")
