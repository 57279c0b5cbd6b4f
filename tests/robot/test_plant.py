"""What `add_robot` puts into a plant: base, order of the actuators, limits, inertias, geometry."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import JointActuatorIndex
from pydrake.systems.framework import DiagramBuilder

from drake_tc.errors import ParamsError
from drake_tc.robot.plant import add_robot, joint_limits, make_plant
from drake_tc.robot.robot import Pose, load_robot

from .robots import robot_file

BASE_POSE = {"xyz": [0.1, -0.2, 0.9], "rpy": [0.1, 0.2, -0.3]}


@pytest.mark.parametrize("fixed", [True, False])
@pytest.mark.parametrize("base", ["base", "slider"])
def test_the_base_is_welded_or_floats_at_its_pose(tmp_path, fixed, base):
    robot = load_robot(robot_file(tmp_path, joints=["wrist"], fixed_base=fixed, base=base, base_pose=BASE_POSE))
    plant = make_plant(robot, 1e-3)
    body = plant.GetBodyByName(base)
    assert plant.num_velocities() == (1 if fixed else 7)
    assert body.is_floating_base_body() is not fixed
    pose = body.EvalPoseInWorld(plant.CreateDefaultContext())
    wanted = RigidTransform(RollPitchYaw(BASE_POSE["rpy"]), BASE_POSE["xyz"])
    assert_allclose(pose.GetAsMatrix4(), wanted.GetAsMatrix4(), atol=1e-14)
    if not fixed:
        assert body.floating_velocities_start_in_v() == 0
        assert_allclose(plant.GetFreeBodyPose(plant.CreateDefaultContext(), body).translation(), BASE_POSE["xyz"])


def test_a_floating_base_moves_as_a_free_body(tmp_path):
    plant = make_plant(load_robot(robot_file(tmp_path, joints=["wrist"], fixed_base=False, base="slider")), 1e-3)
    mass = plant.CalcMassMatrix(plant.CreateDefaultContext())
    assert_allclose(mass[3:6, 3:6], 6.6 * np.eye(3), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("joints", [["wrist", "shoulder", "spin"], ["spin", "wrist", "shoulder"]])
def test_actuators_are_in_the_robots_order(tmp_path, joints):
    robot = load_robot(robot_file(tmp_path, joints=joints))
    plant = make_plant(robot, 1e-3)
    actuators = [plant.get_joint_actuator(JointActuatorIndex(i)) for i in plant.GetJointActuatorIndices()]
    assert [actuator.joint().name() for actuator in actuators] == joints
    assert [actuator.input_start() for actuator in actuators] == [0, 1, 2]
    selector = plant.MakeActuationMatrix()
    rows = [plant.GetJointByName(name).velocity_start() for name in joints]
    assert_array_equal(np.argmax(selector, axis=0), rows)


def test_limits_come_from_the_urdf_and_zero_means_unknown(tmp_path):
    limits = joint_limits(load_robot(robot_file(tmp_path, joints=["wrist", "slide", "spin"])))
    assert_array_equal(limits.effort, [9, np.inf, np.inf])
    assert_array_equal(limits.velocity, [5, np.inf, np.inf])
    assert_array_equal(limits.lower, [-2, 0.05, -np.inf])
    assert_array_equal(limits.upper, [2, 0.3, np.inf])


def test_the_robot_file_replaces_limits_in_the_plant_too(tmp_path):
    changes = {"wrist": {"effort": 4.5, "lower": -0.5}, "shoulder": {"velocity": 1.5, "upper": float("inf")}}
    robot = load_robot(robot_file(tmp_path, limits=changes))
    limits = joint_limits(robot)
    assert_array_equal(limits.effort, [4.5, 40])
    assert_array_equal(limits.velocity, [5, 1.5])
    assert_array_equal(limits.lower, [-0.5, -1])
    assert_array_equal(limits.upper, [2, np.inf])
    plant = make_plant(robot, 1e-3)
    for i, name in enumerate(robot.joints):
        joint = plant.GetJointByName(name)
        assert plant.GetJointActuatorByName(name).effort_limit() == limits.effort[i]
        assert joint.velocity_upper_limits()[0] == limits.velocity[i]
        assert (joint.position_lower_limit(), joint.position_upper_limit()) == (limits.lower[i], limits.upper[i])


DRIVES = """
joints:
  wrist:
    drive: {kind: current, gain: 0.4}
    effects:
      - {effect: rotor_inertia, rotor_inertia: 0.25}
      - {effect: viscous, viscous: 1.0}
  shoulder:
    drive: {kind: current, gain: 0.4}
    effects:
      - {effect: rotor_inertia, rotor_inertia: 0.5}
      - {effect: elasticity, compliance: 1.0e-3}
"""


def mass_with_drives(robot):
    plant = MultibodyPlant(0.0)
    add_robot(plant, robot)
    plant.Finalize()
    return plant.CalcMassMatrix(plant.CreateDefaultContext()), plant.GetJointByName("wrist").velocity_start()


@pytest.mark.parametrize("source", ["robot file", "actuator file"])
def test_rotor_inertia_adds_to_the_mass_matrix(tmp_path, source):
    """That of the actuator file counts as well; a motor behind a spring moves on its own."""
    (tmp_path / "drives.yaml").write_text(DRIVES, encoding="utf-8")
    given = {"rotor_inertia": {"wrist": 0.25}} if source == "robot file" else {"actuators": "drives.yaml"}
    robot = load_robot(robot_file(tmp_path, **given))
    links = make_plant(robot, 1e-3)
    mass, i = mass_with_drives(robot)
    expected = np.zeros((2, 2))
    expected[i, i] = 0.25
    assert_allclose(mass - links.CalcMassMatrix(links.CreateDefaultContext()), expected, atol=1e-15)


def test_a_joint_without_a_model_in_the_actuator_file_is_an_error(tmp_path):
    (tmp_path / "drives.yaml").write_text(DRIVES.replace("shoulder", "elbow"), encoding="utf-8")
    with pytest.raises(ParamsError, match="no model of joint 'shoulder'; joints there: wrist, elbow"):
        mass_with_drives(load_robot(robot_file(tmp_path, actuators="drives.yaml")))


def test_the_posture_is_where_the_plant_starts(tmp_path):
    robot = load_robot(robot_file(tmp_path, posture={"shoulder": 0.7}))
    assert_array_equal(robot.posture, [0.0, 0.7])
    plant = make_plant(robot, 1e-3)
    context = plant.CreateDefaultContext()
    assert [plant.GetJointByName(name).get_angle(context) for name in robot.joints] == [0.0, 0.7]
    with pytest.raises(ValueError, match="read-only"):
        robot.posture[0] = 1.0


@pytest.mark.parametrize(("visuals", "collisions"), [(False, False), (True, False), (False, True), (True, True)])
def test_geometry_is_there_on_request(tmp_path, visuals, collisions):
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 1e-3)
    add_robot(plant, load_robot(robot_file(tmp_path)), visuals=visuals, collisions=collisions)
    plant.Finalize()
    body = plant.GetBodyByName("upper")
    assert len(plant.GetVisualGeometriesForBody(body)) == int(visuals)
    assert len(plant.GetCollisionGeometriesForBody(body)) == int(collisions)


def test_a_continuous_plant_can_be_made(tmp_path):
    plant = make_plant(load_robot(robot_file(tmp_path)), 0.0)
    assert plant.time_step() == 0.0
    assert plant.num_continuous_states() == 4


def test_sensor_mounts_take_their_defaults(tmp_path):
    path = robot_file(
        tmp_path,
        imu={"top": {"link": "upper", "rpy": [0, 0, 1.5]}},
        force_torque={
            "a": {"joint": "mark_joint"},
            "b": {"joint": "spin", "xyz": [0, 0, 1], "contact": {"link": "hand"}},
        },
    )
    robot = load_robot(path)
    assert robot.imu[0].pose == Pose(rpy=(0.0, 0.0, 1.5))
    first, second = robot.force_torque
    assert (first.contact.link, first.pose, first.contact.pose) == ("mark", Pose(), Pose())
    assert (second.contact.link, second.pose) == ("hand", Pose(xyz=(0.0, 0.0, 1.0)))
