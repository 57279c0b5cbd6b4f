"""Gears that couple joints: power balance, and runs as the motors see them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.errors import RigError
from drake_tc.estimation.robot_loads import at_motors, motor_loads, motor_turns
from drake_tc.logs.record import Run
from drake_tc.logs.rig import parse_rig

JOINTS = ("a", "b", "c")
TURNS = motor_turns({"c": {"b": -0.5}}, JOINTS)


def test_motors_and_joints_have_the_same_power():
    rng = np.random.default_rng(0)
    rate, torque = rng.normal(size=(2, 50, 3))
    assert_allclose(np.sum((rate @ TURNS.T) * motor_loads(TURNS, torque), axis=1), np.sum(rate * torque, axis=1))


def test_columns_of_parameters_are_loads_too():
    columns = np.random.default_rng(1).normal(size=(5, 3, 4))
    assert_allclose(motor_loads(TURNS, columns)[:, :, 2], motor_loads(TURNS, columns[:, :, 2]))


def test_runs_have_the_motors_positions():
    time = np.arange(4) * 0.1
    columns = {f"{j}/position": k + time for k, j in enumerate(JOINTS)} | {"c/current": time}
    run = Run("r", None, time, 0.1, columns, np.zeros(4, dtype=int))
    (seen,) = at_motors(TURNS, JOINTS, [run])
    assert_allclose(seen.columns["c/position"], 2.0 + time - 0.5 * (1.0 + time))
    assert_allclose(seen.columns["b/position"], columns["b/position"])
    assert_allclose(seen.columns["c/current"], time)


def test_motors_that_turn_alike_are_refused():
    with pytest.raises(RigError, match="expected motors whose angles tell"):
        motor_turns({"a": {"b": 1.0}, "b": {"a": 1.0}}, JOINTS)


@pytest.mark.parametrize(
    ("coupled", "message"),
    [({"b": {"d": 1.0}}, "'d' is not a joint"), ({"b": {"a": 1.0}}, "requires load: {robot: ...}")],
)
def test_a_rig_that_cannot_be_coupled_is_refused(coupled, message):
    with pytest.raises(RigError, match=message):
        parse_rig({"joints": ["a", "b"], "drive": "current", "coupled": coupled})
