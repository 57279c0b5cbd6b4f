"""Coverage of intervals: what counts as holding the truth, and the rows that it becomes."""

from typing import Any

import pytest

from tests.benchmarks.interval_coverage import friction_intervals, holds, own_intervals
from tests.benchmarks.robot_rigs import INTERVALS, score_report, summary_rows

TRUTH = {
    "id": "link_mass",
    "where": "thigh",
    "estimated": {"mass": 0.5},
    "friction": {"hip": {"viscous": 60.0, "coulomb": 2.0}, "knee": {"viscous": 100.0, "coulomb": 3.0}},
}


def mass(low: float | None, high: float | None, where: str = "thigh") -> dict[str, Any]:
    parameters = {"mass": {"value": 0.5, "ci95": [low, high]}}
    return {
        "id": "link_mass",
        "where": where,
        "heldout_gain": 0.4,
        "parameters": parameters,
        "indistinguishable": [],
    }


def report(*shared: dict[str, Any], coulomb: tuple[float, float] = (1.9, 2.1)) -> dict[str, Any]:
    hip = {"viscous": {"viscous": {"ci95": [61.0, 63.0]}}, "coulomb": {"coulomb": {"ci95": list(coulomb)}}}
    return {"shared": list(shared), "joints": {}, "final_parameters": {"hip": hip}}


@pytest.mark.parametrize(
    ("interval", "expected"),
    [
        ([0.4, 0.6], True),
        ([0.5, 0.5], True),
        ([0.51, 0.6], False),
        ([-0.6, -0.4], False),
        ([None, None], False),
        ([0.4, float("inf")], False),
        (None, False),
    ],
)
def test_holds(interval: object, expected: bool) -> None:
    assert holds(interval, 0.5) is expected


def test_intervals_of_the_right_effect_in_the_right_place() -> None:
    assert own_intervals(TRUTH, report(mass(0.4, 0.6))) == (True,)
    assert own_intervals(TRUTH, report(mass(0.55, 0.6))) == (False,)
    assert own_intervals(TRUTH, report(mass(0.4, 0.6, "shank"))) == ()
    assert own_intervals(TRUTH, report()) == ()
    spring = {"id": "cable_spring", "where": "hip", "estimated": {"spring_stiffness": 6.0, "spring_preload": -1.0}}
    parameters = {"spring_stiffness": {"ci95": [5.0, 7.0]}, "spring_preload": {"ci95": [-0.9, -0.5]}}
    effect = {"id": "cable_spring", "heldout_gain": 0.2, "parameters": parameters}
    assert own_intervals(spring, {"joints": {"hip": {"effects": [effect]}}}) == (True, False)


def test_friction_of_the_joints_that_the_report_has() -> None:
    assert friction_intervals(TRUTH, report()) == (False, True)
    assert friction_intervals(TRUTH, report(coulomb=(2.05, 2.3))) == (False, False)
    assert friction_intervals(TRUTH, {"joints": {}, "error": "refused"}) == ()


def test_rows() -> None:
    scores = [
        score_report("a", TRUTH, report(mass(0.4, 0.6))),
        score_report("b", TRUTH, report(mass(0.6, 0.7))),
        score_report("c", TRUTH | {"id": "", "where": ""}, report()),
        score_report("d", TRUTH | {"id": "", "where": ""}, {"joints": {}, "error": "failed with KeyError: 'x'"}),
    ]
    rows = {row.name: row for row in summary_rows(scores)}
    own, friction = (rows[name] for name in INTERVALS)
    assert (own.value, own.n, own.goal) == (0.5, 2, "90 to 99 %")
    assert (friction.value, friction.n) == (0.5, 6)
    assert (rows["nulls quiet"].value, rows["nulls quiet"].expected) == (0.5, 0.98)
    assert rows["right place and effect first"].expected == 0.95
    assert rows["that and no other"].expected == 0.90
    assert scores[3].failure == "failed with KeyError: 'x'" and not scores[3].exact
