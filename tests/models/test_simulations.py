"""Each committed robot: its YAML, actuators and plant belong together, and half a second of its servos stays finite."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from optional import skip_without_robots
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from drake_tc.actuation.model_file import load_models
from drake_tc.actuation.wiring import actuated_joints, add_actuators
from drake_tc.robot.plant import add_robot, joint_limits
from drake_tc.robot.robot import Robot, load_robot

MODELS = Path(__file__).resolve().parents[2] / "models"
FILES = sorted(path for path in MODELS.glob("*/*.yaml") if "\nurdf:" in path.read_text(encoding="utf-8"))


def robot_or_skip(path: Path) -> Robot:
    if "package://example-robot-data" in path.read_text(encoding="utf-8"):
        skip_without_robots()
    return load_robot(path)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_drives_hold_the_posture(path):
    """Servos are told to; motors without voltage brake what hardly moves, as all of a robot falls alike."""
    robot = robot_or_skip(path)
    models = load_models(robot.actuators)
    assert set(models) == set(robot.joints)
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(1e-3))
    add_robot(plant, robot)
    plant.Finalize()
    if not robot.fixed_base:  # free fall: the joints carry little
        assert plant.GetBodyByName(robot.base).is_floating_base_body()
    assert actuated_joints(plant) == list(robot.joints)
    actuators = add_actuators(builder, plant, models)
    servos = np.array([models[joint].drive.kind == "position_servo" for joint in robot.joints])
    hold = builder.AddNamedSystem("hold", ConstantVectorSource(np.where(servos, robot.posture, 0.0)))
    builder.Connect(hold.get_output_port(), actuators.GetInputPort("command"))
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(0.5)
    context = plant.GetMyContextFromRoot(simulator.get_context())
    positions = [plant.GetJointByName(name).get_angle(context) for name in robot.joints]
    assert np.isfinite(plant.GetPositionsAndVelocities(context)).all()
    limits = joint_limits(robot)
    assert_allclose(positions, robot.posture, atol=2e-3)  # sag of the servos and half of the dead zone
    assert (limits.lower <= robot.posture).all()
    assert (robot.posture <= limits.upper).all()
    assert (
        np.abs([plant.GetJointByName(name).get_angular_rate(context) for name in robot.joints]).max() < 1e-6
    )  # friction holds them


@pytest.mark.parametrize("path", [path for path in FILES if not path.stem.endswith("_leg")], ids=lambda path: path.stem)
def test_feet_stand_flat_on_the_ground(path):
    robot = robot_or_skip(path)
    plant = MultibodyPlant(1e-3)
    add_robot(plant, robot)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    for mount in robot.force_torque[:2]:
        sole = plant.GetBodyByName(mount.contact.link).EvalPoseInWorld(context) @ mount.contact.pose.transform
        assert_allclose(sole.translation()[2], 0.0, atol=1e-4)
        assert_allclose(sole.rotation().matrix()[2], [0, 0, 1], atol=1e-3)


def test_there_are_nine():
    assert len(FILES) == 9
