"""The loop closed on simulated joints: what counts as an answer, and which cases count apart."""

from dataclasses import replace

import pytest

from tests.benchmarks.evidence.loop import LoopCase, answer_of, decided_rows
from tests.benchmarks.evidence.pairs import Pair, drawn_joint


@pytest.mark.parametrize(
    ("named", "tied", "answer"),
    [
        ({"delay"}, (), "truth"),
        ({"delay", "stribeck"}, (), "truth"),
        ({"backlash"}, (), "other"),
        ({"delay", "backlash"}, (), "open"),
        (set(), (), "open"),
        ({"backlash"}, (("backlash", "delay"),), "open"),
        ({"delay"}, (("delay", "current_lag"),), "truth"),
    ],
)
def test_an_answer_names_one_of_the_two_and_ties_it_to_the_other_one_not(named, tied, answer):
    assert answer_of(named, tied, "delay", "backlash") == answer


def test_a_case_that_the_design_refuses_or_doubts_is_no_promise():
    case = LoopCase("delay", "backlash", 1, "open", "truth", "open", 0.95)
    refused = replace(case, refusal="the same function", predicted=float("nan"), designed="open")
    cases = [case, replace(case, designed="open"), replace(case, predicted=0.1), refused, replace(case, first="truth")]
    values = {row.name: row.value for row in decided_rows(cases)}
    assert [row.value for row in decided_rows(cases)][:5] == [5, 4, 0, 1, 1]
    assert values["open: predicted at 80 % or more"] == 2
    assert (
        values["predicted at or above: separated by the designed run"] == 0.5
        and values["predicted at or above: separated by the sinusoid"] == 0.0
    )
    assert not any("separated" in row.name for row in decided_rows([]))  # a share of no case is no figure


def test_a_wrong_drive_gain_is_an_error_of_the_rig_file():
    pair = Pair(("servo_gain", 0.15), ("payload", 3.0))
    wrong = drawn_joint(pair, pair.first, 4)
    assert wrong.causes == {} and wrong.rig.drive_gain["joint"] == pytest.approx(1.15 * wrong.spec.joint.gain)
    heavy = drawn_joint(pair, pair.second, 4)
    assert set(heavy.causes) == {"payload"} and heavy.rig.drive_gain["joint"] == heavy.spec.joint.gain
