"""Stored benchmark results: each belongs to a command of the list, and has what its table needs."""

import json

import pytest
import typer
import yaml

from tests.benchmarks.__main__ import PROGRAM, app

from .conftest import DOCS

benchmarks = pytest.importorskip("site_pages.benchmarks")
COMMANDS = yaml.safe_load((DOCS / "benchmarks" / "commands.yaml").read_text("utf-8"))
KNOWN = typer.main.get_command(app).commands
STORED = sorted((DOCS / "benchmarks").glob("*.json"))


@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_a_stored_result_is_of_a_known_command(path):
    stored = json.loads(path.read_text("utf-8"))
    assert stored["command"] == COMMANDS[path.stem]["command"]
    assert len(stored["commit"]) == 40 and len(stored["date"]) == 10
    assert stored["result"]["rows"] and set(stored["machine"]) == {"CPUs", "Python", "Drake"}


def test_every_command_is_one_of_the_program():
    for said in COMMANDS.values():
        program, name, *options = said["command"].removeprefix(PROGRAM).split(" ")
        assert not program
        KNOWN[name].make_context(name, options)


def test_the_page_knows_every_benchmark_of_the_program():
    assert {said["command"].removeprefix(PROGRAM).split()[0] for said in COMMANDS.values()} == set(KNOWN)


def test_the_table_shows_every_stored_row(monkeypatch, tmp_path):
    stored = {
        "title": "Time of a tick",
        "about": "",
        "command": "python -m tests.benchmarks leg --json",
        "commit": "a" * 40,
        "date": "2026-01-02",
        "machine": {"CPUs": 2},
        "result": {
            "rows": [
                {"name": "tick", "unit": "s", "median": 1.25e-4, "p99": 2e-4, "n": 40},
                {"name": "whole", "unit": "share", "median": 0.5, "expected": 0.9, "how": "min", "met": False},
            ]
        },
    }
    (tmp_path / "leg.json").write_text(json.dumps(stored), encoding="utf-8")
    monkeypatch.setattr(benchmarks, "STORE", tmp_path)
    text = benchmarks.overview()
    assert "| tick | 0.000125 s | 0.0002 s | 40 |  |  |" in text
    assert "| whole | 50 % |  |  | >= 90 % | NO |" in text
    assert "`aaaaaaaaaaaa`" in text and "2026-01-02" in text and "python -m tests.benchmarks leg" in text


def test_the_page_names_the_benchmarks_without_a_result(monkeypatch, tmp_path):
    listed = tmp_path / "commands.yaml"
    said = "qp: {title: Programs, about: '', command: python -m tests.benchmarks qp --json}\n"
    listed.write_text(said, encoding="utf-8")
    monkeypatch.setattr(benchmarks, "STORE", tmp_path)
    monkeypatch.setattr(benchmarks, "COMMANDS", listed)
    text = benchmarks.overview()
    assert "1 of the 1 benchmarks" in text and "| qp | Programs | `python -m tests.benchmarks qp --json` |" in text
    stored = {"title": "Programs", "about": "", "command": "python -m tests.benchmarks qp --json", "commit": "a" * 40}
    stored |= {"date": "2026-01-02", "machine": {"CPUs": 2}}
    stored |= {"result": {"rows": [{"name": "a", "unit": "s", "median": 1e-3, "p99": 2e-3, "n": 3}]}}
    (tmp_path / "qp.json").write_text(json.dumps(stored), encoding="utf-8")
    assert "without a stored result" not in benchmarks.overview()
