"""The gate: one command that scores the diagnosis on everything that it has to reach, for one engine or two.

    python -m tests.benchmarks gate --engine rules --engine evidence --size full --out FOLDER --store FILE

Each part gives rows: a name, a value, what is to be reached, and whether it is. Results are kept as JSON, by engine and
part, with commit, date, seed and size; parts that are run later join the file.
"""

import json
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from drake_tc.config.quoted import did_you_mean
from drake_tc.errors import ParamsError
from drake_tc.report.figure_row import FigureRow
from tests.benchmarks.gate_parts import (
    GateRuns,
    arm_rows,
    blind_rows,
    coverage_rows,
    hard_rows_of,
    leg_rows,
    time_rows,
)
from tests.benchmarks.gate_real import real_rows

ENGINES = ("rules", "evidence")
ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT.parent / "shared" / "data"
"""Folder of the public data sets."""
PARTS: Mapping[str, Callable[[GateRuns], list[FigureRow]]] = {
    "blind": blind_rows,
    "hard": hard_rows_of,
    "coverage": coverage_rows,
    "real": lambda runs: real_rows(runs.data, runs.size, runs.options, runs.progress),
    "arms": arm_rows,
    "leg": leg_rows,
    "time": time_rows,
}
STORED = Path(__file__).parent / "gate_rules.json"
"""The former engine's result."""


def chosen_parts(names: Sequence[str]) -> list[str]:
    """These parts in the order of the gate; all where none is named.

    Raises:
        ParamsError: An unknown part.
    """
    for name in names:
        if name not in PARTS:
            raise ParamsError(f"no part {name!r} of the gate{did_you_mean(name, PARTS)}; parts: {', '.join(PARTS)}")
    return [name for name in PARTS if not names or name in names]


def run_part(name: str, runs: GateRuns) -> dict[str, Any]:
    """One part's rows, and what they rest on."""
    begin = time.perf_counter()
    rows = PARTS[name](runs)
    return {
        "size": runs.size,
        "seed": runs.seed,
        "commit": _commit(),
        "date": datetime.now(UTC).date().isoformat(),
        "seconds": round(time.perf_counter() - begin, 1),
        "rows": [row.to_json() for row in rows],
    }


def _commit() -> str:
    """Of the work tree, with a mark where the library has changes that are not committed."""

    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()

    changed = git("status", "--porcelain", "--untracked-files=no", "--", "drake_tc")
    return git("rev-parse", "HEAD") + ("+changes" if changed else "")


Results = dict[str, dict[str, dict[str, Any]]]
"""By engine, then by part."""


def load_results(path: Path) -> Results:
    """The results of a file; empty where there is none.

    Raises:
        ParamsError: A file that holds something else.
    """
    if not path.exists():
        return {}
    try:
        found: Results = json.loads(path.read_text(encoding="utf-8"))["engines"]
    except (ValueError, KeyError, TypeError) as error:
        raise ParamsError(f"{path}: expected results of the gate, {{'engines': ...}}; {error}") from error
    return found


def store_results(path: Path, results: Results) -> None:
    """Write results into a file; those of other engines and parts in it stay."""
    kept = load_results(path)
    for engine, parts in results.items():
        kept[engine] = kept.get(engine, {}) | parts
    path.write_text(json.dumps({"name": "gate", "engines": kept}, indent=1) + "\n", encoding="utf-8")


def side_by_side(results: Results) -> list[tuple[str, ...]]:
    """Cells of the table: part and figure, what is to be reached, and value and mark of each engine.

    An engine has no value of a figure whose part it was not run on.
    """
    engines = list(results)
    parts = [name for name in PARTS if any(name in results[engine] for engine in engines)]
    cells: list[tuple[str, ...]] = []
    for part in parts:
        by_engine = [
            {row["name"]: FigureRow.of_json(row) for row in results[engine].get(part, {}).get("rows", [])}
            for engine in engines
        ]
        for name in dict.fromkeys(name for rows in by_engine for name in rows):
            own = [rows.get(name) for rows in by_engine]
            reach = next(_reach(row) for row in own if row is not None)
            cells.append((f"{part}: {name}", reach, *(text for row in own for text in _shown(row))))
    return cells


def _reach(row: FigureRow) -> str:
    if row.expected is None:
        return ""
    factor = 100.0 if row.unit == "share" else 1.0
    if row.how == "within":
        return f"{factor * (row.expected - row.tolerance):.4g} to {factor * (row.expected + row.tolerance):.4g}"
    return f"{'>=' if row.how == 'min' else '<='} {factor * row.expected:.4g}"


def _shown(row: FigureRow | None) -> tuple[str, str]:
    if row is None or not row.n:
        return "-", ""
    met = {True: "yes", False: "NO", None: ""}[row.met]
    if row.unit == "share":
        return f"{100.0 * row.value:.1f} % of {row.n}", met
    return f"{row.value:.3g} {row.unit}".removesuffix(" -"), met
