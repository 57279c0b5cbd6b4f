"""The links of a robot with a fixed base, as numbers for inverse dynamics: what a joint moves, and where it stands."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import Robot
from drake_tc.robot.tree import has_axis, is_revolute, joint_axes
from drake_tc.types import FloatArray


@dataclass(frozen=True, eq=False)
class MovedLink:
    """The body that a joint moves, with all that is welded to it.

    Frames: F where the joint stands on the body before it, M on the moved body; they coincide at q = 0. P is the M of
    the joint before, the world for the first.

    Attributes:
        parent: Index of the joint before, -1 for the world; smaller than the joint's own.
        turns: Whether the joint is revolute.
        axis: (3,) in F and in M.
        rotation: (3, 3) R_PF.
        place: (3,) p_PF [m].
        mass: [kg].
        moment: (3,) mass times centre of mass, from Mo, in M [kg m].
        inertia: (3, 3) about Mo, in M [kg m^2].
    """

    parent: int
    turns: bool
    axis: FloatArray
    rotation: FloatArray
    place: FloatArray
    mass: float
    moment: FloatArray
    inertia: FloatArray


def moved_links(robot: Robot) -> tuple[list[MovedLink], FloatArray, list[int]]:
    """The links in an order in which each comes after that before it; gravity (3,) [m/s^2]; their joints' indices.

    The indices are those of `robot.joints`.

    Raises:
        ParamsError: a base that floats, or joints that are not the robot's or neither revolute nor prismatic.
    """
    if not robot.fixed_base:
        raise ParamsError(f"export --to c: {robot.source}: expected a fixed base; this robot's base floats")
    plant: Any = make_plant(robot, 0.0)
    if plant.num_velocities() != len(robot.joints):
        raise ParamsError(
            f"export --to c: {robot.source}: expected a robot whose {plant.num_velocities()} degrees of freedom are all"
            f" joints of the robot file, got {len(robot.joints)} joints"
        )
    joints = [plant.GetJointByName(name) for name in robot.joints]
    for joint in joints:
        if not has_axis(joint):
            raise ParamsError(f"export --to c: joint {joint.name()!r}: expected a revolute or prismatic joint")
    axes = joint_axes(plant, joints)
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, np.zeros(plant.num_positions()))
    carried = [{int(body.index()) for body in plant.GetBodiesWeldedTo(joint.child_body())} for joint in joints]
    order: list[int] = []
    while len(order) < len(joints):
        before = set().union(*(carried[i] for i in order), _world(plant))
        ready = [i for i in range(len(joints)) if i not in order and int(joints[i].parent_body().index()) in before]
        if not ready:
            raise ParamsError(f"export --to c: {robot.source}: a link is moved by a joint that the robot file lacks")
        order += ready
    links = [_link(plant, context, joints, carried, order, i, axes[i]) for i in order]
    return links, np.array(plant.gravity_field().gravity_vector()), order


def _world(plant: Any) -> set[int]:
    return {int(body.index()) for body in plant.GetBodiesWeldedTo(plant.world_body())}


def _link(
    plant: Any, context: Any, joints: list[Any], carried: list[set[int]], order: list[int], i: int, axis: FloatArray
) -> MovedLink:
    """One link at q = 0."""
    joint = joints[i]
    holder = int(joint.parent_body().index())
    before = next((k for k in order if holder in carried[k]), None)
    base = plant.world_frame() if before is None else joints[before].frame_on_child()
    pose = plant.CalcRelativeTransform(context, base, joint.frame_on_parent())
    indices = [body.index() for body in plant.GetBodiesWeldedTo(joint.child_body())]
    lump = plant.CalcSpatialInertia(context, joint.frame_on_child(), indices)
    mass = float(lump.get_mass())
    return MovedLink(
        parent=-1 if before is None else order.index(before),
        turns=is_revolute(joint),
        axis=axis,
        rotation=np.array(pose.rotation().matrix()),
        place=np.array(pose.translation()),
        mass=mass,
        moment=mass * np.array(lump.get_com()),
        inertia=np.array(lump.CalcRotationalInertia().CopyToFullMatrix3()),
    )
