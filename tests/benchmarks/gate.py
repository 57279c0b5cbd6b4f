"""The gate: one command that scores the diagnosis on everything that it has to reach.

    python -m tests.benchmarks gate --size full --out FOLDER --store tests/benchmarks/gate.json

Each part gives rows: a name, a value, what is to be reached, and whether it is. Results are kept as JSON, by part, with
commit, date, seed and size; parts that are run later join the file. The stored ones are shown beside new ones.
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
from tests.benchmarks.figures import BenchmarkRow
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

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT.parent / "shared" / "data"
"""Folder of the public data sets."""
PARTS: Mapping[str, Callable[[GateRuns], list[BenchmarkRow]]] = {
    "blind": blind_rows,
    "hard": hard_rows_of,
    "coverage": coverage_rows,
    "real": lambda runs: real_rows(runs.data, runs.size, runs.progress),
    "arms": arm_rows,
    "leg": leg_rows,
    "time": time_rows,
}
STORED = Path(__file__).parent / "gate.json"
"""Results of the last version that was scored."""


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


Results = dict[str, dict[str, Any]]
"""By part."""


def load_results(path: Path) -> Results:
    """The results of a file; empty where there is none.

    Raises:
        ParamsError: A file that holds something else.
    """
    if not path.exists():
        return {}
    try:
        found: Results = json.loads(path.read_text(encoding="utf-8"))["parts"]
    except (ValueError, KeyError, TypeError) as error:
        raise ParamsError(f"{path}: expected results of the gate, {{'parts': ...}}; {error}") from error
    return found


def store_results(path: Path, results: Results) -> None:
    """Write results into a file; other parts in it stay."""
    kept = load_results(path) | results
    path.write_text(json.dumps({"name": "gate", "parts": kept}, indent=1) + "\n", encoding="utf-8")


def table(results: Results, stored: Results) -> list[tuple[str, ...]]:
    """Cells of the table: part and figure, what is to be reached, and value and mark, new and stored.

    A stored part is shown where it is of the same size and seed.
    """
    cells: list[tuple[str, ...]] = []
    for part in (name for name in PARTS if name in results):
        new, old = results[part], stored.get(part, {})
        alike = all(old.get(key) == new[key] for key in ("size", "seed"))
        before = {row["name"]: BenchmarkRow.of_json(row) for row in old["rows"]} if alike else {}
        for row in map(BenchmarkRow.of_json, new["rows"]):
            cells.append((f"{part}: {row.name}", _reach(row), *_shown(row), *_shown(before.get(row.name))))
    return cells


def _reach(row: BenchmarkRow) -> str:
    if row.expected is None:
        return ""
    factor = 100.0 if row.unit == "share" else 1.0
    if row.how == "within":
        return f"{factor * (row.expected - row.tolerance):.4g} to {factor * (row.expected + row.tolerance):.4g}"
    return f"{'>=' if row.how == 'min' else '<='} {factor * row.expected:.4g}"


def _shown(row: BenchmarkRow | None) -> tuple[str, str]:
    if row is None or not row.n:
        return "-", ""
    met = {True: "yes", False: "NO", None: ""}[row.met]
    if row.unit == "share":
        return f"{100.0 * row.value:.1f} % of {row.n}", met
    return f"{row.value:.3g} {row.unit}".removesuffix(" -"), met
