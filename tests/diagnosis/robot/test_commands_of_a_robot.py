"""Position servos of a robot whose links are fitted: one controller holds the commands of all joints, or of none."""

import numpy as np
import pytest
from fitted_arm import GAIN, JOINTS, PERIOD, URDF, VISCOUS, record, rig_file
from numpy.testing import assert_allclose
from robot_files import write_robot

from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.command_hold import speaks_for_hold
from drake_tc.diagnosis.run import close_loop
from drake_tc.robot.robot import load_robot

PER_EFFORT = 0.01
"""A servo's position error [rad] for each ampere of `record`."""
QUADRATIC = 0.8
"""Of the last joint [N m s^2/rad^2]; no file says so."""


def as_servos(path, *, age=0.0):
    """The log of a current drive as one of position servos whose commands act `age` periods after they are recorded."""
    log = dict(np.load(path))
    for i, joint in enumerate(JOINTS):
        position, effort = log[f"{joint}/position"], log.pop(f"{joint}/current")
        if joint == JOINTS[-1]:
            speed = np.gradient(position, PERIOD)
            effort = effort + GAIN[i] * QUADRATIC * speed * np.abs(speed)
        command = position + PER_EFFORT * effort
        later = np.arange(command.size) + age
        log[f"{joint}/position_command"] = np.interp(later, np.arange(command.size), command)
    np.savez(path, **log)
    return path


@pytest.mark.parametrize("age", [0.0, 0.5])
def test_an_effect_of_one_joint_does_not_decide_how_the_commands_of_all_act(tmp_path, age):
    robot = load_robot(write_robot(tmp_path, URDF, JOINTS))
    *train, held = (as_servos(record(tmp_path, robot, f"run_{k}", k), age=age) for k in range(4))
    gains = dict(zip(JOINTS, (PER_EFFORT * GAIN).tolist(), strict=True))
    rig = rig_file(tmp_path, drive="position_servo", drive_gain=gains)
    result = close_loop(rig, train, [held], DiagnosisOptions(assess_residual=False))
    assert [(name, e.id) for name, joint in result.joints.items() for e in joint.effects] == [
        ("fold", "quadratic_viscous")
    ]
    for name, viscous in zip(JOINTS[:2], VISCOUS, strict=False):
        joint = result.joints[name]
        assert_allclose(joint.baseline_parameters["viscous"]["viscous"].value, viscous, rtol=0.1)
        assert joint.before.heldout < 2.0 * joint.noise_floor
    assert_allclose(result.joints["fold"].effects[0].parameters["quadratic_viscous"].value, QUADRATIC, rtol=0.1)


def test_most_joints_outvote_one_whose_missing_effect_speaks_for_the_other_answer():
    rng = np.random.default_rng(0)
    blocks = 0.2 * rng.standard_normal((5, 30))
    wrong = 0.3 + blocks[0]
    assert speaks_for_hold([wrong])
    assert not speaks_for_hold([wrong, *(blocks[1:] - 0.15)])
    assert not speaks_for_hold([np.zeros(0)])
