"""Play and compliance between two encoders, of a gear with known numbers, told by a note."""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.problem.columns import Columns
from drake_tc.diagnosis.result.gear_note import gear_between_encoders

from ..rigs import Joint, record, rig_of

PLAY, COMPLIANCE = 0.012, 2.5e-4
JOINT = Joint(duration=20.0, period=4e-3)


def columns_of(play: float, compliance: float, more: float = 0.0) -> Columns:
    """Two runs whose motor leads the link by half the play and by the wind-up; `more` load [N m] in all samples."""
    runs = []
    for number in range(2):
        run = record(JOINT, f"run{number}", 0.4 * number, number)
        tau = run.columns["joint/torque"] + more
        noise = np.random.default_rng(number).normal(0.0, 2e-5, tau.size)
        lead = 0.5 * play * np.sign(tau) + compliance * tau + 0.3 + noise
        motor = run.columns["joint/position"] + lead
        columns = {**run.columns, "joint/torque": tau, "joint/motor_position": motor}
        runs.append(replace(run, columns=columns))
    return Columns(build_samples(runs, rig_of(JOINT), "joint"))


def test_play_and_compliance_are_those_of_the_gear():
    gear = gear_between_encoders(columns_of(PLAY, COMPLIANCE))
    assert gear is not None
    assert gear.play == pytest.approx(PLAY, rel=0.05)
    assert gear.compliance == pytest.approx(COMPLIANCE, rel=0.05)
    note = gear.note(step=1e-4)
    assert note is not None
    assert note.play == (gear.play, *gear.play_ci95)
    assert note.compliance == (gear.compliance, *gear.compliance_ci95)
    coarse = gear.note(step=0.1)
    assert coarse is not None and coarse.play is None and coarse.compliance is not None


def test_a_load_of_one_sign_shows_the_compliance_alone():
    highest = float(np.abs(record(JOINT).columns["joint/torque"]).max())
    gear = gear_between_encoders(columns_of(PLAY, COMPLIANCE, more=-2.0 * highest))
    assert gear is not None
    low, high = gear.compliance_ci95
    assert low <= COMPLIANCE <= high and high - low < 0.2 * COMPLIANCE
    note = gear.note(step=1e-4)
    assert note is not None and note.play is None and note.compliance is not None


def test_a_rigid_gear_is_not_spoken_of():
    gear = gear_between_encoders(columns_of(0.0, 0.0))
    assert gear is not None
    assert gear.note(step=1e-4) is None


def test_one_encoder_says_nothing():
    samples = build_samples([record(JOINT)], rig_of(JOINT), "joint")
    assert gear_between_encoders(Columns(samples)) is None
