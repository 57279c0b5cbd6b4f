"""The general form against the recursive one and against truth; unknowns that cannot be told apart are refused."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.errors import ParamsError
from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.robot.robot import Mount, Pose

from .general_form import Columns, GeneralModel, UnknownWrench, general_wrench_estimate
from .machines import Push, Truth, random_robot

ROUND_OFF = {"rtol": 1e-8, "atol": 1e-8}


def motion(instant):
    return instant.q, instant.v, instant.vdot, instant.imu, instant.gyro_dot


@pytest.mark.parametrize("seed", range(5))
def test_agrees_with_the_recursive_form(tmp_path, seed):
    rng = np.random.default_rng(seed)
    robot = random_robot(tmp_path, rng, fixed_base=False)
    instant = Truth(robot).instant(rng, [Push(m.contact, rng.uniform(-50, 50, 6)) for m in robot.force_torque])
    recursive = TorqueModel(robot)
    one = recursive.estimate(*motion(instant), instant.readings)
    general = GeneralModel(
        robot, [UnknownWrench(Mount("base", robot.base))], [mount.contact for mount in robot.force_torque]
    )
    other = general.estimate(general.create_context(), motion(instant), one.contact_wrench)
    assert_allclose(other.torque, one.torque, **ROUND_OFF)
    assert_allclose(other.wrenches[0], one.unknown_wrench, **ROUND_OFF)


def test_an_extra_contact_is_solved_where_a_torque_is_known(tmp_path):
    """Six wrench components and n torques are n + 6; a point contact of one more component needs a known torque."""
    rng = np.random.default_rng(11)
    robot = random_robot(tmp_path, rng, fixed_base=False, sensors=0)
    hand = Mount("hand", "l8", Pose((0.1, 0.2, 0.0)))
    pushes = [Push(Mount("base", "l0"), rng.uniform(-50, 50, 6)), Push(hand, np.array([0.0, 0.0, 33.0, 0.0, 0.0, 0.0]))]
    instant = Truth(robot).instant(rng, pushes)
    known = robot.joints.index("j8")
    unknown = [UnknownWrench(pushes[0].mount), UnknownWrench(hand, ("fz",))]
    model = GeneralModel(robot, unknown, known_torque=("j8",))
    result = model.estimate(model.create_context(), motion(instant), np.zeros(0), instant.torque[[known]])
    assert_allclose(result.torque, instant.torque, **ROUND_OFF)
    assert_allclose(result.wrenches, [push.wrench for push in pushes], **ROUND_OFF)


def test_two_unknown_wrenches_are_refused_by_name(tmp_path):
    rng = np.random.default_rng(12)
    robot = random_robot(tmp_path, rng, fixed_base=False, sensors=0)
    instant = Truth(robot).instant(rng)
    model = GeneralModel(robot, [UnknownWrench(Mount("pelvis", "l0")), UnknownWrench(Mount("hand", "l1"))])
    with pytest.raises(ParamsError, match=r"20 unknowns, but only 14 .*wrench on pelvis, wrench on hand"):
        model.estimate(model.create_context(), motion(instant), np.zeros(0))


def test_two_point_contacts_have_a_line_about_which_nothing_is_known(tmp_path):
    """Two forces on one body: what they pull along their line of centres cancels; joints elsewhere are not to blame."""
    rng = np.random.default_rng(13)
    robot = random_robot(tmp_path, rng, fixed_base=False, sensors=0)
    instant = Truth(robot).instant(rng)
    left, right = (Mount(name, "l0", Pose((0.0, y, 0.0))) for name, y in (("left", 0.1), ("right", -0.1)))
    model = GeneralModel(robot, [UnknownWrench(mount, ("fx", "fy", "fz")) for mount in (left, right)])
    with pytest.raises(ParamsError) as refusal:
        model.estimate(model.create_context(), motion(instant), np.zeros(0))
    assert "cannot tell apart: wrench on left, wrench on right;" in str(refusal.value)
    fewer = GeneralModel(robot, [UnknownWrench(left, ("fx", "fy", "fz")), UnknownWrench(right, ("fx", "fz"))])
    assert np.all(np.isfinite(fewer.estimate(fewer.create_context(), motion(instant), np.zeros(0)).torque))


def test_more_equations_than_unknowns_are_solved_by_least_squares():
    rng = np.random.default_rng(14)
    matrix, rest = rng.normal(size=(7, 4)), rng.normal(size=7)
    parts = general_wrench_estimate(rest, [Columns("a", matrix[:, :3]), Columns("b", matrix[:, 3:])])
    assert_allclose(np.concatenate(parts), np.linalg.lstsq(matrix, rest, rcond=None)[0], rtol=1e-10)


def test_refusals(tmp_path):
    robot = random_robot(tmp_path, np.random.default_rng(15), fixed_base=False)
    base = UnknownWrench(Mount("base", "l0"))
    with pytest.raises(ParamsError, match="no link 'nose'"):
        GeneralModel(robot, [UnknownWrench(Mount("nose", "nose"))])
    with pytest.raises(ParamsError, match="known torque: no joint 'nose'; joints"):
        GeneralModel(robot, [base], known_torque=("nose",))
    with pytest.raises(ParamsError, match="expected some of"):
        GeneralModel(robot, [replace(base, components=("fw",))])
