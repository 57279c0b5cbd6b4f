"""A robot in a MultibodyPlant: links, driven joints, actuators in the robot's order.

What the drives of a robot add to its joints' inertia, as its files say.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import cycle
from typing import Any

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import DiscreteContactApproximation, MultibodyPlant

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.model_file import models_of_joints
from drake_tc.errors import ParamsError
from drake_tc.robot.pictures import add_pictures
from drake_tc.robot.robot import Robot, position_range
from drake_tc.robot.urdf import Followers, reduced_urdf
from drake_tc.robot.urdf_tree import read_urdf
from drake_tc.types import FloatArray


def file_rotors(robot: Robot) -> dict[str, float]:
    """Reflected inertia of each joint's drive [kg m^2], as the robot's files say; 0 behind a spring or a gap.

    Raises:
        ParamsError: the actuator file cannot be read or has no model of a joint.
    """
    if robot.actuators is None:
        return dict(robot.rotor_inertia)
    models = models_of_joints(robot.actuators, robot.joints)
    return {joint: 0.0 if model.transmission_effects else model.inertia for joint, model in models.items()}


def check_joint_types(robot: Robot, models: Iterable[ActuatorModel]) -> None:
    """Models of sliding joints are of joints that slide, and the others of joints that turn.

    Args:
        robot: Whose.
        models: In the order of its joints, once or several times over.

    Raises:
        ParamsError: one is not.
    """
    tree = read_urdf(robot.urdf, robot.splits)
    kinds = [tree.joints[joint].kind for joint in robot.joints]
    for joint, kind, model in zip(cycle(robot.joints), cycle(kinds), models, strict=False):
        expected = "prismatic" if kind == "prismatic" else "revolute"
        if model.joint_type != expected:
            raise ParamsError(
                f"models: joint {joint!r} is {expected} in {robot.urdf.name}; its model has joint_type:"
                f" {model.joint_type}"
            )


@dataclass(frozen=True, eq=False)
class Limits:
    """What the joints can do, in the order of the robot's joints; infinite where nothing is known.

    Attributes:
        effort: (n,) [N m].
        velocity: (n,) [rad/s].
        lower, upper: (n,) [rad].
    """

    effort: FloatArray
    velocity: FloatArray
    lower: FloatArray
    upper: FloatArray


def joint_limits(robot: Robot) -> Limits:
    """The URDF's limits, replaced where the robot file has others; a zero effort or velocity counts as not given.

    Raises:
        ParamsError: the URDF cannot be read.

    Example:
        >>> joint_limits(load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")).effort.shape
        (6,)
    """
    tree = read_urdf(robot.urdf, robot.splits)
    rows = []
    for name in robot.joints:
        tag, given = tree.joints[name], robot.limits.get(name, {})
        ends = position_range(name, tree, robot.limits)
        rows.append((given.get("effort", tag.effort), given.get("velocity", tag.velocity), *ends))
    table = np.array(rows, dtype=float)
    table.setflags(write=False)
    return Limits(*table.T)


def add_robot(
    plant: MultibodyPlant,
    robot: Robot,
    *,
    visuals: bool = False,
    collisions: bool = False,
    rotors: bool = True,
    followers: Followers | None = None,
) -> None:
    """Add a robot to a plant that is not finalized.

    Welds the base to the world at its pose, or lets it float from there; adds one JointActuator a joint, of the
    joint's name and effort limit, in the order of `robot.joints`, with the reflected rotor inertia that the robot file
    or its actuator file gives (`file_rotors`); the default positions are the robot's posture. The model
    instance has the robot's name.

    Args:
        plant: Not finalized; registered with a SceneGraph where geometry is requested.
        robot: From `load_robot`.
        visuals: Draw the robot (`drake_tc.robot.pictures`).
        collisions: Keep primitive collisions.
        rotors: Give the joints the inertia of their drives.
        followers: What is made of joints that follow a driven one by `<mimic>`. None: Drake couples them in a
            discrete plant, after the robot's joints in its state, and a continuous one, which cannot, refuses them.

    Raises:
        ParamsError: the URDF cannot be read or is refused by Drake, or the actuator file cannot or lacks a joint.

    Example:
        >>> plant = MultibodyPlant(1e-3)
        >>> add_robot(plant, load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml"))
        >>> plant.num_actuators()
        6
    """
    parser = Parser(plant)
    how = followers or ("mimic" if plant.time_step() > 0.0 else "refuse")
    if how == "mimic" and robot.followers:
        plant.set_discrete_contact_approximation(DiscreteContactApproximation.kLagged)  # only SAP couples joints
    text = reduced_urdf(robot, visuals=visuals, collisions=collisions, followers=how)
    try:
        (model,) = parser.AddModelsFromString(text, "urdf")
    except (RuntimeError, ValueError) as error:
        reason = " ".join(str(error).partition("error: ")[2].split()) or " ".join(str(error).split())
        raise ParamsError(f"{robot.urdf}: Drake refuses the robot: {reason}") from None
    if visuals and plant.geometry_source_is_registered():
        add_pictures(plant, robot, model)
    body = plant.GetBodyByName(robot.base, model)
    if robot.fixed_base:
        plant.WeldFrames(plant.world_frame(), body.body_frame(), robot.base_pose.transform)
    else:
        plant.SetDefaultFloatingBaseBodyPose(body, robot.base_pose.transform)
    limits, inertias = joint_limits(robot), file_rotors(robot) if rotors else {}
    for name, position in robot.follower_posture.items() if how != "weld" else ():
        follower: Any = plant.GetJointByName(name, model)
        follower.set_default_positions([position])
    for name, effort, position in zip(robot.joints, limits.effort, robot.posture, strict=True):
        joint: Any = plant.GetJointByName(name, model)
        joint.set_default_positions([position])
        actuator = plant.AddJointActuator(name, joint, float(effort))
        actuator.set_default_rotor_inertia(inertias.get(name, 0.0))
        actuator.set_default_gear_ratio(1.0)


def make_plant(robot: Robot, dt: float, *, followers: Followers | None = None) -> MultibodyPlant:
    """A finalized plant with the robot's links alone: the model inside estimators and controllers.

    It has no geometry and no rotor inertia: rotors belong to the models of the drives.

    Args:
        robot: From `load_robot`.
        dt: Time step [s]; 0 for a continuous plant.
        followers: See `add_robot`.

    Raises:
        ParamsError: the URDF cannot be read.
    """
    plant = MultibodyPlant(dt)
    add_robot(plant, robot, rotors=False, followers=followers)
    plant.Finalize()
    return plant
