"""A robot in a MultibodyPlant: links, driven joints and actuators in the robot's order, and tables read from a plant.

Axes of revolute and prismatic joints are read from how the joints move. In Drake's newer bindings the Python type of a
joint can be that of another joint, of a plant that is gone: joints are therefore told apart by `type_name()`, which
asks the joint itself, and not by their Python type. `tree_of` reads the tables of a robot's tree
(`drake_tc.kernels.dynamics`) from a plant that holds the robot alone.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import cycle
from typing import Any, NamedTuple

import numpy as np
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import DiscreteContactApproximation, MultibodyPlant
from pydrake.multibody.tree import Joint
from scipy.spatial.transform import Rotation

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.model_file import models_of_joints
from drake_tc.errors import ParamsError
from drake_tc.robot.pictures import add_pictures
from drake_tc.robot.robot import Robot, position_range
from drake_tc.robot.urdf import Followers, reduced_urdf
from drake_tc.robot.urdf_tree import Mimic, read_urdf
from drake_tc.types import FloatArray, IntArray


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


REVOLUTE, PRISMATIC = "revolute", "prismatic"


def has_axis(joint: Joint) -> bool:
    """Whether the joint is revolute or prismatic."""
    return joint.type_name() in (REVOLUTE, PRISMATIC)


def is_revolute(joint: Joint) -> bool:
    """Whether the joint turns about an axis."""
    return bool(joint.type_name() == REVOLUTE)


def joint_axes(plant: MultibodyPlant, joints: Sequence[Joint]) -> FloatArray:
    """Unit axes (n, 3) of joints that have one, in the joint's frame on its parent (and on its child: it is the same).

    Args:
        plant: Finalized, with the joints.
        joints: Revolute or prismatic: see `has_axis`.
    """
    context = plant.CreateDefaultContext()
    q = plant.GetPositions(context).copy()
    q[[j.position_start() for j in joints]] = 1.0
    plant.SetPositions(context, q)
    axes = []
    for joint in joints:
        moved = plant.CalcRelativeTransform(context, joint.frame_on_parent(), joint.frame_on_child())
        if is_revolute(joint):
            axes.append(Rotation.from_matrix(moved.rotation().matrix()).as_rotvec())
        else:
            axes.append(moved.translation())
    return np.array(axes).reshape(-1, 3)


class Tree(NamedTuple):
    """See `drake_tc.kernels.dynamics`; frames as a table, a row a name in `frame_names`' order."""

    places: IntArray
    constants: FloatArray
    trunk: FloatArray
    frames: FloatArray
    frame_bodies: IntArray


@dataclass(frozen=True)
class TreeJoints:
    """The joints of a tree, and where they stand in q and v.

    Attributes:
        places: Index in q and in v by joint.
        followers: Joints of the plant that follow one of these: in the tree they have its place, and their torque is
            part of its own.
        rotors: Reflected inertia by joint [kg m^2, or kg of a slide].
        held: More joints, of any kind, that stay where they are; in the tree they have a zero axis.
    """

    places: Mapping[str, tuple[int, int]]
    followers: Mapping[str, Mimic] = field(default_factory=dict)
    rotors: Mapping[str, float] = field(default_factory=dict)
    held: tuple[str, ...] = ()


def in_order(robot: Robot) -> TreeJoints:
    """Joints of a robot that stand in q and v in the robot's order."""
    return TreeJoints({name: (i, i) for i, name in enumerate(robot.joints)}, robot.followers)


def tree_of(plant: Any, base: Any, joints: TreeJoints, frames: Mapping[str, Any], context: Any = None) -> Tree:
    """Walk from the base over the joints, whichever way round each of them stands.

    Args:
        plant: Finalized; its joints are those named, welds, and one that lets the base float.
        base: Body.
        joints: Of the tree.
        frames: Of the plant, by name.
        context: Of the plant, at q = 0, with the links' inertias; None: its default one.
    """
    context = plant.CreateDefaultContext() if context is None else context
    rows = {int(body.index()): 0 for body in plant.GetBodiesWeldedTo(base)}
    poses = [base.EvalPoseInWorld(context)]
    places, constants = [], []
    followers, held, left = joints.followers, joints.held, dict(joints.places)
    axes = dict(zip(left, joint_axes(plant, [plant.GetJointByName(name) for name in left]), strict=True))
    for name, law in followers.items():
        axes[name] = law.multiplier * joint_axes(plant, [plant.GetJointByName(name)])[0]
        left[name] = left[law.of]
    axes |= {name: np.zeros(3) for name in held}
    left |= dict.fromkeys(held, (0, 0))
    while left:
        name = next(name for name in left if any(row is not None for row in _known(plant, name, rows)))
        joint, known, (in_q, in_v) = plant.GetJointByName(name), _known(plant, name, rows), left.pop(name)
        ends = joint.frame_on_parent(), joint.frame_on_child()
        turned = known[0] is None
        inner, outer = ends[::-1] if turned else ends
        parent = next(row for row in known if row is not None)
        X_PI = poses[parent].inverse() @ inner.CalcPoseInWorld(context)
        slides = joint.type_name() == "prismatic" or name in held
        axis = axes[name] * (-1.0 if turned else 1.0)
        if name in followers and followers[name].offset:
            X_PI = X_PI @ _moved(axis / followers[name].multiplier, followers[name].offset, slides=slides)
        places.append((parent, int(slides), in_q, in_v))
        pose = outer.CalcPoseInWorld(context)
        body = _body(plant, context, outer.body(), pose)
        turning = [*X_PI.rotation().matrix().ravel(), *X_PI.translation(), *axis]
        constants.append([*turning, *body, joints.rotors.get(name, 0.0)])
        poses.append(pose)
        rows.update({int(welded.index()): len(poses) - 1 for welded in plant.GetBodiesWeldedTo(outer.body())})
    table, bodies = [], []
    for frame in frames.values():
        row = rows[int(frame.body().index())]
        X_BF = poses[row].inverse() @ frame.CalcPoseInWorld(context)
        table.append([*X_BF.rotation().matrix().ravel(), *X_BF.translation()])
        bodies.append(row)
    return Tree(
        np.array(places, dtype=np.int64).reshape(-1, 4),
        np.array(constants, dtype=np.float64).reshape(-1, 26),
        np.array(_body(plant, context, base, poses[0])),
        np.array(table, dtype=np.float64).reshape(-1, 12),
        np.array(bodies, dtype=np.int64),
    )


def _moved(axis: FloatArray, position: float, *, slides: bool) -> RigidTransform:
    """Pose of the outer frame of a joint at a position."""
    way: Any = axis
    return RigidTransform(position * way) if slides else RigidTransform(AngleAxis(position, way), 0.0 * way)


def _known(plant: Any, name: str, rows: Mapping[int, int]) -> list[int | None]:
    """Rows of the bodies at a joint's two ends, as far as the walk has come."""
    joint = plant.GetJointByName(name)
    return [rows.get(int(frame.body().index())) for frame in (joint.frame_on_parent(), joint.frame_on_child())]


def _body(plant: Any, context: Any, body: Any, pose: Any) -> list[float]:
    """Mass, centre of mass and inertia about it of a body with all that is welded to it, in the axes of `pose`."""
    mass, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    parts = []
    for welded in plant.GetBodiesWeldedTo(body):
        inertia = welded.CalcSpatialInertiaInBodyFrame(context)
        if inertia.get_mass() == 0.0:
            continue
        X = pose.inverse() @ welded.EvalPoseInWorld(context)
        turn, centre = X.rotation().matrix(), X.translation() + X.rotation().matrix() @ inertia.get_com()
        own = inertia.Shift(inertia.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
        parts.append((inertia.get_mass(), centre, turn @ own @ turn.T))
    for m, centre, _ in parts:
        mass, first = mass + m, first + m * centre
    middle = first / mass if mass else first
    for m, centre, own in parts:
        arm = centre - middle
        second += own + m * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return [mass, *middle, *np.diagonal(second), second[0, 1], second[0, 2], second[1, 2]]
