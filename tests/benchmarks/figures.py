"""Figures of benchmarks: what came out, what is expected, and how people and programs read it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table

from drake_tc.config.quoted import json_value
from drake_tc.report.figure_row import FigureRow, How
from drake_tc.types import FloatArray

SHARE = "share"
"""Unit of a share of 1, which people read in percent."""


@dataclass(frozen=True)
class BenchmarkRow(FigureRow):
    """A figure of several measured values: `value` is their median, NaN where there are none.

    Attributes:
        p99: 99th percentile of the values; None where it is the value.
        n: Number of values.
    """

    p99: float | None = None
    n: int = 1

    @classmethod
    def of_values(
        cls, name: str, unit: str, values: Sequence[float] | FloatArray, scale: float = 1.0
    ) -> "BenchmarkRow":
        """Median and 99th percentile of some values, each times `scale`; NaN of none."""
        if not len(values):
            return cls(name, float("nan"), unit, n=0)
        median, p99 = np.percentile(scale * np.asarray(values, dtype=float), [50, 99]).tolist()
        return cls(name, median, unit, p99=p99, n=len(values))

    @classmethod
    def share(
        cls, name: str, hits: Sequence[bool], how: How = "min", expected: float | None = None, tolerance: float = 0.0
    ) -> "BenchmarkRow":
        """Share of the hits that are true, of 1; NaN of none."""
        value = float(np.mean(hits)) if len(hits) else float("nan")
        return cls(name, value, SHARE, expected, how, tolerance, n=len(hits))

    @classmethod
    def of_json(cls, data: Mapping[str, Any]) -> "BenchmarkRow":
        """What `to_json` gave; null is NaN."""
        value, p99 = (float("nan") if data.get(name) is None else float(data[name]) for name in ("median", "p99"))
        given = {name: data[name] for name in ("unit", "expected", "how", "tolerance", "note", "n") if name in data}
        return cls(data["name"], value, p99=None if p99 == value or np.isnan(p99) else p99, **given)

    @property
    def highest(self) -> float:
        """The 99th percentile of the values."""
        return self.value if self.p99 is None else self.p99

    def shown(self, value: float) -> str:
        """A share in percent, and a dash where there is no value."""
        if np.isnan(value):
            return "–"
        return f"{self.number(value)} %" if self.unit == SHARE else super().shown(value)

    def number(self, value: float) -> str:
        """A share in percent."""
        return super().number(100.0 * value if self.unit == SHARE else value)

    def to_json(self) -> dict[str, Any]:
        """As `python -m tests.benchmarks NAME --json` prints it; a value that is not finite is null."""
        measured = {"median": json_value(float(self.value)), "p99": json_value(float(self.highest)), "n": self.n}
        told = {"note": self.note} if self.note else {}
        return {"name": self.name, "unit": self.unit, **measured, **self.judgement(), **told}


def rows_json(name: str, rows: Iterable[BenchmarkRow]) -> dict[str, Any]:
    """A whole table, as `python -m tests.benchmarks NAME --json` prints it."""
    return {"name": name, "rows": [row.to_json() for row in rows]}


def figure_cells(rows: Sequence[BenchmarkRow]) -> list[dict[str, str]]:
    """Heading to text, figure by figure; headings under which all texts would be empty are left out."""
    cells = [
        {
            "figure": row.name,
            "value": row.shown(row.value),
            "99 %": row.shown(row.highest) if row.p99 is not None else "",
            "n": str(row.n) if row.n != 1 else "",
            "expected": row.goal,
            "met": {None: "", True: "yes", False: "NO"}[row.met],
            "note": row.note,
        }
        for row in rows
    ]
    shown = [name for name in cells[0] if any(each[name] for each in cells)] if cells else []
    return [{name: each[name] for name in shown} for each in cells]


def figure_table(rows: Sequence[BenchmarkRow], title: str | None = None) -> Table:
    """One line a figure, with the columns of `figure_cells`."""
    cells = figure_cells(rows)
    table = Table(title=title, title_justify="left", box=None, padding=(0, 2))
    for heading in cells[0] if cells else ():
        table.add_column(heading, justify="left" if heading in ("figure", "note") else "right", overflow="fold")
    for each in cells:
        table.add_row(*map(escape, each.values()))
    return table
