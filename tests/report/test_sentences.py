"""Every kind of note and experiment has a sentence, with its figures and their units."""

import re
from dataclasses import replace
from html import unescape
from typing import get_args

import pytest
from mailed import Undrawn

from drake_tc.cli.close_loop_command import print_summary
from drake_tc.config.joint_units import JointUnits
from drake_tc.diagnosis.notes import (
    CorrelatedTorqueNoise,
    FreeRunDiverges,
    FreeRunObstacle,
    LoadInAllRuns,
    LogRemark,
    NoFreeRun,
    NoiseOfRecordedEffort,
    Note,
    RunsDiffer,
    RunsWithoutMotion,
    ScaleOfRotorInertia,
    ScatteringTimes,
    SilentEffort,
    TorqueAsCommanded,
    TorqueAsEffort,
)
from drake_tc.diagnosis.residual.unexplained import (
    BeyondTraining,
    CoverRange,
    FindPeriodicSource,
    NextExperiment,
    RepeatRun,
    RepeatUnchanged,
    TellApart,
    VarySignals,
)
from drake_tc.diagnosis.result.joint_result import DidNotHold
from drake_tc.effects.library import LIBRARY, MULTI_JOINT, effect
from drake_tc.report.data_files import joint_json
from drake_tc.report.html import render
from drake_tc.report.notes import ISOLATES, ISOLATES_PRISMATIC, experiment_sentence, note_sentence, note_sentences
from drake_tc.report.words import REASONS, why_rejected

EXPERIMENTS = [
    (TellApart("stribeck", "delay"), ["To tell stribeck from delay: creep at", "(shows stribeck alone)"]),
    (
        CoverRange(BeyondTraining("temperature", ("warm",), (24.4, 30.7), (24.4, 59.2), 0.998)),
        ["in which the temperature covers 24.4 to", "as in warm. The present training runs cover 24.4 to"],
    ),
    (
        RepeatRun("run_2", 1.04, 2.5),
        ["Repeat run_2. If the error between 1.0 and 2.5 s comes back, the joint causes it"],
    ),
    (FindPeriodicSource(49.987), ["periodic at 49.99 Hz", "a source of this frequency near the rig"]),
    (
        FindPeriodicSource(0.3, among_joints=True),
        ["If another joint moves at this frequency", "couples the two joints"],
    ),
    (VarySignals(("load_torque", "velocity")), ["in which load torque and velocity vary independently"]),
    (VarySignals(("load_torque",)), ["in which load torque varies and the other signals do not"]),
    (RepeatUnchanged(), ["Repeat one run unchanged"]),
]


NOTES = [
    (LogRemark("run_1", "3 rows were filled."), ["run_1: 3 rows were filled."]),
    (SilentEffort("run_1", "knee/current", 0.84), ["run_1: Column knee/current is exactly 0 in 84 %"]),
    (TorqueAsCommanded(), ["(drive_gain: 1)"]),
    (ScaleOfRotorInertia(0.31), ["rotor inertia of 0.31 kg m^2"]),
    (TorqueAsEffort("current", declares_inertia=False), ["as effort [A]", "1 A per N*m"]),
    (
        TorqueAsEffort("voltage", declares_inertia=True),
        ["as effort [V]", "to get N*m. The declared rotor inertia does"],
    ),
    (NoiseOfRecordedEffort("current", 4.96), ["noise of the recorded current", "5.0 times"]),
    (NoiseOfRecordedEffort("position_servo", 4.96), ["recorded goal scatters", "5.0 times"]),
    (LoadInAllRuns("finger", 0.87, 0.015), ["at finger, 0.87 kg", "own (0.015 kg)", "`load: {robot: fitted}`"]),
    (CorrelatedTorqueNoise(2.5, 0.04), ["about 40 ms", "2.5 times"]),
    (RunsDiffer(2.5), ["from run to run", "2.5 times"]),
    (ScatteringTimes(1e-4, 4.2, 1e-5), ["scatter by 100 us", "4.2 rad/s", "err by 0.00042 rad", "by 1e-05 rad"]),
    (RunsWithoutMotion(("a", "b"), 0.3), ["filter window (300 ms)", "take no part: a, b."]),
    *((NoFreeRun(reason), ["There is no free run: "]) for reason in get_args(FreeRunObstacle)),
    (FreeRunDiverges("after", ("slow", "fast")), ["The model after has no free-run error", "diverges on slow, fast."]),
    (FreeRunDiverges("refined", ("slow",)), ["The refined model has no free-run error"]),
]


def is_sentence(text: str) -> bool:
    return text.endswith(".") and text[:1] != " " and "nan" not in text and "  " not in text and "None" not in text


@pytest.mark.parametrize(("note", "said"), NOTES)
def test_a_note_says_its_figures(note, said):
    text = note_sentence(note)
    assert is_sentence(text)
    assert [part for part in said if part not in text] == []
    assert note_sentences((note,)) == (text,)


def test_reasons_for_no_free_run_are_told_apart():
    assert len({note_sentence(NoFreeRun(reason)) for reason in get_args(FreeRunObstacle)}) == len(
        get_args(FreeRunObstacle)
    )


def test_what_several_runs_have_in_common_is_told_once_and_other_notes_keep_their_place():
    of_runs = (
        SilentEffort("run_1", "a/current", 0.84),
        LogRemark("run_2", "Cut."),
        SilentEffort("run_2", "a/current", 0.5),
    )
    before, after = CorrelatedTorqueNoise(2.5, 0.04), RunsWithoutMotion(("run_3",), 0.3)
    texts = note_sentences((before, *of_runs, after))
    assert [text.partition(" ")[0] for text in texts] == ["The", "run_1:", "run_2:", "Runs"]
    assert texts[1].endswith("The same, with other numbers, holds for run_2.")


@pytest.mark.parametrize(("experiment", "said"), EXPERIMENTS)
def test_an_experiment_says_what_to_record(experiment, said):
    text = experiment_sentence(experiment)
    assert is_sentence(text)
    assert [part for part in said if part not in text] == []


def test_every_kind_is_among_these():
    assert {type(note) for note, _ in NOTES} == set(get_args(Note))
    assert {type(experiment) for experiment, _ in EXPERIMENTS} == set(get_args(NextExperiment))


def test_every_effect_of_the_library_has_an_experiment_that_shows_it_alone():
    declared = {"viscous", "coulomb"}  # always part of the model, so never tied with another effect
    assert {effect.id for effect in (*LIBRARY, *MULTI_JOINT)} - declared <= set(ISOLATES)


def test_console_json_and_page_say_the_same(joint, result, capsys, tmp_path):
    """Each sentence is in all three; an effect that was tried, and notes on the logs, are not on the console."""
    withdrawn = DidNotHold("delay", "delay", "delay", "worse_on_held_out")
    note, experiment = CorrelatedTorqueNoise(2.5, 0.04), RepeatRun("a & <b>", 1.04, 2.5)
    made = replace(joint, did_not_hold=(withdrawn,), notes=(note,), load_notes=(note,), next_experiment=experiment)
    whole = replace(result, joints={"knee": made})
    expected = (REASONS["worse_on_held_out"][1], note_sentence(note), experiment_sentence(experiment))
    entry = joint_json(made)
    assert (entry["did_not_hold"][0]["why"], entry["notes"][0], entry["next_experiment"]) == expected
    assert entry["did_not_hold"][0]["reason"] == "worse_on_held_out"
    print_summary(whole, tmp_path)
    console, page = (" ".join(text.split()) for text in (capsys.readouterr().out, unescape(render(whole, Undrawn()))))
    assert [text for text in expected if text not in console or text not in page] == []
    for rejected in made.rejected:
        assert why_rejected(rejected) in page
        assert why_rejected(rejected) in [each["why"] for each in entry["rejected"]]


def test_experiments_of_a_prismatic_joint_name_no_turns_and_no_hanging_link():
    """Speeds and amplitudes are those of linear axes: 0.5 m/s would not be a creeping motion."""
    slides = JointUnits("prismatic", "current")
    assert "from 0.1 to 50 mm/s" in experiment_sentence(TellApart("stribeck", "delay"), slides)
    assert set(ISOLATES_PRISMATIC) <= set(ISOLATES)
    for name in ISOLATES:
        if "prismatic" in effect(name).joint_types or name in ISOLATES_PRISMATIC:
            text = experiment_sentence(TellApart(name, name), slides)
            assert not re.search(r"\brad\b|\bturn\b|let the link hang|0\.5 m/s", text), text
