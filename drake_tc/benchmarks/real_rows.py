"""One figure of a table on real data: what came out, what was expected, whether it was met."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from drake_tc.config.json_values import json_value
from drake_tc.report.reproduction import is_met

How = Literal["max", "within", "info"]


@dataclass(frozen=True)
class RealRow:
    """One figure.

    Attributes:
        name: `<what>/<where>`. value: what came out, in `unit`.
        expected: The figure to reach; None for a figure that is only reported.
        how: "max": at most `expected`; "within": no further from it than `tolerance`; "info": only reported.
        note: What the figure rests on, in a few words.
    """

    name: str
    value: float
    unit: str
    expected: float | None = None
    how: How = "info"
    tolerance: float = 0.0
    note: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the figure is reached; None when nothing is expected of it."""
        if self.expected is None or self.how == "info":
            return None
        return is_met(self.value, self.expected, self.how, self.tolerance)

    def to_json(self) -> dict[str, Any]:
        """As `drake-tc bench` prints it."""
        value = json_value(float(self.value))
        return {
            "name": self.name,
            "unit": self.unit,
            "median": value,
            "p99": value,
            "n": 1,
            "expected": self.expected,
            "how": self.how,
            "tolerance": self.tolerance,
            "met": self.met,
            "note": self.note,
        }


def rows_json(name: str, rows: Iterable[RealRow]) -> dict[str, Any]:
    """The whole table."""
    return {"name": name, "rows": [row.to_json() for row in rows]}


def set_folder(data: Path, name: str) -> Path:
    """The folder of a set: `data/name`, or `data` itself where it is the set."""
    return data / name if (data / name).is_dir() else data
