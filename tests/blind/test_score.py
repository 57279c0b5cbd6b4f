"""The score on reports written by hand, whose figures can be counted on one's fingers."""

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from drake_tc.blind.score import score_reports
from drake_tc.blind.scoreboard import print_score
from drake_tc.blind.spec import BlindError


def put(root: Path, name: str, truth: dict[str, Any], report: dict[str, Any] | None) -> None:
    (root / "truth" / name).mkdir(parents=True)
    (root / "reports" / name).mkdir(parents=True)
    full = {"name": name, "strength": "", "effects": [], "oracle": {"heldout": 2e-5}} | truth
    (root / "truth" / name / "truth.json").write_text(json.dumps(full))
    if report is not None:
        (root / "reports" / name / "report.json").write_text(json.dumps(report))


def single(effect: str, strength: str = "middle") -> dict[str, Any]:
    return {"group": "single", "kind": effect, "strength": strength, "effects": [effect]}


def report(*ids: str, ties: list[list[str]] | None = None, structured: bool = False, after: float = 2.2e-5) -> dict:
    joint = {
        "effects": [{"id": name} for name in ids],
        "indistinguishable": ties or [],
        "unexplained": {"structured": structured},
        "error": {"after": {"heldout": after}},
    }
    verdict = "unexplained_structure" if structured else "effects_found" if ids else "no_missing_effect"
    return {"schema": 1, "verdict": verdict, "joints": {"joint": joint}, "shared": [], "seconds": 3.0}


@pytest.fixture
def root(tmp_path: Path) -> Path:
    put(tmp_path, "r1", single("stribeck"), report("stribeck"))
    put(tmp_path, "r2", single("payload"), report("payload", "delay"))
    put(tmp_path, "r3", single("elasticity"), report("rotor_inertia", ties=[["elasticity", "rotor_inertia"]]))
    put(tmp_path, "r4", single("delay"), report("current_lag", after=6e-5))
    put(tmp_path, "r5", single("deadzone", "weak"), None)
    both = {"group": "pair", "kind": "a+b", "strength": "middle", "effects": ["a", "b"]}
    put(tmp_path, "p1", both, report("b", "a"))
    put(tmp_path, "p2", both, report("a", "c", ties=[["a", "b"]]))
    null = {"group": "null", "kind": "plain"}
    put(tmp_path, "n1", null, report())
    put(tmp_path, "n2", null, report("delay"))
    put(tmp_path, "n3", null, report(structured=True))
    put(tmp_path, "n4", null, report())
    outside = {"group": "outside", "kind": "touch", "strength": "outside"}
    put(tmp_path, "o1", outside, report(structured=True))
    put(tmp_path, "o2", outside, report("stribeck"))
    return tmp_path


def test_shares(root: Path) -> None:
    score = score_reports(root / "truth", root / "reports")
    value = {row.name: (row.median, row.n, row.met) for row in score.rows}
    assert value["right effect first, middle"] == (0.75, 4, False)
    assert value["exact, middle"] == (0.5, 4, False)  # the tie counts, the extra effect does not
    assert value["exact, weak"] == (0.0, 1, True)
    assert "exact, strong" not in value
    assert value["both effects of a pair"] == (0.5, 2, False)  # one name cannot stand for two
    assert value["false alarms on nulls"] == (0.25, 4, False)
    assert value["outside causes flagged structured"] == (0.5, 2, False)
    np.testing.assert_allclose(value["other rigs flagged structured"][0], 1 / 11)
    np.testing.assert_allclose(value["rigs without a report"][0], 1 / 13)
    np.testing.assert_allclose(value["held-out error over oracle, middle"][0], 1.1)
    assert value["time for a rig"][:2] == (3.0, 12)


def test_confusion_counts_every_rig_once(root: Path) -> None:
    score = score_reports(root / "truth", root / "reports")
    assert score.confusion.to_numpy().sum() == 13
    assert score.confusion.loc["delay", "current_lag"] == 1
    assert score.confusion.loc["deadzone", "(no report)"] == 1
    assert score.confusion.loc["null: plain", "(nothing)"] == 2
    assert score.confusion.loc["outside: touch", "(structure)"] == 1


def test_json_and_table(root: Path) -> None:
    score = score_reports(root / "truth", root / "reports")
    data = json.loads(json.dumps(score.to_json()))
    assert data["name"] == "diagnosis"
    assert {"name", "unit", "median", "p99", "n"} <= set(data["rows"][0])
    out = io.StringIO()
    print_score(score, Console(file=out, width=140))
    assert "false alarms on nulls" in out.getvalue() and "r4: single delay" in out.getvalue()


def test_refusals(root: Path, tmp_path: Path) -> None:
    with pytest.raises(BlindError, match="found none"):
        score_reports(tmp_path / "empty", tmp_path)
    (root / "reports" / "n1" / "report.json").write_text("{}")
    with pytest.raises(BlindError, match=r"report\.json.*joints"):
        score_reports(root / "truth", root / "reports")
    (root / "reports" / "n1" / "report.json").write_text("{")
    with pytest.raises(BlindError, match="wanted a JSON file"):
        score_reports(root / "truth", root / "reports")


def test_a_refused_rig_is_no_answer(root: Path) -> None:
    before = score_reports(root / "truth", root / "reports")
    refused = {"schema": 1, "verdict": "no_missing_effect", "joints": {}, "error": "the joint never moves"}
    (root / "reports" / "r1" / "report.json").write_text(json.dumps(refused))
    after = score_reports(root / "truth", root / "reports")
    assert before.confusion.loc["stribeck", "stribeck"] == 1
    assert after.confusion.loc["stribeck", "(no report)"] == 1
