"""One figure of a benchmark or of a paper's reproduction: what came out, what is expected, and whether it is met.

Figures as a table for people.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from rich.markup import escape
from rich.table import Table

from drake_tc.config.quoted import json_value
from drake_tc.types import FloatArray

How = Literal["min", "max", "within"]
SHARE = "share"
"""Unit of a share of 1, which people read in percent."""


def is_met(value: float, expected: float, how: How, tolerance: float) -> bool:
    """Whether a value is as expected; one that is not finite is not.

    Args:
        value: The figure.
        expected: What it should be.
        how: "min": at least `expected`; "max": at most; "within": off by at most `tolerance`.
        tolerance: Allowed beyond `expected` for "min" and "max" too.
    """
    if not np.isfinite(value):
        return False
    if how == "min":
        return bool(value >= expected - tolerance)
    if how == "max":
        return bool(value <= expected + tolerance)
    return bool(abs(value - expected) <= tolerance)


@dataclass(frozen=True)
class FigureRow:
    """One figure.

    Attributes:
        name: What was measured.
        value: What came out, in `unit`: the median where n values were measured; NaN where there is none.
        unit: Of value, expected and tolerance.
        expected: What it should be; None for a figure that is only reported.
        how: As in `is_met`.
        tolerance: As in `is_met`.
        note: What the figure rests on, or why it is not met.
        p99: 99th percentile of the values; None where it is the value.
        n: Number of values.
    """

    name: str
    value: float
    unit: str = ""
    expected: float | None = None
    how: How = "within"
    tolerance: float = 0.0
    note: str = ""
    p99: float | None = None
    n: int = 1

    @classmethod
    def of_values(cls, name: str, unit: str, values: Sequence[float] | FloatArray, scale: float = 1.0) -> "FigureRow":
        """Median and 99th percentile of some values, each times `scale`; NaN of none."""
        if not len(values):
            return cls(name, float("nan"), unit, n=0)
        median, p99 = np.percentile(scale * np.asarray(values, dtype=float), [50, 99]).tolist()
        return cls(name, median, unit, p99=p99, n=len(values))

    @classmethod
    def share(
        cls, name: str, hits: Sequence[bool], how: How = "min", expected: float | None = None, tolerance: float = 0.0
    ) -> "FigureRow":
        """Share of the hits that are true, of 1; NaN of none."""
        value = float(np.mean(hits)) if len(hits) else float("nan")
        return cls(name, value, SHARE, expected, how, tolerance, n=len(hits))

    @classmethod
    def of_json(cls, data: Mapping[str, Any]) -> "FigureRow":
        """What `to_json` gave; null is NaN."""
        value, p99 = (float("nan") if data.get(name) is None else float(data[name]) for name in ("median", "p99"))
        given = {name: data[name] for name in ("unit", "expected", "how", "tolerance", "note", "n") if name in data}
        return cls(data["name"], value, p99=None if p99 == value or np.isnan(p99) else p99, **given)

    @property
    def met(self) -> bool | None:
        """Whether the value is as expected; None where nothing is expected of it."""
        if self.expected is None:
            return None
        return is_met(self.value, self.expected, self.how, self.tolerance)

    @property
    def highest(self) -> float:
        """The 99th percentile of the values."""
        return self.value if self.p99 is None else self.p99

    @property
    def goal(self) -> str:
        """What is expected, for people: `>= 95 %`, `90 to 99 %`; empty where nothing is."""
        if self.expected is None:
            return ""
        if self.how == "within":
            return f"{self._number(self.expected - self.tolerance)} to {self.shown(self.expected + self.tolerance)}"
        return f"{'>=' if self.how == 'min' else '<='} {self.shown(self.expected)}"

    def shown(self, value: float) -> str:
        """A value in the figure's unit, for people; a share in percent."""
        unit = "%" if self.unit == SHARE else "" if self.unit in ("-", "1") else self.unit
        return f"{self._number(value)} {unit}".strip()

    def _number(self, value: float) -> str:
        return f"{100.0 * value:.4g}" if self.unit == SHARE else f"{value:.4g}"

    def judgement(self) -> dict[str, Any]:
        """Plain data of what is expected and whether it is met; nothing where nothing is."""
        if self.expected is None:
            return {}
        return {"expected": self.expected, "how": self.how, "tolerance": self.tolerance, "met": self.met}

    def to_json(self) -> dict[str, Any]:
        """As `bench --json` prints it; a value that is not finite is null."""
        measured = {"median": json_value(float(self.value)), "p99": json_value(float(self.highest)), "n": self.n}
        told = {"note": self.note} if self.note else {}
        return {"name": self.name, "unit": self.unit, **measured, **self.judgement(), **told}


def rows_json(name: str, rows: Iterable[FigureRow]) -> dict[str, Any]:
    """A whole table, as `bench --json` prints it."""
    return {"name": name, "rows": [row.to_json() for row in rows]}


def figure_cells(rows: Sequence[FigureRow]) -> list[dict[str, str]]:
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


def figure_table(rows: Sequence[FigureRow], title: str | None = None) -> Table:
    """One line a figure, with the columns of `figure_cells`."""
    cells = figure_cells(rows)
    table = Table(title=title, title_justify="left", box=None, padding=(0, 2))
    for heading in cells[0] if cells else ():
        table.add_column(heading, justify="left" if heading in ("figure", "note") else "right", overflow="fold")
    for each in cells:
        table.add_row(*map(escape, each.values()))
    return table
