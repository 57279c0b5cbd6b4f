"""Soft soles: a foot under a load sinks, tilts and rolls as springs in a grid do, in closed form or by root finding."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.math import RollPitchYaw
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from scipy.optimize import root

from drake_tc.errors import ParamsError
from drake_tc.loops.whole_body.ground import GroundSpec, SoleSpec, add_ground, touching_points
from drake_tc.loops.whole_body.running import simulate_tsid
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.robot.fields import Mount
from drake_tc.tsid.contacts import Contact
from drake_tc.tsid.law import Status

TSID = Path(__file__).resolve().parents[3] / "models" / "coman_like" / "coman_like_tsid.yaml"
MASS, STIFFNESS, A, B = 20.0, 2.0e5, 0.1, 0.05
WEIGHT = MASS * 9.81
SOLE = Contact("sole", Mount("sole", "foot"), half_length=A - 0.005, half_width=B - 0.005)


def rested(offset, spec, duration=1.0):
    """(depth of the middle [m], turn about x and y [rad]) of a foot whose centre of mass is 20 mm over `offset` [m]."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 1e-3)
    ball = SpatialInertia(MASS, np.zeros(3), UnitInertia(0.02, 0.02, 0.02))
    body = plant.AddRigidBody("foot", ball.Shift(-np.array([*offset, 0.02])))
    add_ground(plant, [SOLE], spec)
    plant.Finalize()
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(duration)
    context = plant.GetMyContextFromRoot(simulator.get_context())
    assert np.abs(plant.GetVelocities(context)).max() < 2e-4
    pose = plant.EvalBodyPoseInWorld(context, body)
    return -pose.translation()[2], RollPitchYaw(pose.rotation()).vector()[:2]


def spread(half, count):
    """Mean square of `count` equally spaced places from -half to half."""
    return half**2 * (count + 1) / (3 * (count - 1))


@pytest.mark.parametrize("approximation", ["lagged", "sap", "similar"])
def test_under_its_middle_it_sinks_evenly(approximation):
    spec = GroundSpec(sole=SoleSpec(STIFFNESS, dissipation=20.0), approximation=approximation)
    depth, turn = rested((0.0, 0.0), spec, duration=1.5)
    assert_allclose(depth, WEIGHT / STIFFNESS, rtol=2e-3)  # SAP's own time constant is 0.2 s
    assert_allclose(turn, 0.0, atol=1e-6)


@pytest.mark.parametrize("points", [(2, 2), (5, 3), (7, 4)])
@pytest.mark.parametrize("offset", [(0.03, 0.0), (0.0, -0.015), (-0.02, 0.01)])
def test_off_its_middle_it_tilts_by_the_closed_form(offset, points):
    """theta_y = F x/(k r_x^2), theta_x = -F y/(k r_y^2): all points still touch."""
    depth, turn = rested(offset, GroundSpec(sole=SoleSpec(STIFFNESS, points, dissipation=20.0)))
    tilt = [-offset[1] / spread(B, points[1]), offset[0] / spread(A, points[0])]
    expected = WEIGHT / STIFFNESS * np.array(tilt)
    assert_allclose(turn, expected, rtol=0.02, atol=2e-5)  # the centre of mass moves by 0.02 theta, 1 % of its offset
    assert_allclose(depth, WEIGHT / STIFFNESS, rtol=0.01)


def test_near_its_edge_it_rolls_and_one_side_comes_off():
    """Balance of springs that cannot pull, solved for depth and turn, at 85 mm of 100; heel up by 9 mm."""
    spec = GroundSpec(sole=SoleSpec(STIFFNESS, (5, 3), dissipation=20.0))
    places, offset = touching_points(SOLE, spec)[:, 0], 0.085

    def balance(unknown):
        depth, slope = unknown[0] * 1e-3, unknown[1] * 1e-2
        rolled = spec.radius * (1.0 - np.cos(slope))
        forces = STIFFNESS / places.size * np.maximum(depth + np.sin(slope) * places + rolled, 0.0)
        arm = (places - offset) * np.cos(slope) + (spec.radius - 0.02) * np.sin(
            slope
        )  # spheres roll under their centres
        return [forces.sum() / WEIGHT - 1.0, (forces * arm).sum() / WEIGHT * 1e2]

    solution = root(balance, [-1.0, 2.0])
    assert solution.success
    depth, turn = rested((offset, 0.0), spec, duration=3.0)
    expected = solution.x * [1e-3, 1e-2]
    assert expected[1] > 2.0 * WEIGHT / STIFFNESS * offset / spread(A, 5)  # far more than with all points down
    assert depth < 0.0  # the middle is in the air
    assert_allclose([depth, turn[1]], expected, rtol=0.01)


def test_points_fill_the_sole():
    spec = GroundSpec(sole=SoleSpec(STIFFNESS, (5, 3)))
    places = touching_points(SOLE, spec)
    assert len({tuple(place) for place in places.round(9)}) == 15
    assert_allclose(places.min(axis=0), [-A, -B, 0.0], atol=1e-12)
    assert_allclose(places.max(axis=0), [A, B, 0.0], atol=1e-12)
    assert_allclose(places.mean(axis=0), 0.0, atol=1e-12)
    assert_allclose((places[:, 0] ** 2).mean(), spread(A, 5), rtol=1e-12)
    toe = Contact("toe", Mount("toe", "foot"), kind="point")
    assert_allclose(touching_points(toe, spec), np.zeros((1, 3)))
    assert_allclose(touching_points(SOLE, GroundSpec()), SOLE.corners + 0.005 * np.sign(SOLE.corners))


def test_a_robot_stands_on_soft_soles():
    """Its controller takes them for rigid: it sinks by half a millimetre and comes to rest."""
    ground = GroundSpec(sole=SoleSpec(3.0e5, dissipation=10.0))
    recording = simulate_tsid(TsidScenario(controller=str(TSID), duration=0.8, ground=ground))
    assert recording.fell is None
    assert recording.status(Status.FALLBACK).max() == 0.0
    model = recording.law.model
    state = recording["state"][-1]
    terms = model.terms(model.create_scratch(), state[: model.nq], state[model.nq :])
    depth = [-terms.pose(contact.name)[1][2] for contact in model.contacts]
    assert_allclose(depth, 31.2 * 9.81 / 6.0e5, rtol=0.1)
    assert np.abs(recording["state"][-100:, model.nq :]).max() < 0.02


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"stiffness": 0.0}, "stiffness: expected a positive number"),
        ({"stiffness": 1e5, "points": (5, 1)}, r"points: expected two numbers >= 2, got \(5, 1\)"),
        ({"stiffness": 1e5, "points": (5,)}, "points: expected two numbers"),
        ({"stiffness": 1e5, "dissipation": -1.0}, "dissipation: expected a number >= 0"),
    ],
)
def test_impossible_soles_are_refused(fields, message):
    with pytest.raises(ParamsError, match=message):
        SoleSpec(**fields)


def test_either_hard_or_soft():
    with pytest.raises(ParamsError, match="expected either stiffness, of hard soles, or sole, got both"):
        GroundSpec(stiffness=1e6, sole=SoleSpec(1e5))
