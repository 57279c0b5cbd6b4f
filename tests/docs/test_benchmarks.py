"""Stored benchmark results: each belongs to a command of the list, and has what its table needs."""

import json

import pytest
import yaml

from .conftest import DOCS

benchmarks = pytest.importorskip("site_pages.benchmarks")
COMMANDS = yaml.safe_load((DOCS / "benchmarks" / "commands.yaml").read_text("utf-8"))
STORED = sorted((DOCS / "benchmarks").glob("*.json"))


@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_a_stored_result_is_of_a_known_command(path):
    stored = json.loads(path.read_text("utf-8"))
    assert stored["command"] == COMMANDS[path.stem]["command"]
    assert len(stored["commit"]) == 40 and len(stored["date"]) == 10
    assert stored["result"]["rows"] and set(stored["machine"]) == {"CPUs", "Python", "Drake"}


def test_every_command_is_one_of_the_program():
    from site_pages.commands import arguments_of, commands

    known = commands()
    for said in COMMANDS.values():
        words = arguments_of(said["command"])
        known[" ".join(words[:2])].make_context("bench", words[2:])


def test_the_page_knows_every_benchmark_of_the_program():
    from site_pages.commands import commands

    listed = {" ".join(said["command"].split()[1:3]) for said in COMMANDS.values()}
    assert listed == {name for name in commands() if name.startswith("bench ")}


def test_the_table_shows_every_stored_row(monkeypatch, tmp_path):
    stored = {
        "title": "Time of a tick",
        "about": "",
        "command": "drake-tc bench leg --json",
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
    assert "`aaaaaaaaaaaa`" in text and "2026-01-02" in text and "drake-tc bench leg" in text


def test_the_page_names_the_benchmarks_without_a_result(monkeypatch, tmp_path):
    listed = tmp_path / "commands.yaml"
    listed.write_text("qp: {title: Programs, about: '', command: drake-tc bench qp --json}\n", encoding="utf-8")
    monkeypatch.setattr(benchmarks, "STORE", tmp_path)
    monkeypatch.setattr(benchmarks, "COMMANDS", listed)
    text = benchmarks.overview()
    assert "1 of the 1 benchmarks" in text and "| qp | Programs | `drake-tc bench qp --json` |" in text
    stored = {"title": "Programs", "about": "", "command": "drake-tc bench qp --json", "commit": "a" * 40}
    stored |= {"date": "2026-01-02", "machine": {"CPUs": 2}}
    stored |= {"result": {"rows": [{"name": "a", "unit": "s", "median": 1e-3, "p99": 2e-3, "n": 3}]}}
    (tmp_path / "qp.json").write_text(json.dumps(stored), encoding="utf-8")
    assert "without a stored result" not in benchmarks.overview()
