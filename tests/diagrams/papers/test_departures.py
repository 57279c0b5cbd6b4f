"""Whether rows are as recorded: misses with and without reason, values that changed, and how they get on record."""

import json

import numpy as np
import pytest

from drake_tc.diagrams.papers import expected_values, record_reached
from drake_tc.diagrams.papers.catalogue import REPRODUCTIONS
from drake_tc.diagrams.papers.departures import departures
from drake_tc.diagrams.papers.expected_values import expectations, expected_file, on_record
from drake_tc.diagrams.papers.record_reached import recorded_text
from drake_tc.errors import ParamsError
from drake_tc.report.figure_row import Expectation, OnRecord, reproduced_row

from .expected_files import expected_files

REACHED = OnRecord("x", 1.5, 0.1)
KNOWN_MISS = Expectation("x", 1.0, "max", reason="too warm", reached=1.5, reached_tolerance=0.1)
GOAL = Expectation("x", 2.0, "max", reached=1.5, reached_tolerance=0.1)


def said(value, expectation):
    return departures([reproduced_row("x", value, expectation)], {"x": REACHED})


@pytest.mark.parametrize("value", [1.5, 1.41, 1.59])
def test_a_miss_that_is_as_bad_as_recorded_is_accepted(value):
    assert said(value, KNOWN_MISS) == []


@pytest.mark.parametrize("value", [1.61, 3.0])
def test_a_miss_that_got_worse_is_not(value):
    (text,) = said(value, KNOWN_MISS)
    assert text.endswith("but 1.5 +/- 0.1 is on record")


def test_a_miss_that_got_better_by_more_than_its_tolerance_is_to_be_recorded_anew():
    (text,) = said(1.2, KNOWN_MISS)
    assert "1.5 +/- 0.1 is on record" in text


def test_a_miss_that_is_met_loses_its_reason():
    goes = "x: 1 is met; the reason of a miss has to go"
    assert goes in said(1.0, KNOWN_MISS)
    near = Expectation("x", 1.45, "max", reason="too warm", reached=1.5, reached_tolerance=0.1)
    assert said(1.44, near) == ["x: 1.44 is met; the reason of a miss has to go"]  # within the tolerance all the same


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("expectation", [KNOWN_MISS, GOAL, Expectation("x", 1.0, "min"), None])
def test_what_is_not_finite_is_never_accepted(value, expectation):
    assert said(value, expectation)
    if expectation:
        assert departures([reproduced_row("x", value, expectation)], {})


def test_a_miss_without_a_reason_is_not_accepted():
    assert departures([reproduced_row("x", 2.5, Expectation("x", 2.0, "max"))], {}) == [
        "x: 2.5 is a miss without a reason"
    ]


def test_a_met_row_and_one_that_is_not_judged_keep_to_the_record_too():
    assert said(1.5, GOAL) == said(1.5, None) == []
    for expectation in (GOAL, None):
        (text,) = said(1.7, expectation)
        assert "1.5 +/- 0.1 is on record" in text
    assert departures([reproduced_row("y", np.nan)], {}) == []  # neither evaluated nor quoted


def test_a_row_on_record_that_is_not_computed_is_told():
    assert departures([], {"x": REACHED}) == ["x: on record, but not computed"]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"reason": "too warm"}, "needs the value it has: `reached`"),
        ({"reached": np.nan}, "a finite value reached"),
        ({"reached": 1.0, "reached_tolerance": -0.1}, "not negative"),
        ({"reached": 1.0, "reached_tolerance": np.inf}, "finite tolerance"),
    ],
)
def test_what_is_on_record_is_checked(fields, message):
    with pytest.raises(ParamsError, match=message):
        Expectation("x", 1.0, "max", **fields)


# --- the committed files


@pytest.mark.parametrize("id_", REPRODUCTIONS)
def test_every_judged_row_is_on_record_and_the_record_agrees_with_itself(id_):
    file = expected_file(id_)
    wanted, recorded = expectations(file), on_record(file)
    assert set(wanted) <= set(recorded)
    assert (
        departures([reproduced_row(name, item.reached, wanted.get(name)) for name, item in recorded.items()], recorded)
        == []
    )


def test_every_expected_file_belongs_to_a_reproduction():
    assert {path.stem for path in expected_files()} == {expected_file(id_) for id_ in REPRODUCTIONS}


def test_a_name_is_judged_or_quoted_and_not_both(tmp_path, monkeypatch):
    text = "rows: [{name: a, expected: 1.0, how: min}]\nquoted: [{name: %s, reached: 2.0}]"
    monkeypatch.setattr(expected_values, "expected_path", lambda file: tmp_path / f"{file}.yaml")
    (tmp_path / "own.yaml").write_text(text % "b")
    assert on_record("own") == {"b": OnRecord("b", 2.0)}
    (tmp_path / "own.yaml").write_text(text % "a")
    with pytest.raises(ParamsError, match="evaluated and under `quoted`: a"):
        on_record("own")


# --- putting on record

FILE = """# A comment, name: "no row".
rows:
  - {name: "a [N m], K6 = 1", expected: 2.0, how: max, tolerance: 0.1, unit: "-", source: "p. 7"}
  - {name: "b", expected: 4, how: min, reached: 3.0, source: "p. 8", reason: &why "it is, as said, warm"}
  - {name: "c", expected: 1.0, how: within, reached: 0.9, reached_tolerance: 0.3, source: "p. 9", reason: *why}
quoted:
  - {name: "d"}
"""
ROWS = """# A comment, name: "no row".
rows:
  - {name: "a [N m], K6 = 1", expected: 2.0, how: max, tolerance: 0.1, reached: 1.235, reached_tolerance: 0.025, unit: "-", source: "p. 7"}
  - {name: "b", expected: 4, how: min, reached: 2.0, reached_tolerance: 0.004, source: "p. 8", reason: &why "it is, as said, warm"}
  - {name: "c", expected: 1.0, how: within, reached: 1.5e-05, reached_tolerance: 0.3, source: "p. 9", reason: *why}
quoted:
  - {name: "d", reached: 1.0e-07, reached_tolerance: 2.0e-09}
"""  # noqa: E501
VALUES = {"a [N m], K6 = 1": 1.23456, "b": 2.0, "c": 1.5e-5, "d": 1e-7, "e": np.nan}


def test_values_are_put_on_record_and_everything_else_stays():
    assert recorded_text(FILE, VALUES) == ROWS
    assert recorded_text(ROWS, VALUES) == ROWS
    wider = recorded_text(FILE, VALUES, share=0.1)
    assert "reached: 1.235, reached_tolerance: 0.12" in wider and "reached: 1.5e-05, reached_tolerance: 0.3" in wider
    assert "reached: 3000.0, reached_tolerance: 0.5" in recorded_text(FILE, VALUES | {"b": 3000.0})  # it may be a count


def test_a_row_without_a_finite_value_cannot_be_recorded():
    with pytest.raises(ParamsError, match="b: no finite value"):
        recorded_text(FILE, VALUES | {"b": None})


def test_a_row_of_several_lines_is_refused(tmp_path, monkeypatch):
    for module in (expected_values, record_reached):
        monkeypatch.setattr(module, "expected_path", lambda file: tmp_path / f"{file}.yaml")
    (tmp_path / "x_one.yaml").write_text("rows:\n  - name: b\n    expected: 4\n    how: min\n")
    with pytest.raises(ParamsError, match="expected one row a line, with its name in double quotes: b"):
        record_reached.record({"id": "X.one", "rows": [{"name": "b", "value": 5.0}], "others": []})


def test_a_result_file_is_recorded_and_what_it_contradicts_is_printed(tmp_path, monkeypatch, capsys):
    for module in (expected_values, record_reached):
        monkeypatch.setattr(module, "expected_path", lambda file: tmp_path / f"{file}.yaml")
    (tmp_path / "x_one.yaml").write_text(FILE)
    rows = [{"name": name, "value": VALUES[name]} for name in ("a [N m], K6 = 1", "b", "c")]
    result = {"id": "X.one", "rows": rows, "others": [{"name": "d", "value": 1e-7}, {"name": "e", "value": None}]}
    (tmp_path / "result.json").write_text(json.dumps([result]))
    record_reached.main([str(tmp_path / "result.json")])
    assert on_record("x_one")["a [N m], K6 = 1"] == OnRecord("a [N m], K6 = 1", 1.235, 0.025)
    assert capsys.readouterr().out == ""
    rows[1]["value"] = 5.0
    (tmp_path / "result.json").write_text(json.dumps(result))
    record_reached.main([str(tmp_path / "result.json")])
    assert capsys.readouterr().out == "X.one: b: 5 is met; the reason of a miss has to go\n"
