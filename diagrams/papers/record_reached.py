"""Puts computed values on record: `python -m drake_tc.diagrams.papers.record_reached RESULT.json ...`.

RESULT.json is what `drake-tc reproduce ID --json` printed, of one id or of all. In `PAPER/expected/*.yaml` every
evaluated row, and every row under `quoted`, gets the value that was computed as `reached`, to four digits. A
`reached_tolerance` that a row has stays. A row without one gets 2 % of the value (`--share 0.05`: 5 %), 0.1 % of the
expected value at least; a whole number, which may be a count, gets 0.1 % of it and never as much as one. Comments,
order and everything else of the file stay. What the record then contradicts is printed.
"""

import argparse
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from drake_tc.diagrams.papers.departures import departures
from drake_tc.diagrams.papers.expected_values import expectations, expected_file, expected_path, on_record
from drake_tc.errors import ParamsError
from drake_tc.report.figure_row import reproduced_row

SHARE, LEAST_SHARE, LESS_THAN_ONE = 0.02, 1e-3, 0.5
"""Of the value and of the expected value, for the tolerance of a row that has none; at most, of a whole number."""
NAME = re.compile(r'name: "([^"]*)"')
REACHED = re.compile(r", reached: [^,}]+")
TOLERANCE = re.compile(r", reached_tolerance: ([^,}]+)")
AFTER = re.compile(r'how: \w+(?:, tolerance: [^,}]+)?|name: "[^"]*"(?!.*\bhow:)')
"""Where the fields go: behind what is expected, or behind the name of a row that is not evaluated."""


def recorded_text(text: str, values: Mapping[str, float], share: float = SHARE) -> str:
    """The text of an expected file, one row a line, with the values on record; `share` for rows without a tolerance.

    Raises:
        ParamsError: a row without a value, or a value that is not finite.
    """
    return "\n".join(_recorded_line(line, values, share) for line in text.split("\n"))


def _recorded_line(line: str, values: Mapping[str, float], share: float) -> str:
    found = NAME.search(line)
    if line.lstrip().startswith("#") or not found:
        return line
    value = values.get(found.group(1))
    if value is None:
        raise ParamsError(f"{found.group(1)}: no finite value was computed that could be put on record")
    tolerance = TOLERANCE.search(line)
    expected = re.search(r"expected: ([^,}]+)", line)
    goal = float(expected.group(1)) if expected else 0.0
    kept = tolerance.group(1) if tolerance else _number(_tolerance(value, goal, share))
    line = TOLERANCE.sub("", REACHED.sub("", line))
    more = f", reached: {_number(value)}, reached_tolerance: {kept}"
    return AFTER.sub(lambda place: place.group() + more, line, count=1)


def _tolerance(value: float, expected: float, share: float) -> float:
    least = LEAST_SHARE * max(abs(value), abs(expected))
    return float(f"{min(least, LESS_THAN_ONE) if value == round(value) else max(share * abs(value), least):.2g}")


def _number(value: float) -> str:
    """To four digits, and as YAML reads a number: with a point, also before an exponent."""
    text = repr(float(f"{value:.4g}"))
    return text if "." in text else text.replace("e", ".0e")


def record(result: Mapping[str, Any], share: float = SHARE) -> list[str]:
    """Put one result on record; what the file then says against itself.

    Raises:
        ParamsError: see `recorded_text`; a row that is not on a line of its own, with its name in double quotes.
    """
    file = expected_file(result["id"])
    path = expected_path(file)
    values = {row["name"]: row["value"] for row in [*result["rows"], *result["others"]]}
    path.write_text(recorded_text(path.read_text("utf-8"), values, share), encoding="utf-8")
    recorded, expected = on_record(file), expectations(file)
    if left := sorted(set(expected) - set(recorded)):
        raise ParamsError(f"{path}: expected one row a line, with its name in double quotes: {', '.join(left)}")
    rows = [reproduced_row(name, item.reached, expected.get(name)) for name, item in recorded.items()]
    contradicted: list[str] = departures(rows, recorded)
    return contradicted


def main(arguments: list[str] | None = None) -> None:
    """Record the results in these files."""
    parser = argparse.ArgumentParser(prog="python -m drake_tc.diagrams.papers.record_reached", description=__doc__)
    parser.add_argument("results", nargs="+", type=Path)
    parser.add_argument("--share", type=float, default=SHARE, help="of a value, for rows without a tolerance")
    given = parser.parse_args(arguments)
    for path in given.results:
        found = json.loads(path.read_text("utf-8"))
        for result in found if isinstance(found, list) else [found]:
            for text in record(result, given.share):
                print(f"{result['id']}: {text}")


if __name__ == "__main__":
    main()
