"""Axes of joints against those that Drake's joints give, and for joints whose Python type is not theirs."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint, RevoluteJoint, SpatialInertia, UnitInertia, WeldJoint

from drake_tc.robot.plant import has_axis, is_revolute, joint_axes


@pytest.fixture
def plant():
    plant = MultibodyPlant(0.0)
    inertia = SpatialInertia(1.0, np.zeros(3), UnitInertia(0.1, 0.1, 0.1))
    bodies = [plant.AddRigidBody(name, inertia) for name in ("floating", "turn", "slide", "fixed")]
    pose = RigidTransform(RollPitchYaw(0.3, -0.5, 1.1), np.array([0.1, 0.2, 0.3]))
    one = RevoluteJoint("turn", bodies[0].body_frame(), bodies[1].body_frame(), np.array([1.0, -2.0, 0.5]))
    two = PrismaticJoint("slide", bodies[1].body_frame(), bodies[2].body_frame(), np.array([0.0, 0.6, 0.8]))
    plant.AddJoint(one)
    plant.AddJoint(two)
    plant.AddJoint(WeldJoint("fixed", bodies[2].body_frame(), bodies[3].body_frame(), pose))
    plant.Finalize()
    return plant


def test_axes_are_those_of_the_joints(plant):
    turn, slide, fixed = (plant.GetJointByName(name) for name in ("turn", "slide", "fixed"))
    assert (has_axis(turn), has_axis(slide), has_axis(fixed)) == (True, True, False)
    assert (is_revolute(turn), is_revolute(slide)) == (True, False)
    axes = joint_axes(plant, [slide, turn])
    assert_allclose(axes, [slide.translation_axis(), turn.revolute_axis()], atol=1e-14)
    assert_allclose(np.linalg.norm(axes, axis=1), 1.0, atol=1e-14)
    assert joint_axes(plant, []).shape == (0, 3)


def test_the_python_type_of_a_joint_is_not_asked(plant):
    class Renamed:
        """A joint that only answers what every joint can."""

        def __init__(self, joint):
            for name in ("type_name", "position_start", "frame_on_parent", "frame_on_child"):
                setattr(self, name, getattr(joint, name))

    turn = Renamed(plant.GetJointByName("turn"))
    assert has_axis(turn) and is_revolute(turn)
    assert_allclose(joint_axes(plant, [turn])[0], np.array([1.0, -2.0, 0.5]) / np.sqrt(5.25), atol=1e-14)
