"""The URDF that a plant is built from: driven joints only, no meshes, nothing that Drake's parser stumbles over."""

import copy
import math
import xml.etree.ElementTree as ET
from typing import Any, Literal

import numpy as np
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RollPitchYaw

from drake_tc.errors import ParamsError
from drake_tc.robot.link_changes import change_urdf
from drake_tc.robot.robot import Robot, position_range
from drake_tc.robot.urdf_tree import JointTag, UrdfTree, read_urdf

_SOLIDS = ("box", "cylinder", "sphere", "capsule")


def _pose_tag(X: RigidTransform) -> ET.Element:
    xyz, rpy = X.translation(), RollPitchYaw(X.rotation()).vector()
    text = {name: " ".join(repr(float(x)) for x in vector) for name, vector in (("xyz", xyz), ("rpy", rpy))}
    return ET.Element("origin", text)


def locked_origin(joint: JointTag, position: float) -> RigidTransform:
    """X_PC(q): pose of the child link in the parent link with the joint at `position` [rad or m].

    Exact: the joint's motion (rotation about, or translation along its axis) appended to its origin.
    """
    axis: Any = np.array(joint.axis)
    motion = RigidTransform()
    if joint.kind == "prismatic":
        motion = RigidTransform(position * axis)
    elif joint.movable:
        motion = RigidTransform(AngleAxis(position, axis), 0.0 * axis)
    located: RigidTransform = joint.origin.transform @ motion
    return located


def _turned_over(robot: Robot, tree: UrdfTree) -> set[str]:
    """Fixed joints between the URDF's root and a floating base below it: these hang the root from the base."""
    above = {joint.child: joint for joint in tree.joints.values()}
    turned: set[str] = set()
    link = robot.base
    while not robot.fixed_base and link in above:
        turned.add(above[link].name)
        link = above[link].parent
    return turned


Followers = Literal["refuse", "free", "mimic", "weld"]
"""Joints that follow a driven one: an error, joints that a program moves, joints that Drake couples, or fixed ones."""


def _joint_tag(joint: JointTag, robot: Robot, tree: UrdfTree, *, turned: bool, followers: Followers) -> ET.Element:
    follows = joint.name in robot.followers
    driven = joint.name in robot.joints or (follows and followers != "weld")
    kind = ("prismatic" if joint.kind == "prismatic" else "revolute") if driven else "fixed"
    tag = ET.Element("joint", {"name": joint.name, "type": kind})
    ET.SubElement(tag, "parent", {"link": joint.child if turned else joint.parent})
    ET.SubElement(tag, "child", {"link": joint.parent if turned else joint.child})
    at = robot.follower_posture[joint.name] if follows else robot.locked.get(joint.name, 0.0)
    origin = locked_origin(joint, 0.0 if driven else at)
    tag.append(_pose_tag(origin.inverse() if turned else origin))
    if driven:
        ET.SubElement(tag, "axis", {"xyz": " ".join(repr(x) for x in joint.axis)})
        lower, upper = position_range(joint.name, tree, robot.limits)
        given = robot.limits.get(joint.name, {})
        values = {
            "lower": lower,
            "upper": upper,
            "velocity": given.get("velocity", joint.velocity),
            "effort": given.get("effort", joint.effort),
        }
        ET.SubElement(tag, "limit", {key: repr(value) for key, value in values.items() if math.isfinite(value)})
    if followers == "mimic" and follows:
        law = robot.followers[joint.name]
        ET.SubElement(tag, "mimic", {"joint": law.of, "multiplier": repr(law.multiplier), "offset": repr(law.offset)})
    return tag


def _solid(geometry: ET.Element) -> bool:
    shape = geometry.find("geometry")
    return shape is not None and any(shape.find(name) is not None for name in _SOLIDS)


def _link_tag(link: ET.Element, *, visuals: bool, collisions: bool) -> ET.Element:
    tag = ET.Element("link", {"name": str(link.get("name"))})
    inertial = link.find("inertial")
    if inertial is not None and inertial.find("mass") is not None:
        tag.append(copy.deepcopy(inertial))
    for name, requested in (("visual", visuals), ("collision", collisions)):
        if requested:
            tag.extend(copy.deepcopy(geometry) for geometry in link.findall(name) if _solid(geometry))
    return tag


def links_without_solids(robot: Robot) -> list[str]:
    """Links whose collision is given by meshes alone, which `reduced_urdf` leaves out.

    Args:
        robot: From `load_robot`.

    Raises:
        ParamsError: the URDF cannot be read.
    """
    tree = read_urdf(robot.urdf, robot.splits)
    out = []
    for link in tree.root.findall("link"):
        shapes = link.findall("collision")
        if link.get("name") in tree.links and shapes and not any(map(_solid, shapes)):
            out.append(str(link.get("name")))
    return out


def reduced_urdf(
    robot: Robot, *, visuals: bool = False, collisions: bool = False, followers: Followers = "refuse"
) -> str:
    """URDF text in which exactly the driven joints, and those that follow them, move.

    All other joints are fixed at their locked position, which keeps frames and masses exactly. Meshes, transmission,
    gazebo and dynamics tags go (friction and damping belong to the actuators), as does a link
    `world`; a floating base is the root; limits are the robot file's where it has some. Inertias are those that
    `robot.changes` makes of the URDF's.

    Args:
        robot: From `load_robot`.
        visuals: Keep visuals that are boxes, cylinders, spheres or capsules.
        collisions: The same for collisions.
        followers: What is made of joints that follow a driven one.

    Raises:
        ParamsError: the URDF cannot be read, or joints follow others and are to be refused.
    """
    tree = read_urdf(robot.urdf, robot.splits)
    if followers == "refuse" and robot.followers:
        name, law = next(iter(robot.followers.items()))
        line = tree.joints[name].line
        raise ParamsError(
            f"{robot.source}: joint {name!r} follows {law.of!r} (<mimic> of <joint> in line {line} of"
            f" {robot.urdf.name}), and what was asked for has no joints that follow others: lock it (locked: {{{name}:"
            f" 0}}), or take {law.of!r} out of joints"
        )
    root = ET.Element("robot", {"name": robot.name})
    if visuals:
        root.extend(copy.deepcopy(material) for material in tree.root.findall("material"))
    for link in tree.root.findall("link"):
        if link.get("name") in tree.links:
            root.append(_link_tag(link, visuals=visuals, collisions=collisions))
    turned = _turned_over(robot, tree)
    root.extend(
        _joint_tag(joint, robot, tree, turned=joint.name in turned, followers=followers)
        for joint in tree.joints.values()
    )
    change_urdf(root, robot.changes)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode")
