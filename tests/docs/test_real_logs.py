"""The page of real logs: every public set with rig files is described, and the stored figures state their origin."""

import json

import pytest
import yaml

from .conftest import ROOT

real_logs = pytest.importorskip("site_pages.real_logs")
SETS = yaml.safe_load(real_logs.SETS.read_text("utf-8"))
PART = json.loads(real_logs.GATE.read_text("utf-8"))["parts"]["real"]


def test_every_set_with_rig_files_is_described():
    rigs = {path.name for path in (ROOT / "tests" / "benchmarks" / "rigs").iterdir() if path.is_dir()}
    assert set(SETS) == rigs
    assert all(said["contains"] and said["open"] for said in SETS.values())
    assert {name for name, said in SETS.items() if "source" not in said} == {"bench-practice"}


def test_the_page_states_commit_date_and_the_figures_of_each_set():
    text = real_logs.overview()
    assert f"Commit `{PART['commit'][:12]}`, {PART['date']}" in text
    with_figures = [row["name"].split(":")[0] for row in PART["rows"] if row["name"].endswith(real_logs.RATIO)]
    assert with_figures
    for name in with_figures:
        (line, _) = [line for line in text.splitlines() if line.startswith(f"| `{name}` |")]
        assert line.count("|") == 8


def test_a_missed_goal_and_a_failed_set_stay_visible():
    name = next(iter(SETS))
    row = {"name": f"{name}: {real_logs.RATIO}", "median": 1.3, "unit": "-", "met": False, "note": "named: delay"}
    share = {"name": "cases", "unit": "share", "median": 0.5, "n": 4, "expected": 0.98, "met": False}
    text = real_logs.overview_of({"commit": "a" * 40, "date": "2026-01-02", "size": "small", "rows": [row, share]})
    assert (
        "| delay |" in text
        and "1.30 (missed)" in text
        and "Share of cases: 50 % of 4 (goal: at least 98 %, missed)" in text
    )
    assert "No figures are stored." in real_logs.overview_of(None)
