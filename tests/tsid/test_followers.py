"""A joint that follows another one moves and weighs with it in the terms of whole-body control."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces

from drake_tc.robot.robot import load_robot
from drake_tc.tsid.model import TsidModel

from ..robot.robots import ARM, robot_file

LAWS = {"slide": ("shoulder", -0.4, 0.2), "spin": ("shoulder", 0.28, 0.1)}
"""The slide follows the shoulder, and the spin the slide: -0.7 (-0.4 q + 0.2) + 0.24."""
TEXT = ARM.replace(
    '<axis xyz="1 1 0"/>', '<axis xyz="1 1 0"/><mimic joint="shoulder" multiplier="-0.4" offset="0.2"/>'
).replace('<axis xyz="0.3 -0.4 1"/>', '<axis xyz="0.3 -0.4 1"/><mimic joint="slide" multiplier="-0.7" offset="0.24"/>')


@pytest.mark.parametrize("fixed", [True, False])
def test_terms_are_those_of_drake_with_the_followers_projected(tmp_path, fixed):
    robot = load_robot(robot_file(tmp_path, TEXT, joints=["wrist", "shoulder"], fixed_base=fixed))
    model = TsidModel(robot)
    assert (model.n, model.nv) == (2, 2 if fixed else 8)
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(re.sub(r"<mimic[^>]*/>|<visual>.*?</visual>", "", TEXT), "urdf")
    if fixed:
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    plant.Finalize()
    context, forces = plant.CreateDefaultContext(), MultibodyForces(plant)
    rng = np.random.default_rng(0)
    q = model.start.copy()
    q[model.positions] = rng.normal(size=2)
    v, vdot = rng.normal(size=(2, model.nv))
    base = 0 if fixed else 6
    moves = np.zeros((plant.num_velocities(), model.nv))
    moves[:base, :base] = np.eye(base)
    for i, joint in enumerate(robot.joints):
        moves[plant.GetJointByName(joint).velocity_start(), model.actuated[i]] = 1.0
    place = np.zeros(plant.num_positions())
    place[: base and 7] = q[: base and 7]
    for i, joint in enumerate(robot.joints):
        place[plant.GetJointByName(joint).position_start()] = q[model.positions[i]]
    for name, (of, multiplier, offset) in LAWS.items():
        i, joint = robot.joints.index(of), plant.GetJointByName(name)
        moves[joint.velocity_start(), model.actuated[i]] = multiplier
        place[joint.position_start()] = multiplier * q[model.positions[i]] + offset
    plant.SetPositions(context, place)
    plant.SetVelocities(context, moves @ v)
    terms = model.terms(model.create_scratch(), q, v)
    expected = moves.T @ (
        plant.CalcInverseDynamics(context, moves @ vdot, forces) - plant.CalcGravityGeneralizedForces(context)
    )
    assert_allclose(terms.mass_matrix @ vdot + terms.bias, expected, rtol=1e-9, atol=1e-9)
    mass = moves.T @ plant.CalcMassMatrix(context) @ moves
    assert_allclose(terms.mass_matrix, mass, rtol=1e-9, atol=1e-10)
    frame, world = plant.GetFrameByName("hand"), plant.world_frame()
    full = plant.CalcJacobianSpatialVelocity(context, JacobianWrtVariable.kV, frame, np.zeros(3), world, world)
    found = terms.frame("hand")
    assert_allclose(found.jacobian, full @ moves, rtol=1e-9, atol=1e-10)
    assert_allclose(found.position, frame.CalcPoseInWorld(context).translation(), atol=1e-10)
    assert_allclose(terms.com, plant.CalcCenterOfMassPositionInWorld(context), atol=1e-10)
