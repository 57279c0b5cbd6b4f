"""Delays of a simulated arm whose links are fitted: of all drives, of one, and of an encoder."""

import numpy as np
import pytest
from fitted_arm import COULOMB, JOINTS, PERIOD, URDF, VISCOUS, record, rig_file
from numpy.testing import assert_allclose
from robot_files import write_robot

from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.robot.common_delay import agree
from drake_tc.diagnosis.run import close_loop
from drake_tc.diagnosis.timing_notes import AllRecordedLate, RecordedLate
from drake_tc.robot.robot import load_robot


@pytest.mark.parametrize("late", [(0.02, 0.02, 0.02), (0.0, 0.02, 0.0)])
def test_a_delay_of_all_joints_is_named_once_and_that_of_one_joint_is_its_own(tmp_path, late):
    loaded = load_robot(write_robot(tmp_path, URDF, JOINTS))
    runs = [record(tmp_path, loaded, name, k, late=late) for k, name in enumerate(("one", "two", "held"))]
    found = close_loop(rig_file(tmp_path), runs[:2], runs[2:], DiagnosisOptions(assess_residual=False))
    own = {name: [effect.id for effect in joint.effects] for name, joint in found.joints.items()}
    if len(set(late)) > 1:
        assert found.shared == () and own == {"turn": [], "lift": ["delay"], "fold": []}
        return
    (delay,) = found.shared
    assert (delay.id, delay.where) == ("delay", "all joints") and own == {joint: [] for joint in JOINTS}
    low, high = delay.parameters["delay"].ci95
    assert low <= 0.02 <= high and high - low < 0.25 * PERIOD
    for joint in found.joints.values():
        assert joint.after.heldout < 0.5 * joint.before.heldout
        assert [t.shape for t in joint.final.terms if t.effect.id == "delay"] == [delay_shape(delay)]


@pytest.mark.parametrize(("late", "share"), [((0.018,) * 3, True), ((0.0, 0.018, 0.0), False)])
def test_efforts_that_are_all_recorded_late_are_moved_back(tmp_path, late, share):
    """A current that passes a low-pass before it is logged. One joint's alone is no matter of a clock or a bus."""
    loaded = load_robot(write_robot(tmp_path, URDF, JOINTS))
    behind = tuple(-each for each in late)
    runs = [record(tmp_path, loaded, name, k, late=behind) for k, name in enumerate(("one", "two", "held"))]
    found = close_loop(rig_file(tmp_path), runs[:2], runs[2:], DiagnosisOptions(assess_residual=False))
    assert not any(isinstance(note, RecordedLate) for joint in found.joints.values() for note in joint.notes)
    if not share:
        assert found.notes == ()
        return
    (note,) = found.notes
    assert isinstance(note, AllRecordedLate)
    assert found.shared == () and all(joint.effects == () for joint in found.joints.values())
    assert_allclose(note.lead, 0.018, atol=0.05 * PERIOD)
    for joint, viscous, coulomb in zip(JOINTS, VISCOUS, COULOMB, strict=True):
        numbers = found.joints[joint].final_parameters
        assert_allclose(numbers["viscous"]["viscous"].value, viscous, rtol=0.01)
        assert_allclose(numbers["coulomb"]["coulomb"].value, coulomb, rtol=0.01)


def test_each_joint_tells_its_own_delay(tmp_path, monkeypatch):
    """One Gauss-Newton step from a common delay of 25 ms reaches the joints' own ones, which differ."""
    problems = []
    monkeypatch.setattr("drake_tc.diagnosis.robot.fitted_links.common_delay", problems.append)
    late = np.array([0.02, 0.03, 0.024])
    loaded = load_robot(write_robot(tmp_path, URDF, JOINTS))
    runs = [record(tmp_path, loaded, name, k, late=tuple(late)) for k, name in enumerate(("one", "two", "held"))]
    close_loop(rig_file(tmp_path), runs[:2], runs[2:], DiagnosisOptions(assess_residual=False))
    (problem,) = problems
    own, spread = problem.own_delays(0.025, problem.fit(0.025), problem.around(0.025))
    assert (spread < 0.002).all()
    assert_allclose(own, late, atol=0.002)


def test_joints_agree_on_a_delay_that_is_shorter_in_none():
    spread = np.full(4, 1e-3)
    assert agree(0.02, np.array([0.02, 0.018, 0.023, 0.022]), spread)
    assert agree(0.02, np.array([0.02, 0.018, 0.023, 0.060]), spread)  # a lag of its own, perhaps
    assert not agree(0.02, np.array([0.02, 0.018, 0.050, 0.060]), spread)
    assert not agree(0.02, np.array([0.02, 0.018, 0.023, 0.004]), spread)
    assert agree(0.02, np.array([0.02, 0.018, 0.023, 0.004]), np.array([1e-3, 1e-3, 1e-3, 0.01]))
    assert agree(-0.02, np.array([-0.02, -0.018, -0.023, -0.060]), spread)
    assert not agree(-0.02, np.array([-0.02, -0.018, -0.023, 0.004]), spread)


def delay_shape(delay):
    return {"delay": delay.parameters["delay"].value}


def test_a_late_encoder_is_told_from_a_late_drive_by_the_other_joints(tmp_path):
    """The encoder of `lift` tells the angle of 30 ms ago, which `fold` feels: gravity is taken at the wrong angle."""
    loaded = load_robot(write_robot(tmp_path, URDF, JOINTS))
    behind = (0.0, 0.03, 0.0)
    runs = [record(tmp_path, loaded, name, k, behind=behind) for k, name in enumerate(("one", "two", "held"))]
    found = close_loop(rig_file(tmp_path), runs[:2], runs[2:], DiagnosisOptions(assess_residual=False))
    (delay,) = found.shared
    assert (delay.id, delay.where, delay.title) == ("delay", "lift", "delay of the encoder")
    assert {name: [effect.id for effect in joint.effects] for name, joint in found.joints.items()} == {
        joint: [] for joint in JOINTS
    }
    low, high = delay.parameters["delay"].ci95
    assert low <= 0.03 <= high and high - low < 0.1 * PERIOD
    assert delay.joints["fold"] > 0.0
    for base in found.links.base:
        low, high = base.estimate.ci95
        assert low <= base.declared <= high, base.name
