"""Every kind of objection, note and experiment has a sentence, with its figures and their units."""

import re
from dataclasses import replace
from html import unescape
from typing import get_args

import pytest

from drake_tc.cli.close_loop_summary import print_summary
from drake_tc.config.joint_units import JointUnits
from drake_tc.diagnosis.link_notes import LoadInAllRuns
from drake_tc.diagnosis.load_notes import ConstantBesidePendulum
from drake_tc.diagnosis.noise_notes import CorrelatedTorqueNoise, NoiseOfRecordedEffort, ScatteringTimes
from drake_tc.diagnosis.notes import (
    ChargedIntegrator,
    DriveNote,
    FarFromRotor,
    FreeRunDiverges,
    FreeRunObstacle,
    GainBesideEffects,
    GainDeclaredWrong,
    GainOfTorqueDrive,
    GapCrossings,
    GearBetweenEncoders,
    LoadWithRotor,
    LogRemark,
    NoFreeRun,
    Note,
    PayloadFromRatio,
    RunsWithoutMotion,
    ScaleOfRotorInertia,
    ServoDamping,
    SilentEffort,
    SizeByRotorInertia,
    Sticking,
    TorqueAsCommanded,
    TorqueAsEffort,
    ZeroOfEffort,
)
from drake_tc.diagnosis.residual.unexplained import BeyondTraining
from drake_tc.diagnosis.result.experiments import (
    CheckLoad,
    CheckScale,
    CoverRange,
    FindPeriodicSource,
    NextExperiment,
    RecordTemperature,
    RepeatRun,
    RepeatUnchanged,
    SeparateLoads,
    TellApart,
    VarySignals,
)
from drake_tc.diagnosis.selection.withdrawal import (
    BelowEncoderStep,
    BelowLeastAmplitude,
    CorrectsCurve,
    DidNotHold,
    ExplainedByOthers,
    FormOfKnownLoad,
    ImpossibleValues,
    LargerOnHeldOut,
    LargerThanDeclared,
    LevelWithinWander,
    LittleGainAlone,
    NoiseOfEffort,
    NotFoundAgain,
    NotSeenToRepeat,
    Objection,
    ReplacesInertia,
    SizeMayBeZero,
    SizesMayBeZero,
    TrainingRunAgainst,
    UncertainOnHeldOut,
    Withdrawal,
    WithinJumps,
)
from drake_tc.diagnosis.timing_notes import (
    AllRecordedLate,
    DelayBySampling,
    HeldEffort,
    LateCommand,
    OlderEffort,
    PositionRecordedLate,
    RecordedLate,
    TorqueRecordedLate,
    UnknownAge,
    ViscousByAge,
)
from drake_tc.effects.library import LIBRARY, MULTI_JOINT, effect
from drake_tc.report.html import render
from drake_tc.report.report_json import joint_json
from drake_tc.report.sentences.experiments import ISOLATES, ISOLATES_PRISMATIC, experiment_sentence
from drake_tc.report.sentences.notes import note_sentence, note_sentences
from drake_tc.report.sentences.objections import why_rejected, why_withdrawn

OBJECTIONS = [
    (ImpossibleValues("stiffness is −1 N·m/rad."), ["stiffness is −1 N·m/rad."]),
    (CorrectsCurve(3.4, 7), ["3.4 periods", "7 coefficients", "up to 3.5 periods"]),
    (NotSeenToRepeat(1.6, 2.0, 12.0), ["1.6 periods", "12 cycles a turn", "fewer than 2:"]),
    (NoiseOfEffort(), ["the effort is noisy"]),
    (BelowEncoderStep("offset", 2e-6, 1e-5), ["offset is 2e-06 rad", "the encoder resolves 1e-05 rad"]),
    (
        ReplacesInertia(0.219, 1.17),
        ["hardly anything is left of the declared rotor inertia", "With 0.219 kg*m^2", "leaves 1.2 noise floors"],
    ),
    (
        SizeMayBeZero("presliding_travel", "presliding", 1.92, 0.0, 4.4, "N*m"),
        ["presliding_travel is at its bound", "presliding is not certain to differ from 0: 1.92 N*m", "0 to 4.4."],
    ),
    (
        SizeMayBeZero(None, "compliance", 5.69e-6, 0.0, 1.69e-5, "rad/(N*m)"),
        ["compliance is not certain to differ from 0: 5.69e-06 rad/(N*m), 95 % interval 0 to 1.69e-05."],
    ),
    (WithinJumps(0.34, 0.5), ["slower clock than the log", "0.34 noise floors", "at least 0.5"]),
    (SizesMayBeZero(0.007), ["uncertainty of the links", "by 0.7 % only"]),
    (BelowLeastAmplitude(3e-4, 5e-4), ["amplitude is 0.0003 rad", "resolve 0.0005 rad"]),
    (FormOfKnownLoad(0.974, zero=True), ["97 % of what it explains", "a wrong scale or zero of that load"]),
    (FormOfKnownLoad(0.974, zero=False), ["a wrong scale of that load"]),
    (LevelWithinWander(0.5, 3.0), ["is 0.5 times what slow drift", "at least 3 times"]),
    (TrainingRunAgainst("run_2"), ["the error of run_2 larger"]),
    (LargerOnHeldOut("run_2", 0.12), ["the held-out error of run_2 larger, by 12 %"]),
    (LargerOnHeldOut(None, 0.12), ["the error of all held-out runs together larger, by 12 %"]),
    (UncertainOnHeldOut("run_2", 0.034, 0.71, 0.9), ["error of run_2 by 3.4 %", "in 71 % of", "90 % are required"]),
    (UncertainOnHeldOut(None, 0.034, 0.71, 0.9), ["lowers the held-out error by 3.4 %"]),
    (LittleGainAlone(0.004, 0.02), ["by 0.4 %", "less than the 2 %"]),
    (LittleGainAlone(-0.004, 0.02), ["by 0.0 %"]),
    (ExplainedByOthers(0.004, 0.02), ["Beside the other effects", "by 0.4 %", "less than the 2 %"]),
    (NotFoundAgain(), ["does not find it again"]),
    (LargerThanDeclared("held-out", 0.053), ["the held-out error", "5.3 % larger"]),
    (LargerThanDeclared("mean absolute", 0.09), ["the mean absolute error", "9.0 % larger"]),
]
EXPERIMENTS = [
    (TellApart("stribeck", "delay"), ["To tell stribeck from delay: creep at", "(shows stribeck alone)"]),
    (CheckScale(), ["Hang known weights on the link", "no motion can tell torque_sensor_gain from"]),
    (CheckLoad(measured=False), ["the declared load (mass, length, zero) and the drive gain"]),
    (CheckLoad(measured=True), ["the torque sensor (scale, sign, zero) and the drive gain"]),
    (
        CoverRange(BeyondTraining("temperature", ("warm",), (24.4, 30.7), (24.4, 59.2), 0.998)),
        ["in which the temperature covers 24.4 to", "as in warm. The present training runs cover 24.4 to"],
    ),
    (SeparateLoads(), ["The fitted load differs from run to run", "load: {pendulum: ...}"]),
    (
        RepeatRun("run_2", 1.04, 2.5),
        ["Repeat run_2. If the error between 1.0 and 2.5 s comes back, the joint causes it"],
    ),
    (RecordTemperature(), ["Friction differs from run to run. Record the temperature"]),
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
    (GainOfTorqueDrive(1.2, 1.15, 1.25), ["is 1.2 N*m of commanded torque", "interval 1.15 to 1.25)"]),
    (LoadWithRotor(("load-dependent friction",)), ["load-dependent friction depends on the torque that the gear"]),
    (LoadWithRotor(("a", "b")), ["The a and the b depend on the torque", "the parameters of these effects exceed"]),
    (FarFromRotor("payload", 999.6), ["payload is 1e+03 times the declared rotor inertia", "N*mm", "gear ratio"]),
    (SizeByRotorInertia(("payload", "gain")), ["size of the payload and the gain rests on"]),
    (
        PayloadFromRatio(3.04, 5.21),
        ["moment of 3.04 N*m is the smallest", "shaped like the pendulum would have 5.21 N*m"],
    ),
    (PayloadFromRatio(3.04, None), ["close to the axis. A wrong rotor_inertia"]),
    (GainBesideEffects(("a", "b"), "position_servo", 0.0025, 0.005), ["With a and b,", "0.0025 rad per N*m", "0.005."]),
    (
        ZeroOfEffort("direction-dependent friction", "torque", 0.2, 0.0123),
        ["torque of the drive of 0.2 N*m", "like the direction-", "1.2 %", "torque_command: {bias"],
    ),
    (ZeroOfEffort("offset of the recorded effort", "current", 0.05, 0.02), ["current of 0.05 A", "{current: {bias"]),
    (
        ConstantBesidePendulum("current", 0.0615, 0.32),
        ["constant (0.0615 A of the recorded current, 32 % of the Coulomb friction) may be an offset of it,"],
    ),
    (
        ConstantBesidePendulum("position_servo", -0.002, 0.1),
        ["(-0.002 rad of the position error, 10 %", "an offset between command and position"],
    ),
    (GainDeclaredWrong("current", 0.1, 0.12, 1.2), ["0.1 A per N*m", "0.12:", "1.2 times", "and torque_constant."]),
    (GainDeclaredWrong("position_servo", 0.1, 0.12, 1.2), ["0.1 rad per N*m", "Check proportional_gain."]),
    (LateCommand(0.0274, 0.744, 1.07, 1.083), ["then 27.4 ms", "0.744 N*m*s/rad instead of 1.07", "8 % larger"]),
    (LateCommand(0.0274, 0.744, 1.07, 1.001), ["the error is no larger"]),
    (UnknownAge(0.01), ["half a sampling period (5 ms)", "time stamps"]),
    (DelayBySampling("lag", 0.02, 0.002), ["Up to 2 ms", "of the lag of 20 ms"]),
    (OlderEffort("torque", 0.001, 0.002), ["the torque of the drive that acts", "is 1 ms older", "period (2 ms)"]),
    (RecordedLate("current", 0.008), ["current seems to act 8 ms before", "Check its time stamps"]),
    (AllRecordedLate("current", 0.012), ["currents of all joints seem to act 12 ms before", "Check their time stamps"]),
    (AllRecordedLate(None, 0.012), ["The efforts of all joints"]),
    (HeldEffort("position_servo", 0.002), ["The command is taken", "(2 ms)"]),
    (ServoDamping(0.5, 0.2, exceeds=False), ["of 0.5 N*m*s/rad", "damping of 0.2; 0.3 N*m*s/rad are the joint's own"]),
    (ServoDamping(0.5, 0.7, exceeds=True), ["damping of 0.7 N*m*s/rad", "viscous friction of 0.5 N*m*s/rad: check"]),
    (
        GearBetweenEncoders((0.012, 0.011, 0.013), (2e-4, 1e-4, 3e-4)),
        ["a play of 12 mrad (95 % interval 11 to 13) and a compliance of 0.2 mrad/(N*m) (95 % interval 0.1 to 0.3)"],
    ),
    (GearBetweenEncoders(None, (2e-4, 1e-4, 3e-4)), ["encoder show a compliance of 0.2 mrad/(N*m)"]),
    (Sticking(6.0, 5.5, 6.5, 4.0, 12), ["at 6 N*m", "5.5 to 6.5, 12 events", "at 4 N*m", "static_excess 2 N*m."]),
    (NoiseOfRecordedEffort("current", 4.96), ["noise of the recorded current", "5.0 times"]),
    (NoiseOfRecordedEffort("position_servo", 4.96), ["recorded goal scatters", "5.0 times"]),
    (LoadInAllRuns("finger", 0.87, 0.015), ["at finger, 0.87 kg", "own (0.015 kg)", "`load: {robot: fitted}`"]),
    (CorrelatedTorqueNoise(2.5, 0.04), ["about 40 ms", "2.5 times"]),
    (ScatteringTimes(1e-4, 4.2, 1e-5), ["scatter by 100 us", "4.2 rad/s", "err by 0.00042 rad", "by 1e-05 rad"]),
    (
        GapCrossings(0.0884),
        ["the gear has backlash, rows within 88 ms of a sign change of the load torque take no part"],
    ),
    (ChargedIntegrator(), ["integral already held a torque", "Effects that act as a constant"]),
    (TorqueRecordedLate(0.02), ["torque seems to be recorded 20 ms after", "time stamps of the torque sensor"]),
    (PositionRecordedLate(0.01), ["recorded 10 ms after it was measured", "Check the time stamps of the encoder."]),
    (
        ViscousByAge(0.04, 0.002),
        ["one sampling period (2 ms)", "The viscous friction may therefore be wrong by up to 0.04 N*m*s/rad"],
    ),
    (RunsWithoutMotion(("a", "b"), 0.3), ["filter window (300 ms)", "take no part: a, b."]),
    *((NoFreeRun(reason), ["There is no free run: "]) for reason in get_args(FreeRunObstacle)),
    (FreeRunDiverges("after", ("slow", "fast")), ["The model after has no free-run error", "diverges on slow, fast."]),
    (FreeRunDiverges("refined", ("slow",)), ["The refined model has no free-run error"]),
]


def is_sentence(text: str) -> bool:
    return text.endswith(".") and text[:1] != " " and "nan" not in text and "  " not in text and "None" not in text


@pytest.mark.parametrize(("objection", "said"), OBJECTIONS)
def test_an_objection_says_its_figures(objection, said):
    text = why_withdrawn(objection)
    assert is_sentence(text)
    assert [part for part in said if part not in text] == []


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
    before, after = HeldEffort("current", 0.002), RunsWithoutMotion(("run_3",), 0.3)
    texts = note_sentences((before, *of_runs, after))
    assert [text.partition(" ")[0] for text in texts] == ["The", "run_1:", "run_2:", "Runs"]
    assert texts[1].endswith("The same, with other numbers, holds for run_2.")


@pytest.mark.parametrize(("experiment", "said"), EXPERIMENTS)
def test_an_experiment_says_what_to_record(experiment, said):
    text = experiment_sentence(experiment)
    assert is_sentence(text)
    assert [part for part in said if part not in text] == []


def test_every_kind_is_among_these():
    assert {type(objection) for objection, _ in OBJECTIONS} == set(get_args(Objection))
    assert {kind.reason for kind in get_args(Objection)} == set(get_args(Withdrawal))
    assert {type(note) for note, _ in NOTES} == set(get_args(Note))
    assert set(get_args(DriveNote)) < set(get_args(Note))
    assert {type(experiment) for experiment, _ in EXPERIMENTS} == set(get_args(NextExperiment))


def test_every_effect_of_the_library_has_an_experiment_that_shows_it_alone():
    declared = {"viscous", "coulomb"}  # always part of the model, so never tied with another effect
    assert {effect.id for effect in (*LIBRARY, *MULTI_JOINT)} - declared <= set(ISOLATES)


def test_console_json_and_page_say_the_same(joint, result, capsys, tmp_path):
    """Each sentence is in all three; an effect that was tried, and notes on the logs, are not on the console."""
    withdrawn = DidNotHold("delay", "delay", "delay", UncertainOnHeldOut("a & <b>", 0.034, 0.71, 0.9), 0.034)
    note, experiment = HeldEffort("current", 0.002), RepeatRun("a & <b>", 1.04, 2.5)
    made = replace(joint, did_not_hold=(withdrawn,), notes=(note,), load_notes=(note,), next_experiment=experiment)
    whole = replace(result, joints={"knee": made})
    expected = (why_withdrawn(withdrawn.objection), note_sentence(note), experiment_sentence(experiment))
    entry = joint_json(made)
    assert (entry["did_not_hold"][0]["why"], entry["notes"][0], entry["next_experiment"]) == expected
    assert entry["did_not_hold"][0]["reason"] == "heldout_run_against"
    print_summary(whole, tmp_path)
    console, page = (" ".join(text.split()) for text in (capsys.readouterr().out, unescape(render(whole))))
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
