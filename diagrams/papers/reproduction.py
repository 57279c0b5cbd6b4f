"""What a reproduction returns: rows that are met or not, tables for people, notes on misses."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from drake_tc.diagrams.scenarios.strict_yaml import from_mapping, read_mapping

from drake_tc.errors import ParamsError

How = Literal["min", "max", "within"]
Progress = Callable[[str, float], None]
EXPECTED = Path(__file__).parent / "expected"


@dataclass(frozen=True)
class Expectation:
    """What one row should be.

    Attributes:
        name: Of the row.
        expected: The printed or wanted value.
        how: "min": at least `expected`; "max": at most; "within": off by at most `tolerance`.
        tolerance: In the value's unit; allowed beyond `expected` for "min" and "max" too.
        unit: Of value, expected and tolerance.
        source: Page, table or figure it comes from, or the reason why it is asked for.
        reason: Why it is not met, where it is known not to be.
    """

    name: str
    expected: float
    how: How
    tolerance: float = 0.0
    unit: str = ""
    source: str = ""
    reason: str = ""

    def __post_init__(self) -> None:
        if self.how not in get_args(How):
            raise ParamsError(f"{self.name}: how: wanted one of {', '.join(get_args(How))}; got {self.how!r}")
        if not (np.isfinite(self.expected) and 0.0 <= self.tolerance < np.inf):
            raise ParamsError(
                f"{self.name}: wanted a finite expected value and tolerance, the latter not negative;"
                f" got {self.expected} and {self.tolerance}"
            )


@dataclass(frozen=True)
class Row:
    """One figure against what is expected of it; `met` is None where nothing is."""

    name: str
    value: float
    expectation: Expectation | None = None

    @property
    def met(self) -> bool | None:
        """Whether the value is as expected; a value that is not finite is not."""
        if self.expectation is None:
            return None
        wanted, slack = self.expectation.expected, self.expectation.tolerance
        if not np.isfinite(self.value):
            return False
        if self.expectation.how == "min":
            return bool(self.value >= wanted - slack)
        if self.expectation.how == "max":
            return bool(self.value <= wanted + slack)
        return bool(abs(self.value - wanted) <= slack)

    def to_json(self) -> dict[str, Any]:
        """Plain data; a value that is not finite is None; the expectation's fields only where there is one."""
        data: dict[str, Any] = {"name": self.name, "value": float(self.value) if np.isfinite(self.value) else None}
        if wanted := self.expectation:
            data |= {"unit": wanted.unit, "expected": wanted.expected, "how": wanted.how, "tolerance": wanted.tolerance}
            data |= {"met": self.met, "reason": "" if self.met else wanted.reason}
        return data


@dataclass(frozen=True)
class TextTable:
    """A table for people: title, headings, rows of text."""

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


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
    rows: tuple[Row, ...]
    tables: tuple[TextTable, ...] = ()
    notes: tuple[str, ...] = ()
    figures: Mapping[str, Callable[[Any], None]] | None = None

    def to_json(self) -> dict[str, Any]:
        """Plain data, as `reproduce --json` prints it: judged rows, and the other values beside them."""
        return {
            "id": self.id,
            "rows": [row.to_json() for row in self.rows if row.expectation],
            "others": [row.to_json() for row in self.rows if not row.expectation],
            "notes": list(self.notes),
        }


def expectations(file: str) -> dict[str, Expectation]:
    """The expected values beside the code: `expected/FILE.yaml`, a list under `rows`, by name.

    Raises:
        ParamsError: anything but a list under `rows`, a field that is unknown, missing or bad, or a name given twice.
    """
    path = EXPECTED / f"{file}.yaml"
    document = read_mapping(path)
    listed = document.get("rows")
    if set(document) != {"rows"} or not isinstance(listed, list) or not listed:
        raise ParamsError(f"{path}: wanted a list of expected values under `rows`, and no other key")
    rows = [from_mapping(Expectation, item, f"{path}: rows[{i}]") for i, item in enumerate(listed)]
    named = {row.name: row for row in rows}
    if len(named) != len(rows):
        raise ParamsError(f"{path}: a name is given twice")
    return named


def judged(values: Mapping[str, float], wanted: Mapping[str, Expectation]) -> tuple[Row, ...]:
    """Rows of `values`, in order, each with its expectation where there is one.

    Raises:
        ParamsError: an expectation that no value answers: it would silently count as met.
    """
    missing = sorted(set(wanted) - set(values))
    if missing:
        raise ParamsError(f"expected values without a computed one: {', '.join(missing)}")
    return tuple(Row(name, value, wanted.get(name)) for name, value in values.items())


def text_rows(
    names: Sequence[str], columns: Sequence[Sequence[float]], digits: str = ".3f"
) -> tuple[tuple[str, ...], ...]:
    """Rows of a TextTable: a name, then one number of each column."""
    return tuple((name, *(format(column[i], digits) for column in columns)) for i, name in enumerate(names))
