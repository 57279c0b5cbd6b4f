"""Torque and acceleration limits as rows: which joint, which side, whatever the order of the joints."""

from itertools import product

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.errors import ParamsError
from drake_tc.robot.plant import joint_limits
from drake_tc.tsid.limits import AccelerationLimit, TorqueLimit

from .machines import machine, random_state


@pytest.fixture(params=["humanoid", "shuffled humanoid", "leg", "arm"])
def robot_model(request, tmp_path):
    return machine(request.param, tmp_path)


def test_acceleration_rows_pick_each_joint_by_name(robot_model):
    limit = AccelerationLimit.of(robot_model, period=1e-3)
    q, v = random_state(robot_model, 0, 0.1)
    rows = limit.rows(robot_model.terms(robot_model.create_scratch(), q, v))
    assert rows.labels == tuple(f"{joint} acceleration" for joint in robot_model.robot.joints)
    assert rows.group == "acceleration"
    plant_like = np.arange(robot_model.nv, dtype=float)
    assert_allclose(rows.matrix.vdot @ plant_like, robot_model.actuated)
    assert (rows.lower <= rows.upper).all()


def test_a_joint_about_to_pass_its_limits_is_held_by_its_own_row(robot_model):
    robot, it = robot_model.robot, robot_model
    limits = joint_limits(robot)
    limit = AccelerationLimit.of(it, period=1e-3, acceleration=50.0, velocity=2.0, margin=0.01)
    scratch, middle = it.create_scratch(), 0.5 * (np.maximum(limits.lower, -1.0) + np.minimum(limits.upper, 1.0))
    for j, way in product((0, len(robot.joints) - 1), (1.0, -1.0)):
        end = limits.upper[j] if way > 0.0 else limits.lower[j]
        if not np.isfinite(end):
            continue
        q, v = it.start.copy(), np.zeros(it.nv)
        q[it.positions] = middle
        q[it.positions[j]] = end - way * (0.01 + 1e-4)
        v[it.actuated[j]] = 0.099 * way
        rows = limit.rows(it.terms(scratch, q, v))
        ahead, behind = (rows.upper, rows.lower) if way > 0.0 else (-rows.lower, -rows.upper)
        others = np.delete(np.arange(len(robot.joints)), j)
        assert -50.0 < ahead[j] < -40.0  # v^2 / (2 room) = 49.0: it has to brake now, and can
        assert_allclose(ahead[others], 50.0)
        assert_allclose(behind, -50.0)
        assert rows.relaxed == 0
        v[it.actuated[j]] = 0.11 * way
        assert limit.rows(it.terms(scratch, q, v)).relaxed == 1


def test_velocity_limit_of_the_robot_is_the_default(robot_model):
    robot, it = robot_model.robot, robot_model
    speed = joint_limits(robot).velocity
    limit = AccelerationLimit.of(it, period=1e-3, acceleration=1e4)
    limits, (q, v) = joint_limits(robot), (it.start.copy(), np.zeros(it.nv))
    q[it.positions] = 0.5 * (np.maximum(limits.lower, -1.0) + np.minimum(limits.upper, 1.0))
    j = int(np.argmin(speed))
    v[it.actuated[j]] = speed[j] - 1e-3
    rows = limit.rows(it.terms(it.create_scratch(), q, v))
    assert_allclose(rows.upper[j], 1.0, rtol=1e-9)


def test_torque_rows_are_the_effort_limits(robot_model):
    robot = robot_model.robot
    limit = TorqueLimit.of(robot, share=0.5)
    rows = limit.rows(robot_model.terms(robot_model.create_scratch(), *random_state(robot_model, 0)))
    assert_allclose(rows.matrix.torque, np.eye(len(robot.joints)))
    assert_allclose(rows.upper, 0.5 * joint_limits(robot).effort)
    assert_allclose(rows.lower, -rows.upper)
    assert rows.labels == tuple(f"{joint} torque" for joint in robot.joints)
    assert limit.rows(None) is rows


@pytest.mark.parametrize(
    ("lower", "upper", "message"),
    [
        ([0.0, 1.0], [1.0, 1.0], "of 'b': expected lower < upper"),
        ([0.0, np.nan], [1.0, 1.0], "of 'b': expected lower < upper"),
        ([0.0], [1.0, 1.0], "expected 2 values a side"),
    ],
)
def test_refused_torques(lower, upper, message):
    with pytest.raises(ParamsError, match=message):
        TorqueLimit(("a", "b"), np.array(lower), np.array(upper))


@pytest.mark.parametrize("share", [0.0, -1.0, 1.001, 7.0, np.nan])
def test_refused_share(robot_model, share):
    with pytest.raises(ParamsError, match="expected a positive share, 1 at most"):
        TorqueLimit.of(robot_model.robot, share=share)


@pytest.mark.parametrize("margin", [-1.0, -1e-6, np.nan, np.inf])
def test_refused_margin(robot_model, margin):
    with pytest.raises(ParamsError, match="margin: expected a finite number >= 0"):
        AccelerationLimit.of(robot_model, period=1e-3, margin=margin)


@pytest.mark.parametrize("key", ["acceleration", "velocity"])
def test_refused_number_of_values(robot_model, key):
    with pytest.raises(ParamsError, match=f"{key}: expected a number or {robot_model.n} of them"):
        AccelerationLimit.of(robot_model, period=1e-3, **{key: np.ones(robot_model.n + 1)})
