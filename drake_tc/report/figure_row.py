"""Figures of papers' reproductions: what came out, what is expected, and whether it is met."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args

import numpy as np

from drake_tc.config.quoted import json_value
from drake_tc.config.records import read_record
from drake_tc.errors import ParamsError
from drake_tc.loops.scenarios import read_mapping
from drake_tc.types import TextTable

How = Literal["min", "max", "within"]


@dataclass(frozen=True)
class FigureRow:
    """One figure.

    Attributes:
        name: What was measured.
        value: What came out, in `unit`; NaN where there is none.
        unit: Of value, expected and tolerance.
        expected: What it should be; None for a figure that is only reported.
        how: "min": at least `expected`; "max": at most; "within": off by at most `tolerance`.
        tolerance: Allowed beyond `expected` for "min" and "max" too.
        note: What the figure rests on, or why it is not met.
    """

    name: str
    value: float
    unit: str = ""
    expected: float | None = None
    how: How = "within"
    tolerance: float = 0.0
    note: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the value is as expected; one that is not finite is not. None where nothing is expected of it."""
        if self.expected is None:
            return None
        low, high = self.expected - self.tolerance, self.expected + self.tolerance
        enough, few = self.how == "max" or self.value >= low, self.how == "min" or self.value <= high
        return bool(np.isfinite(self.value) and enough and few)

    @property
    def goal(self) -> str:
        """What is expected, for people: `>= 95 %`, `90 to 99 %`; empty where nothing is."""
        if self.expected is None:
            return ""
        if self.how == "within":
            return f"{self.number(self.expected - self.tolerance)} to {self.shown(self.expected + self.tolerance)}"
        return f"{'>=' if self.how == 'min' else '<='} {self.shown(self.expected)}"

    def shown(self, value: float) -> str:
        """A value in the figure's unit, for people."""
        return f"{self.number(value)} {'' if self.unit in ('-', '1') else self.unit}".strip()

    def number(self, value: float) -> str:
        """A value as `shown` writes it before the unit."""
        return f"{value:.4g}"

    def judgement(self) -> dict[str, Any]:
        """Plain data of what is expected and whether it is met; nothing where nothing is."""
        if self.expected is None:
            return {}
        return {"expected": self.expected, "how": self.how, "tolerance": self.tolerance, "met": self.met}


Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class OnRecord:
    """The value of a row as it was last computed with seed 0, and as texts quote it.

    Attributes:
        name: Of the row.
        reached: The value.
        reached_tolerance: How far a newly computed value may be from it, to either side, in the value's unit.
    """

    name: str
    reached: float
    reached_tolerance: float = 0.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.reached) and 0.0 <= self.reached_tolerance < np.inf):
            raise ParamsError(
                f"{self.name}: expected a finite value reached and a finite tolerance of it, not negative,"
                f" got {self.reached} and {self.reached_tolerance}"
            )


@dataclass(frozen=True)
class Expectation:
    """What one row should be.

    Attributes:
        name: Of the row.
        expected: The value that the paper prints, or our own goal.
        how: "min": at least `expected`; "max": at most; "within": off by at most `tolerance`.
        tolerance: In the value's unit; allowed beyond `expected` for "min" and "max" too.
        unit: Of value, expected and tolerance.
        source: Page, table or figure it comes from, or the reason for the requirement.
        reason: Why it is not met, where it is known not to be; `reached` then says by how much.
        reached: The value that was last computed with seed 0 and put on record, as texts quote it.
        reached_tolerance: How far a newly computed value may be from `reached`, to either side.
    """

    name: str
    expected: float
    how: How
    tolerance: float = 0.0
    unit: str = ""
    source: str = ""
    reason: str = ""
    reached: float | None = None
    reached_tolerance: float = 0.0

    def __post_init__(self) -> None:
        if self.how not in get_args(How):
            raise ParamsError(f"{self.name}: how: expected one of {', '.join(get_args(How))}, got {self.how!r}")
        if not (np.isfinite(self.expected) and 0.0 <= self.tolerance < np.inf):
            raise ParamsError(
                f"{self.name}: expected a finite expected value and tolerance, the latter not negative,"
                f" got {self.expected} and {self.tolerance}"
            )
        if self.reason and self.reached is None:
            raise ParamsError(f"{self.name}: a known miss, one with a reason, needs the value it has: `reached`")
        if self.reached is not None:
            OnRecord(self.name, self.reached, self.reached_tolerance)  # refuses what is not finite

    @property
    def on_record(self) -> "OnRecord | None":
        """The value that was last computed, where one is on record."""
        return None if self.reached is None else OnRecord(self.name, self.reached, self.reached_tolerance)


Named = TypeVar("Named", OnRecord, Expectation)


def reproduced_row(name: str, value: float, expected: Expectation | None = None) -> FigureRow:
    """One computed value beside what is expected of it, if anything is; the note is the reason of a known miss."""
    if expected is None:
        return FigureRow(name, value)
    return FigureRow(
        name, value, expected.unit, expected.expected, expected.how, expected.tolerance, note=expected.reason
    )


def row_json(row: FigureRow) -> dict[str, Any]:
    """As `reproduce --json` prints it; a value that is not finite is null."""
    data: dict[str, Any] = {"name": row.name, "value": json_value(float(row.value))}
    if row.expected is None:
        return data
    return data | {"unit": row.unit, **row.judgement(), "reason": "" if row.met else row.note}


@dataclass(frozen=True)
class Reproduction:
    """A table or figure of a paper, computed anew.

    Attributes:
        id: As the command takes it.
        rows: Figures against expectations.
        tables: For people.
        notes: Sentences: what was simulated, and why a row is missed.
        figures: Name to a function that draws into a matplotlib Figure.
    """

    id: str
    rows: tuple[FigureRow, ...]
    tables: tuple[TextTable, ...] = ()
    notes: tuple[str, ...] = ()
    figures: Mapping[str, Callable[[Any], None]] | None = None

    def to_json(self) -> dict[str, Any]:
        """Plain data, as `reproduce --json` prints it: evaluated rows, and the other values beside them."""
        return {
            "id": self.id,
            "rows": [row_json(row) for row in self.rows if row.expected is not None],
            "others": [row_json(row) for row in self.rows if row.expected is None],
            "notes": list(self.notes),
        }


def read_expectations(path: Path) -> dict[str, Expectation]:
    """The expected values in a YAML file, a list under `rows`, by name.

    Raises:
        ParamsError: as `_read` and `_by_name`.
    """
    rows, _ = _read(path)
    return _by_name(Expectation, rows, path, "rows")


def read_on_record(path: Path) -> dict[str, OnRecord]:
    """The values on record in a YAML file, by name: of evaluated rows, and of the rows under `quoted`.

    Rows under `quoted` are not evaluated, but a text quotes them.

    Raises:
        ParamsError: as `_read` and `_by_name`, or a name that is under `rows` and under `quoted`.
    """
    rows, quoted = _read(path)
    with_goal = _by_name(Expectation, rows, path, "rows")
    others = _by_name(OnRecord, quoted, path, "quoted")
    if twice := sorted(set(with_goal) & set(others)):
        raise ParamsError(f"{path}: evaluated and under `quoted`: {', '.join(twice)}")
    return {name: row.on_record for name, row in with_goal.items() if row.on_record} | others


def _read(path: Path) -> tuple[list[object], list[object]]:
    """The file's `rows`, and what is under `quoted`, if anything is."""
    document = read_mapping(path)
    lists = [document.get("rows"), document.get("quoted", [None])]
    if not set(document) <= {"rows", "quoted"} or not all(isinstance(rows, list) and rows for rows in lists):
        raise ParamsError(
            f"{path}: expected a list of expected values under `rows`, perhaps one of values on record under `quoted`,"
            " and no other key"
        )
    return document["rows"], document.get("quoted", [])


def _by_name(kind: type[Named], listed: list[object], path: Path, key: str) -> dict[str, Named]:
    """The list's items as `kind`, by name."""
    rows = [read_record(kind, item, str(path), within=f"{key}[{i}]") for i, item in enumerate(listed)]
    named = {row.name: row for row in rows}
    if len(named) != len(rows):
        raise ParamsError(f"{path}: a name is given twice")
    return named


def evaluated(values: Mapping[str, float], expected: Mapping[str, Expectation]) -> tuple[FigureRow, ...]:
    """Rows of `values`, in order, each with its expectation where there is one.

    Raises:
        ParamsError: an expectation that no value answers: it would silently count as met.
    """
    missing = sorted(set(expected) - set(values))
    if missing:
        raise ParamsError(f"expected values without a computed one: {', '.join(missing)}")
    return tuple(reproduced_row(name, value, expected.get(name)) for name, value in values.items())
