"""An arm with known links and noisy currents: the noise must not change drive gains, nor look like an effect."""

import fitted_arm
import numpy as np
import pytest
from fitted_arm import GAIN, JOINTS, KNOWN, NEAR, URDF, record, rig_file
from numpy.testing import assert_allclose
from robot_files import write_robot

from drake_tc.diagnosis.problem.columns import Columns
from drake_tc.diagnosis.run import close_loop
from drake_tc.robot.robot import load_robot

NOISE = 0.8
"""White noise of one sample of the current, as torque [N m]: about the Coulomb friction of the joints."""


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """Logs without declared drive gains."""
    folder = tmp_path_factory.mktemp("arm")
    robot = load_robot(write_robot(folder, URDF, JOINTS))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fitted_arm, "NOISE", NOISE)
        logs = [record(folder, robot, f"run_{number}", 70 + number) for number in range(4)]
    rig = rig_file(folder, **KNOWN, drive_gain={})
    return close_loop(rig, logs[:3], logs[3:], NEAR)


def test_least_squares_alone_has_other_gains(found):
    """The load of the first joint is that of its inertia alone, and small beside the noise."""
    joint = found.joints["turn"]
    columns = Columns(joint.train.samples)
    estimate = np.linalg.lstsq(columns.design(joint.final.terms), columns.target, rcond=None)[0]
    assert GAIN[0] * estimate[0] < 0.98


def test_the_gains_are_those_of_the_drives(found):
    for joint, gain in zip(JOINTS, GAIN, strict=True):
        assert_allclose(found.joints[joint].final.gain, gain, rtol=0.01)


def test_nothing_is_named(found):
    assert found.shared == ()
    assert all(joint.effects == () for joint in found.joints.values())


def test_the_floor_holds_the_noise_of_the_currents(found):
    for joint in found.joints.values():
        assert 0.7 < joint.after.heldout / joint.noise_floor < 1.3
