"""Our humanoids: each left link, joint and drive is the mirror of the right one."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.tree import BodyIndex

from drake_tc.actuation.model_file import load_models
from drake_tc.robot.plant import joint_limits, make_plant
from drake_tc.robot.robot import load_robot

MODELS = Path(__file__).resolve().parents[2] / "models"


@pytest.mark.parametrize(("name", "links"), [("hrp2_like", 7 + 8), ("coman_like", 7 + 5)])  # of a leg and an arm
def test_left_is_the_mirror_of_right(name, links):
    robot = load_robot(MODELS / name / f"{name}.yaml")
    plant, mirror = make_plant(robot, 1e-3), np.diag([1.0, -1.0, 1.0])
    context = plant.CreateDefaultContext()
    for joint in robot.joints:
        plant.GetJointByName(joint).set_angle(context, 0.0)
    plant.SetFreeBodyPose(context, plant.GetBodyByName(robot.base), robot.base_pose.transform)
    bodies = [plant.get_body(BodyIndex(i)).name() for i in range(plant.num_bodies())]
    rights = [body for body in bodies if body.startswith("r_")]
    assert len(rights) == links
    for right in rights:
        pair = [plant.GetBodyByName(side + right[1:]) for side in "rl"]
        inertias = [body.CalcSpatialInertiaInBodyFrame(context) for body in pair]
        assert inertias[0].get_mass() == inertias[1].get_mass()
        assert_allclose(mirror @ inertias[0].get_com(), inertias[1].get_com(), atol=1e-12)
        turns = [inertia.CalcRotationalInertia().CopyToFullMatrix3() for inertia in inertias]
        assert_allclose(mirror @ turns[0] @ mirror, turns[1], atol=1e-12)
        places = [body.EvalPoseInWorld(context).translation() for body in pair]
        assert_allclose(mirror @ places[0], places[1], atol=1e-9)
    limits, models = joint_limits(robot), load_models(robot.actuators)
    for i, right in enumerate(robot.joints):
        if right.startswith("r_"):
            j = robot.joints.index("l" + right[1:])
            ends = [limits.lower[i], limits.upper[i]]
            mirrored = ends if plant.GetJointByName(right).revolute_axis()[1] else [-ends[1], -ends[0]]
            assert_allclose([limits.lower[j], limits.upper[j]], mirrored)
            assert (limits.effort[i], limits.velocity[i]) == (limits.effort[j], limits.velocity[j])
            assert models[right].effects == models["l" + right[1:]].effects
            assert models[right].drive == models["l" + right[1:]].drive
