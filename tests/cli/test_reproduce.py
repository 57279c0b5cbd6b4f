"""`drake-tc reproduce`: the contract of its JSON, its tables and figures, misses that stay visible, refusals.

Reproductions here are stubs: what they compute is tested in `tests/diagrams/papers/test_papers.py`.
"""

import json

import pytest

from drake_tc import registry
from drake_tc.report.figure_row import Expectation, Reproduction, reproduced_row
from drake_tc.types import TextTable

ROWS = (
    reproduced_row("met [1]", 2.5, Expectation("met [1]", 2.0, "min", unit="N", source="Table 9")),
    reproduced_row(
        "missed with a reason",
        3.0,
        Expectation("missed with a reason", 1.0, "max", 0.5, reason="too [warm] a day", reached=3.0),
    ),
    reproduced_row("missed without", float("nan"), Expectation("missed without", 1.0, "within", 0.1)),
    reproduced_row("not evaluated", 4.0),
)
HEADINGS = ("joint", "servo", "K6 = 1", "K6 = 0.5", "K6 = 0.25")
TABLE = TextTable("Table 9 [mrad]", HEADINGS, (("r_ankle_pitch", "12.3456", "1.2345", "2.3456", "3.4567"),))


def draw(figure):
    figure.subplots().plot([0.0, 1.0], [0.0, 1.0])


@pytest.fixture
def asked(monkeypatch):
    """Two reproductions that say which seeds they were given."""
    seeds = []

    def stub(id_):
        def reproduce(seed, progress):
            seeds.append((id_, seed))
            progress("half way", 0.5)
            return Reproduction(id_, ROWS, (TABLE,), ("Simulated [so far].",), {f"{id_}_figure": draw})

        return reproduce

    monkeypatch.setattr(registry, "registered", lambda group: {"X.one": "X.one", "X.two": "X.two"})
    monkeypatch.setattr(registry, "loaded", stub)
    return seeds


def test_json_is_the_contract(invoke, asked):
    outcome = invoke("reproduce", "X.one", "--seed", 7, "--json")
    assert outcome.code == 0 and outcome.err == ""
    assert asked == [("X.one", 7)]
    found = json.loads(outcome.out, parse_constant=pytest.fail)  # NaN is no JSON
    assert found["id"] == "X.one"
    assert [row["name"] for row in found["rows"]] == [row.name for row in ROWS[:3]]
    for row, wanted in zip(found["rows"], ROWS, strict=False):
        assert {"name", "value", "expected", "how", "tolerance", "met"} <= set(row)
        assert row["how"] in ("min", "max", "within")
        assert isinstance(row["met"], bool) and isinstance(row["expected"], float)
        assert row["tolerance"] == wanted.tolerance
    assert [row["value"] for row in found["rows"]] == [2.5, 3.0, None]
    assert [row["met"] for row in found["rows"]] == [True, False, False]
    assert [row["reason"] for row in found["rows"]] == ["", "too [warm] a day", ""]
    assert found["others"] == [{"name": "not evaluated", "value": 4.0}]
    assert found["notes"] == ["Simulated [so far]."]


def test_all_runs_each_once_and_gives_a_list(invoke, asked):
    found = json.loads(invoke("reproduce", "all", "--json").out)
    assert [one["id"] for one in found] == ["X.one", "X.two"]
    assert asked == [("X.one", 0), ("X.two", 0)]


def test_tables_on_stdout_progress_on_stderr_and_no_miss_hidden(invoke, asked):
    outcome = invoke("reproduce", "X.one")
    assert outcome.code == 0
    assert outcome.err == "reproduce X.one: half way\n"
    lines = outcome.out.splitlines()
    assert lines[0].strip() == "Table 9 [mrad]"
    assert lines[1].split() == ["joint", "servo", "K6", "=", "1", "K6", "=", "0.5", "K6", "=", "0.25"]
    assert lines[2].split() == list(TABLE.rows[0])
    evaluated = {line.rsplit(maxsplit=1)[0].split("  ")[0].strip(): line.split()[-1] for line in lines[5:9]}
    assert evaluated == {"met [1]": "yes", "missed with a reason": "NO", "missed without": "NO", "figure": "met"}
    assert ">= 2 N" in outcome.out and "<= 1" in outcome.out and "0.9 to 1.1" in outcome.out
    assert "not met: missed with a reason: too [warm] a day" in lines
    assert "not met: missed without: no reason known" in lines
    assert "Simulated [so far]." in lines


@pytest.mark.parametrize("columns", [20, 40, 60, 70, 80, 200])
def test_no_terminal_hides_a_column(invoke, asked, monkeypatch, columns):
    names = [f"a_long_name_of_joint_{i}" for i in range(6)]
    table = TextTable("wide", ("imperfection", *names), (("encoder quantisation", *(f"{i}.125" for i in range(6))),))
    result = Reproduction("X.one", ROWS[:1], (table,))
    monkeypatch.setattr(registry, "registered", lambda group: {"X.one": ""})
    monkeypatch.setattr(registry, "loaded", lambda text: lambda seed, progress: result)
    monkeypatch.setenv("COLUMNS", str(columns))
    out = invoke("reproduce", "X.one").out
    assert max(map(len, out.splitlines())) <= columns
    assert {f"{i}.125" for i in range(6)} <= set(out.replace(",", "").split())


def test_figures_are_files(invoke, asked, tmp_path):
    folder = tmp_path / "new" / "figures"
    outcome = invoke("reproduce", "all", "--figures", folder)
    files = [folder / "X.one_figure.png", folder / "X.two_figure.png"]
    assert sorted(folder.glob("[!.]*")) == files
    assert all(path.read_bytes().startswith(b"\x89PNG\r\n") for path in files)
    assert all(str(path) in outcome.out.replace("\n", "") for path in files)
    as_json = invoke("reproduce", "X.one", "--figures", folder, "--json")
    assert json.loads(as_json.out)["id"] == "X.one"
    assert as_json.err == f"{files[0]}\n"


def test_a_folder_that_cannot_be_made_is_told_before_anything_runs(invoke, asked, tmp_path):
    (tmp_path / "taken").write_text("a file")
    line = invoke("reproduce", "X.one", "--figures", tmp_path / "taken").refusal()
    assert "taken" in line and "folder" in line
    assert asked == []


def test_a_figure_that_cannot_be_written(invoke, asked, tmp_path):
    (tmp_path / "X.one_figure.png").mkdir()
    outcome = invoke("reproduce", "X.one", "--figures", tmp_path, "--json")
    assert "X.one_figure.png: cannot be written" in outcome.refusal()


def test_an_unknown_id_lists_what_there_is(invoke):
    line = invoke("reproduce", "A.table9").refusal()
    assert "'A.table9'" in line
    for id_ in ("A.table2", "A.table3", "A.fig5", "A.fig6", "A.stability", "A.torque_estimate", "all"):
        assert id_ in line


@pytest.mark.parametrize(
    "arguments", [[], ["A.table2", "--seed", "-1"], ["A.table2", "--seed", "x"], ["A.fig5", "more"]]
)
def test_a_slip_is_one_line(invoke, arguments):
    outcome = invoke("reproduce", *arguments)
    outcome.refusal()
    assert outcome.err.count("\n") == 1


def test_without_the_repository_reproduce_says_where_the_tables_are(invoke, monkeypatch):
    monkeypatch.setattr(registry, "papers_are_here", lambda: False)
    registry.registered.cache_clear()
    try:
        for name in ("A.table2", "all"):
            outcome = invoke("reproduce", name)
            assert outcome.code == 2 and outcome.out == ""
            assert "are in the repository (diagrams/papers)" in outcome.err
    finally:
        registry.registered.cache_clear()
