"""Algorithm 1 against Drake's forward dynamics: with perfect sensors the estimate is the truth, to round-off."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from drake_tc.errors import ParamsError
from drake_tc.estimation.torque_model import MeasuredMotion, TorqueModel
from drake_tc.robot.robot import Mount, Pose, Robot

from .machines import Push, Truth, joint_xml, random_robot

ROUND_OFF = {"rtol": 1e-8, "atol": 1e-8}
"""Forward dynamics of a random tree are conditioned to 1e4 or so; torques are of the order of 100 N m."""


def estimate(model, instant):
    return model.estimate(MeasuredMotion(*instant[:5]), instant.readings)


def contact_pushes(robot, rng):
    return [Push(mount.contact, rng.uniform(-50.0, 50.0, 6)) for mount in robot.force_torque]


SEEDS = settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))


@SEEDS
@given(seed=st.integers(0, 2**32 - 1), sensors=st.integers(0, 3), fixed=st.booleans())
def test_any_tree_with_any_sensors_pushed_at_its_contacts(tmp_path_factory, seed, sensors, fixed):
    rng = np.random.default_rng(seed)
    robot = random_robot(tmp_path_factory.mktemp("r"), rng, fixed_base=fixed, sensors=sensors)
    pushes = contact_pushes(robot, rng)
    instant = Truth(robot).instant(rng, pushes)
    result = estimate(TorqueModel(robot), instant)
    assert_allclose(result.torque, instant.torque, **ROUND_OFF)
    assert_allclose(
        result.contact_wrench, np.concatenate([np.zeros(0), *(push.wrench for push in pushes)]), **ROUND_OFF
    )
    assert_allclose(result.unknown_wrench, instant.base_reaction, **ROUND_OFF)


@SEEDS
@given(seed=st.integers(0, 2**32 - 1), link=st.integers(0, 8))
def test_the_unknown_wrench_on_any_link_of_a_floating_tree(tmp_path_factory, seed, link):
    rng = np.random.default_rng(seed)
    robot = random_robot(tmp_path_factory.mktemp("r"), rng, fixed_base=False)
    unknown = Push(Mount("unknown", f"l{link}"), rng.uniform(-50.0, 50.0, 6))
    try:
        model = TorqueModel(robot, f"l{link}")
    except ParamsError as refusal:
        assert "beyond the F/T sensor" in str(refusal)
        return
    pushes = contact_pushes(robot, rng)
    instant = Truth(robot).instant(rng, [*pushes, unknown])
    result = estimate(model, instant)
    assert_allclose(result.torque, instant.torque, **ROUND_OFF)
    assert_allclose(result.unknown_wrench, unknown.wrench, **ROUND_OFF)


def test_the_trees_hold_every_arrangement(tmp_path):
    """Guard of the two tests above: sensors beyond sensors, joints between sensor and contact, IMUs on moving links."""
    models = [TorqueModel(random_robot(tmp_path, np.random.default_rng(seed), fixed_base=False)) for seed in range(20)]
    cuts = [cut for model in models for cut in model.model.cuts]
    assert 5 < sum(cut.rigid for cut in cuts) < len(cuts) - 5
    assert sum(model.model.inward != (0, 1) for model in models) > 2
    welded = [model.model.welded_to_base(model.model.plant.GetFrameByName(model.robot.imu[0].link)) for model in models]
    assert 0 < sum(welded) < 15


def test_a_welded_base_needs_no_imu_or_no_gyro_derivative(tmp_path):
    rng = np.random.default_rng(3)
    robot = random_robot(tmp_path, rng, fixed_base=True)
    instant = Truth(robot).instant(rng, contact_pushes(robot, rng))
    blind = instant._replace(imu=np.full(6, np.nan), gyro_dot=np.full(3, np.nan))
    for model, seen in (
        (TorqueModel(robot, base="fixed"), blind),
        (TorqueModel(robot, angular_acceleration="zero"), instant._replace(gyro_dot=np.full(3, np.nan))),
    ):
        result = estimate(model, seen)
        assert_allclose(result.torque, instant.torque, **ROUND_OFF)
        assert_allclose(result.unknown_wrench, instant.base_reaction, **ROUND_OFF)


def test_neglecting_angular_acceleration_is_exact_only_without_it(tmp_path):
    rng = np.random.default_rng(4)
    robot = random_robot(tmp_path, rng, fixed_base=False)
    instant = Truth(robot).instant(rng)
    neglected = TorqueModel(robot, angular_acceleration="neglected")
    told_zero = estimate(TorqueModel(robot), instant._replace(gyro_dot=np.zeros(3)))
    assert_allclose(estimate(neglected, instant).torque, told_zero.torque, rtol=1e-12)
    assert np.abs(told_zero.torque - instant.torque).max() > 0.1


def test_a_contact_is_felt_where_it_acts(tmp_path):
    """Wrong on purpose: a push that the estimator is not told of as a contact changes the unknown wrench instead."""
    rng = np.random.default_rng(5)
    robot = random_robot(tmp_path, rng, fixed_base=False, sensors=0)
    push = Push(Mount("somewhere", "l8"), rng.uniform(-50.0, 50.0, 6))
    instant = Truth(robot).instant(rng, [push])
    on_base, on_link = estimate(TorqueModel(robot), instant), estimate(TorqueModel(robot, "l8"), instant)
    assert_allclose(on_link.torque, instant.torque, **ROUND_OFF)
    assert_allclose(on_link.unknown_wrench, push.wrench, **ROUND_OFF)
    assert np.abs(on_base.torque - instant.torque).max() > 1.0
    assert_allclose(on_base.unknown_wrench[:3], push.wrench[:3], **ROUND_OFF)


def test_double_pendulum_in_closed_form(tmp_path):
    """Two point masses on massless rods that swing in the x-z plane; the textbook's torques."""
    l1, l2, m1, m2, g = 0.4, 0.3, 2.0, 1.5, 9.81
    robot = pendulum(tmp_path, l1, l2, m1, m2)
    model = TorqueModel(robot, base="fixed")
    q, v, a = np.array([0.4, -0.9]), np.array([1.3, 2.1]), np.array([-3.0, 5.0])
    inner = m2 * l1 * l2
    both = q[0] + q[1]
    expected = [
        (m1 * l1**2 + m2 * (l1**2 + l2**2) + 2 * inner * np.cos(q[1])) * a[0]
        + (m2 * l2**2 + inner * np.cos(q[1])) * a[1]
        - inner * np.sin(q[1]) * (2 * v[0] * v[1] + v[1] ** 2)
        + (m1 + m2) * g * l1 * np.sin(q[0])
        + m2 * g * l2 * np.sin(both),
        (m2 * l2**2 + inner * np.cos(q[1])) * a[0]
        + m2 * l2**2 * a[1]
        + inner * np.sin(q[1]) * v[0] ** 2
        + m2 * g * l2 * np.sin(both),
    ]
    result = model.estimate(MeasuredMotion(q, v, a, np.zeros(6), np.zeros(3)), np.zeros(0))
    assert_allclose(result.torque, expected, rtol=1e-7)  # the tip's inertia of 1e-9 kg m^2 stands for a point


def pendulum(folder, l1, l2, m1, m2) -> Robot:
    def point(name, mass, length):
        return (
            f'<link name="{name}"><inertial><origin xyz="0 0 {-length}"/><mass value="{mass}"/>'
            '<inertia ixx="1e-9" iyy="1e-9" izz="1e-9" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )

    file = folder / "pendulum.urdf"
    axis = (0.0, -1.0, 0.0)
    shoulder, elbow = Pose(), Pose((0.0, 0.0, -l1))
    file.write_text(
        f'<robot name="pendulum">{point("base", 1.0, 0.0)}{point("upper", m1, l1)}{point("lower", m2, l2)}'
        f"{joint_xml('shoulder', 'revolute', 'base', 'upper', shoulder, axis)}"
        f"{joint_xml('elbow', 'revolute', 'upper', 'lower', elbow, axis)}</robot>"
    )
    return Robot("pendulum", file, "base", True, ("shoulder", "elbow"), np.zeros(2), folder / "pendulum.yaml")


REFUSED = [
    ({"unknown": "nose"}, "no link 'nose'"),
    ({"imu": "nose"}, "no IMU 'nose'; there are"),
    ({"base": "fixed"}, "'fixed' requires a welded base"),
]


@pytest.mark.parametrize(("arguments", "message"), REFUSED)
def test_refusals(tmp_path, arguments, message):
    robot = random_robot(tmp_path, np.random.default_rng(6), fixed_base=False)
    with pytest.raises(ParamsError, match=message):
        TorqueModel(robot, **arguments)


def test_refuses_a_robot_without_imu_and_a_sensor_on_a_moving_joint(tmp_path):
    robot = random_robot(tmp_path, np.random.default_rng(7), fixed_base=False)
    with pytest.raises(ParamsError, match="expected an IMU"):
        TorqueModel(replace(robot, imu=()))
    moving = replace(robot.force_torque[0], joint=robot.joints[0])
    with pytest.raises(ParamsError, match="expected a fixed joint"):
        TorqueModel(replace(robot, force_torque=(moving,)))
