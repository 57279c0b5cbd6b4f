"""The score on reports written by hand, whose figures can be counted on one's fingers."""

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from drake_tc.joint_simulator.spec import BlindError
from tests.benchmarks.blind.outcome import read_outcome
from tests.benchmarks.blind.score import score_reports
from tests.benchmarks.blind.score_kinds import kind_table
from tests.benchmarks.blind.scoreboard import print_score


def put(root: Path, name: str, truth: dict[str, Any], report: dict[str, Any] | None) -> None:
    (root / "truth" / name).mkdir(parents=True)
    (root / "reports" / name).mkdir(parents=True)
    full = {"name": name, "strength": "", "effects": [], "oracle": {"heldout": 2e-5}} | truth
    (root / "truth" / name / "truth.json").write_text(json.dumps(full))
    if report is not None:
        (root / "reports" / name / "report.json").write_text(json.dumps(report))


def single(effect: str, strength: str = "middle") -> dict[str, Any]:
    return {"group": "single", "kind": effect, "strength": strength, "effects": [effect]}


def report(
    *ids: str, ties: list[list[str]] | None = None, structured: bool = False, after: float = 2.2e-5, **more: Any
) -> dict[str, Any]:
    """A report that names `ids`; `more` are keys of the joint, or `verdict`."""
    joint = {
        "effects": [{"id": name} for name in ids],
        "indistinguishable": ties or [],
        "unexplained": {"structured": structured, "floors": 3.5},
        "error": {"after": {"heldout": after}},
    }
    verdict = "unexplained_structure" if structured else "effects_found" if ids else "no_missing_effect"
    verdict = more.pop("verdict", verdict)
    return {"schema": 1, "verdict": verdict, "joints": {"joint": joint | more}, "shared": [], "seconds": 3.0}


RESIDUAL = {"verdict": "unexplained_residual"}


@pytest.fixture
def root(tmp_path: Path) -> Path:
    put(tmp_path, "r1", single("stribeck"), report("stribeck"))
    put(tmp_path, "r2", single("payload"), report("payload", "delay"))
    put(tmp_path, "r3", single("elasticity"), report("rotor_inertia", ties=[["elasticity", "rotor_inertia"]]))
    put(tmp_path, "r4", single("delay"), report("current_lag", after=6e-5))
    put(tmp_path, "r5", single("deadzone", "weak"), None)
    both = {"group": "pair", "kind": "a+b", "strength": "middle", "effects": ["a", "b"]}
    put(tmp_path, "p1", both, report("b", "a", structured=True))
    put(tmp_path, "p2", both, report("a", "c", ties=[["a", "b"]]))
    null = {"group": "null", "kind": "plain"}
    put(tmp_path, "n1", null, report())
    put(tmp_path, "n2", null, report("delay"))
    put(tmp_path, "n3", null, report(structured=True))
    put(tmp_path, "n4", null, report())
    put(tmp_path, "n5", null, report(**RESIDUAL))
    wandering = {
        "group": "null",
        "kind": "drifting_noise",
        "right_verdicts": ["no_missing_effect", RESIDUAL["verdict"]],
    }
    put(tmp_path, "n6", wandering, report(**RESIDUAL))
    outside = {"group": "outside", "kind": "touch", "strength": "outside"}
    put(tmp_path, "o1", outside, report(structured=True))
    put(tmp_path, "o2", outside, report("stribeck"))
    shaken = outside | {"kind": "random_disturbance", "right_verdicts": ["unexplained_residual"]}
    put(tmp_path, "o3", shaken, report("stribeck", **RESIDUAL))
    put(tmp_path, "o4", shaken, report(structured=True))
    return tmp_path


def rows_of(root: Path) -> dict[str, tuple[float, int, bool | None]]:
    score = score_reports(root / "truth", root / "reports")
    return {row.name: (row.value, row.n, row.met) for row in score.rows}


def test_shares(root: Path) -> None:
    value = rows_of(root)
    assert value["right effect first"] == (0.6, 5, False)
    assert value["right effect first, middle"] == (0.75, 4, None)  # the goal is on all strengths together
    assert value["exact, middle"] == (0.5, 4, None)  # the tie counts, the extra effect does not
    assert value["exact, weak"] == (0.0, 1, None)
    assert "exact, strong" not in value
    assert value["both effects of a pair"] == (0.5, 2, False)  # one name cannot stand for two
    assert value["false alarms on nulls"] == (0.5, 6, False)  # named, structure, residual without a wandering sensor
    assert value["outside causes flagged"] == (0.5, 4, False)  # a shaken joint is no structure
    assert value["outside causes flagged by either verdict"] == (0.75, 4, None)
    np.testing.assert_allclose(value["other rigs flagged"][0], 1 / 7)  # rigs whose cause the library has
    np.testing.assert_allclose(value["rigs without a report"][0], 1 / 17)
    np.testing.assert_allclose(value["held-out error over oracle, middle"][0], 1.1)
    assert value["time for a rig"][:2] == (3.0, 16)


REASONS_IN_WORDS = ({}, {"reason": "too_little_gain"}, {"reason": "not_recorded"}, {"reason": "not_excited"})


def test_an_effect_that_does_not_act_in_training_is_to_be_called_untested(root: Path) -> None:
    silent = single("saturation") | {"acts_in_training": False}
    why = {"id": "saturation", "reason": "untested", "why": "The effort stays below any limit."}
    put(root, "s1", single("saturation", "weak") | {"acts_in_training": True}, report("saturation"))
    put(root, "s2", single("saturation", "strong") | {"acts_in_training": True}, report("delay"))
    put(root, "s3", silent, report(rejected=[why]))
    put(root, "s4", silent, report(structured=True))
    put(root, "s5", silent, report(untested=["saturation"]))
    put(root, "s6", silent, report("delay", ties=[["delay", "saturation"]]))  # found, up to what is told apart
    value = rows_of(root)
    assert value["saturation found where it acts in training"] == (0.5, 2, False)
    assert value["elasticity found where it acts in training"] == (1.0, 1, True)
    np.testing.assert_allclose(value["called untested where it does not act"][0], 3 / 4)
    said = [{"id": "saturation", "why": "Untested: it was not recorded."} | reason for reason in REASONS_IN_WORDS]
    for number, entry in enumerate(said):
        put(root, f"s{7 + number}", silent, report(rejected=[entry]))
    outcomes = {o.name: o for o in score_reports(root / "truth", root / "reports").outcomes}
    assert [outcomes[f"s{7 + k}"].said_untested for k in range(len(said))] == [False, False, True, True]
    assert value["right effect first, middle"][1] == 4  # rigs whose cause no training run shows do not count
    assert value["other rigs flagged"][1] == 9


def test_new_fields_are_read(root: Path) -> None:
    entry = {"id": "cable_spring", "why": "The held-out runs speak against it."}
    put(root, "d1", {"group": "null", "kind": "plain"}, report(did_not_hold=[entry]))
    outcome = read_outcome(root / "truth" / "d1" / "truth.json", root / "reports" / "d1" / "report.json")
    assert outcome.did_not_hold == ("cable_spring",) and outcome.floors == 3.5
    assert not outcome.false_alarm and not outcome.untested


def test_kinds_are_counted(root: Path) -> None:
    table = kind_table(score_reports(root / "truth", root / "reports").outcomes)
    rows = {(r["group"], r["kind"], r["strength"]): (r["right"], r["rigs"]) for r in table.to_dict("records")}
    assert rows["null", "plain", ""] == (2, 5)
    assert rows["null", "drifting_noise", ""] == (1, 1)
    assert rows["outside", "random_disturbance", "outside"] == (1, 2)
    assert rows["single", "payload", "middle"] == (0, 1)
    assert sum(rigs for _, rigs in rows.values()) == 17


def test_confusion_counts_every_rig_once(root: Path) -> None:
    score = score_reports(root / "truth", root / "reports")
    assert score.confusion.to_numpy().sum() == 17
    assert score.confusion.loc["delay", "current_lag"] == 1
    assert score.confusion.loc["deadzone", "(no report)"] == 1
    assert score.confusion.loc["null: plain", "(nothing)"] == 2
    assert score.confusion.loc["outside: touch", "(structure)"] == 1
    assert score.confusion.loc["null: plain", "(residual)"] == 1


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
    with pytest.raises(BlindError, match="expected a JSON file"):
        score_reports(root / "truth", root / "reports")


def test_a_refused_rig_is_no_answer(root: Path) -> None:
    before = score_reports(root / "truth", root / "reports")
    refused = {"schema": 1, "verdict": "no_missing_effect", "joints": {}, "error": "the joint never moves"}
    (root / "reports" / "r1" / "report.json").write_text(json.dumps(refused))
    after = score_reports(root / "truth", root / "reports")
    assert before.confusion.loc["stribeck", "stribeck"] == 1
    assert after.confusion.loc["stribeck", "(no report)"] == 1
    out = io.StringIO()
    print_score(after, Console(file=out, width=140))
    assert "r1: single stribeck middle: no report; the joint never moves" in out.getvalue()


def test_a_report_without_joints_is_no_answer(root: Path) -> None:
    """A rig that was refused without a reason must not end the whole benchmark."""
    (root / "reports" / "r1" / "report.json").write_text(json.dumps({"schema": 1, "verdict": "", "joints": {}}))
    outcome = read_outcome(root / "truth" / "r1" / "truth.json", root / "reports" / "r1" / "report.json")
    assert not outcome.answered and outcome.refusal == "the report has no joint"
    assert not outcome.right
