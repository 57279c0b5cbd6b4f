"""Inertial parameters of the links of a robot file: composite bodies, regressor columns, tolerances, refusals."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.tree import MultibodyForces
from robot_files import joint_tag, link_tag, urdf, write_robot

from drake_tc.errors import ParamsError
from drake_tc.identification.regression import base_combinations
from drake_tc.robot.plant import make_plant
from drake_tc.robot.rigid_regressor import LIGHTEST, LINK_PARAMETERS, PAYLOAD_SIZE, UNITS, link_model
from drake_tc.robot.robot import load_robot

TOOL_ANGLE, TOOL_MASS, TOOL_COM = 0.7, 0.4, 0.05
TOOL_INERTIA = np.diag([0.002, 0.003, 0.001])
URDF = urdf(
    link_tag("upper", (0.02, 0.01, -0.2), 3, (0.05, 0.06, 0.02, 0.001, -0.002, 0.003)),
    link_tag("lower", (0, 0, -0.15), 1.5, (0.02, 0.02, 0.005)),
    link_tag("tool", (TOOL_COM, 0, 0), TOOL_MASS, np.diag(TOOL_INERTIA)),
    joint_tag("shoulder", "base", "upper", axis=(0, 1, 0)),
    joint_tag("elbow", "upper", "lower", xyz=(0, 0.1, -0.4), axis=(1, 0, 0)),
    joint_tag("mount", "lower", "tool", xyz=(0, 0, -0.3), rpy=(0, TOOL_ANGLE, 0), axis=(1, 0, 0), kind="fixed"),
)


def robot(folder, joints=("shoulder", "elbow"), **more):
    return load_robot(write_robot(folder, URDF, joints, **more))


def test_what_is_welded_to_a_link_is_part_of_it(tmp_path):
    model = link_model(robot(tmp_path))
    assert model.tree.links == ("upper", "lower")
    c, s = np.cos(TOOL_ANGLE), np.sin(TOOL_ANGLE)
    turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    com = turn @ [TOOL_COM, 0.0, 0.0] + [0.0, 0.0, -0.3]
    about = turn @ TOOL_INERTIA @ turn.T + TOOL_MASS * (com @ com * np.eye(3) - np.outer(com, com))
    own = np.diag([0.02 + 1.5 * 0.15**2, 0.02 + 1.5 * 0.15**2, 0.005])
    expected = [1.5 + TOOL_MASS, *(1.5 * np.array([0.0, 0.0, -0.15]) + TOOL_MASS * com)]
    assert_allclose(model.nominal[10:14], expected, atol=1e-12)
    assert_allclose(model.nominal[14:], (own + about)[np.triu_indices(3)], atol=1e-12)


@pytest.mark.parametrize("order", [("shoulder", "elbow"), ("elbow", "shoulder")])
def test_columns_times_the_files_parameters_are_drakes_inverse_dynamics_in_the_robots_order(tmp_path, order):
    arm = robot(tmp_path, order)
    model, plant = link_model(arm), make_plant(arm, 0.0)
    context = plant.CreateDefaultContext()
    q, v, vdot = np.random.default_rng(0).normal(size=(3, 8, 2))
    expected = []
    for row in zip(q, v, vdot, strict=True):
        for name, position, rate in zip(order, row[0], row[1], strict=True):
            plant.GetJointByName(name).set_angle(context, position)
            plant.GetJointByName(name).set_angular_rate(context, rate)
        places = [plant.GetJointByName(name).velocity_start() for name in order]
        rate_of_change = np.empty(2)
        rate_of_change[places] = row[2]
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)
        expected.append(plant.CalcInverseDynamics(context, rate_of_change, forces)[places])
    assert_allclose(model.columns(q, v, vdot) @ model.nominal, expected, atol=1e-9)


def test_tolerances_follow_mass_and_size(tmp_path):
    model = link_model(robot(tmp_path))
    spread = model.deviations(0.3).reshape(2, 10)
    for masses, size, row in zip(model.nominal[::10], model.size, spread, strict=True):
        assert_allclose(row, 0.3 * masses * size ** np.array([0, 1, 1, 1, 2, 2, 2, 2, 2, 2]))
    assert model.size[0] >= 0.5 * np.hypot(0.1, 0.4)  # half the distance of the elbow
    assert_allclose(model.payload_deviations[:2], model.nominal[::10].sum() * np.array([1.0, PAYLOAD_SIZE]))
    assert LIGHTEST * model.nominal[::10].mean() < model.nominal[::10].min()
    assert len(UNITS) == len(LINK_PARAMETERS)


def test_a_floating_base_is_refused(tmp_path):
    with pytest.raises(ParamsError, match=r"fixed_base: load: \{robot: fitted\}"):
        link_model(robot(tmp_path, fixed_base=False))


def test_base_combinations_give_the_same_torques_with_fewer_columns(tmp_path):
    model = link_model(robot(tmp_path))
    q, v, vdot = np.random.default_rng(1).normal(size=(3, 200, 2))
    matrix = model.columns(q, v, vdot).reshape(-1, 20)
    places, mix = base_combinations(matrix)
    assert mix.shape == (places.size, 20)
    assert places.size == np.linalg.matrix_rank(matrix) < 20
    assert_allclose(mix[:, places], np.eye(places.size), atol=1e-12)
    for pi in (model.nominal, np.random.default_rng(2).normal(size=20)):
        assert_allclose(matrix[:, places] @ (mix @ pi), matrix @ pi, atol=1e-6 * np.abs(matrix @ pi).max())
