"""Orientations in a scenario: the source turns as it is told, the simulated robot follows, errors teach."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from drake_tc.errors import ParamsError
from drake_tc.loops.whole_body.references import KnotSpec, TurnSpec, task_source
from drake_tc.loops.whole_body.running import simulate_tsid
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.law import Status

TSID = Path(__file__).resolve().parents[3] / "models" / "coman_like" / "coman_like_tsid.yaml"
SWING = KnotSpec(turn=TurnSpec((0.0, 0.0, 2.0), amplitude=0.4, frequency_hz=1.5, rise=0.4))
NOD = KnotSpec(turn=TurnSpec((0.0, 1.0, 0.0), times=(0.2, 0.6, 0.9), angles=(0.0, 0.5, 0.2)))


@pytest.fixture(scope="module")
def law():
    return load_law(TSID)


def turned(law, spec, times):
    """Rotation from the resting orientation by the source, and the rows."""
    source = task_source(law, "torso", spec)
    context, rows = source.CreateDefaultContext(), []
    for now in times:
        context.SetTime(now)
        rows.append(source.get_output_port().Eval(context).copy())
    rows = np.array(rows)
    first = Rotation.from_matrix(law.starting_terms().pose("torso")[0])
    return Rotation.from_quat(rows[:, [1, 2, 3, 0]]) * first.inv(), rows


def test_to_and_fro(law):
    times = np.array([0.0, 1.0 / 1.5, 1.25 / 1.5, 1.75 / 1.5])
    turn, _ = turned(law, SWING, times)
    assert_allclose(turn.as_rotvec(), np.outer([0.0, 0.0, 0.4, -0.4], [0, 0, 1]), atol=1e-9)


def test_through_angles_resting_at_each(law):
    times = np.array([0.0, 0.2, 0.4, 0.6, 0.9, 5.0])
    turn, rows = turned(law, NOD, times)
    assert_allclose(turn.as_rotvec(), np.outer([0.0, 0.0, 0.25, 0.5, 0.2, 0.2], [0, 1, 0]), atol=1e-9)
    assert_allclose(rows[[0, 1, 3, 4, 5], 4:], 0.0, atol=1e-9)
    assert rows[2, 5] > 2.0  # rad/s about y half-way


def test_the_torso_follows(law):
    """Yaw to and fro under ideal torques: by the pose of the simulated torso, against sine and rise."""
    recording = simulate_tsid(TsidScenario(controller=str(TSID), duration=0.8, motion={"torso": SWING}))
    assert recording.fell is None
    assert recording.status(Status.FALLBACK).max() == 0.0
    model = recording.law.model
    scratch, found = model.create_scratch(), []
    for state in recording["state"][::20]:
        rotation = model.terms(scratch, state[: model.nq], state[model.nq :]).pose("torso")[0]
        found.append(Rotation.from_matrix(rotation).as_rotvec())
    found = np.array(found) - found[0]
    late = recording.time[::20] > 0.4
    expected = 0.4 * np.sin(2.0 * np.pi * 1.5 * recording.time[::20])
    assert_allclose(found[late, 2], expected[late], atol=3e-3)
    assert np.abs(found[:, :2]).max() < 3e-3
    assert np.ptp(expected[late]) > 0.6


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda law: TurnSpec((1.0, 0.0)), "turn.axis: expected three numbers, got 2"),
        (lambda law: TurnSpec((1.0, 0.0, 0.0), times=(0.0,), angles=(1.0,)), "two or more and as many angles, got 1"),
        (lambda law: TurnSpec((1.0, 0.0, 0.0), times=(0.0, 1.0), angles=(1.0,)), "as many angles, got 2 and 1"),
        (lambda law: TurnSpec((1.0, 0.0, 0.0), times=(1.0, 0.0), angles=(1.0, 0.0)), "turn.times: expected increasing"),
        (
            lambda law: TurnSpec((1.0, 0.0, 0.0), times=(0.0, 1.0), angles=(1.0, 0.0), amplitude=0.1),
            "either times and angles or an amplitude, got both",
        ),
        (lambda law: KnotSpec(times=(0.0, 1.0), turn=SWING.turn), "either times and offsets or a turn, got both"),
        (lambda law: task_source(law, "com", SWING), "expected one of the tasks of orientation: torso, got 'com'"),
        (
            lambda law: task_source(law, "torso", KnotSpec(turn=TurnSpec((0.0, 0.0, 0.0), (0.0, 1.0), (0.0, 1.0)))),
            "turn.axis: expected a direction, got zero",
        ),
    ],
)
def test_what_is_refused(law, make, message):
    with pytest.raises(ParamsError, match=message):
        make(law)
