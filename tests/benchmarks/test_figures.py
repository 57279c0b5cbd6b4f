"""A figure: when it is met, how people and programs read it."""

import io
import json

import numpy as np
import pytest
from rich.console import Console

from tests.benchmarks.figures import SHARE, BenchmarkRow, figure_table, rows_json


@pytest.mark.parametrize(
    ("value", "how", "met"),
    [
        (1.1, "min", True),
        (0.9, "min", True),
        (0.89, "min", False),
        (1.1, "max", True),
        (1.11, "max", False),
        (0.9, "within", True),
        (1.11, "within", False),
        (float("nan"), "max", False),
        (float("inf"), "min", False),
    ],
)
def test_met(value, how, met):
    assert BenchmarkRow("x", value, "s", 1.0, how, 0.1 + 1e-12).met is met


def test_values_have_a_median_and_a_high_percentile():
    row = BenchmarkRow.of_values("tick", "us", np.arange(101) * 1e-6, 1e6)
    assert (row.value, row.highest, row.n) == pytest.approx((50.0, 99.0, 101))
    nothing = BenchmarkRow.of_values("tick", "us", [])
    assert np.isnan(nothing.value) and nothing.n == 0


def test_a_share_is_of_1_for_programs_and_in_percent_for_people():
    row = BenchmarkRow.share("found", [True, True, False, True], "min", 0.9)
    assert (row.value, row.unit, row.n, row.met, row.goal) == (0.75, SHARE, 4, False, ">= 90 %")
    assert row.shown(row.value) == "75 %"
    assert BenchmarkRow.share("intervals", [True], "within", 0.945, 0.045).goal == "90 to 99 %"
    assert BenchmarkRow.share("found", [], "min", 0.9).met is False


def test_what_programs_read():
    document = rows_json(
        "x", [BenchmarkRow("a", float("nan"), "s", n=0), BenchmarkRow("b", 2.0, "s", 1.0, "max", note="why")]
    )
    bare, evaluated = json.loads(json.dumps(document))["rows"]
    assert bare == {"name": "a", "unit": "s", "median": None, "p99": None, "n": 0}
    assert evaluated["median"] == evaluated["p99"] == 2.0
    assert (evaluated["expected"], evaluated["how"], evaluated["met"], evaluated["note"]) == (1.0, "max", False, "why")


def test_a_table_has_no_empty_columns():
    shown = Console(file=io.StringIO(), width=80)
    shown.print(figure_table([BenchmarkRow("torque error", 0.25, "N*m", 0.2, "max"), BenchmarkRow("effort", 3.0, "A")]))
    text = shown.file.getvalue()
    assert [part.split() for part in text.splitlines()] == [
        ["figure", "value", "expected", "met"],
        ["torque", "error", "0.25", "N*m", "<=", "0.2", "N*m", "NO"],
        ["effort", "3", "A"],
    ]


@pytest.mark.parametrize(
    "row",
    [
        BenchmarkRow("x", 2.0, "s", 3.0, "max", 0.5, "why", p99=2.5, n=4),
        BenchmarkRow("only told", 1.25, "m"),
        BenchmarkRow.share("found", [True, False], "min", 0.9),
    ],
)
def test_what_programs_read_gives_the_figure_back(row):
    assert BenchmarkRow.of_json(json.loads(json.dumps(row.to_json()))) == row
