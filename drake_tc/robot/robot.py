"""A robot as data: which URDF, which joints are driven in which order, where the sensors sit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from drake_tc.config.keys import unknown_key
from drake_tc.config.quoted import did_you_mean
from drake_tc.config.records import validated
from drake_tc.config.yaml_file import read_yaml
from drake_tc.errors import ParamsError
from drake_tc.robot.document import RobotDocument, check_link, force_torque_mounts, imu_mounts, link_splits
from drake_tc.robot.fields import ForceTorqueMount, Mount, Pose
from drake_tc.robot.link_changes import LinkChanges, link_changes
from drake_tc.robot.urdf_tree import LinkSplit, Mimic, UrdfTree, read_urdf
from drake_tc.simulator_files.urdf import resolve, urdf_joints
from drake_tc.types import FloatArray

__all__ = ["ForceTorqueMount", "Mount", "Pose", "Robot", "load_robot"]

SHOWN = 3
"""Joints that a sentence names; of more it says how many."""


@dataclass(frozen=True, eq=False)
class Robot:
    """What a robot file says; n joints, SI units. `load_robot` checks all of it against the URDF.

    Attributes:
        name: Of the robot; also of its model instance in a plant.
        urdf: The file.
        base: Link that is welded to the world, or that floats.
        fixed_base: Whether it is welded.
        base_pose: X_WB of the welded base, or where the floating base starts.
        joints: Driven joints, in the order of every vector of joints.
        locked: Position of each joint that neither is driven nor follows one [rad or m].
        followers: Joints that follow a driven one, by the URDF's `<mimic>`: q = multiplier q_of + offset.
        imu: IMU frames.
        force_torque: Force/torque sensors, in the order of their logs.
        actuators: Actuator model file, or None.
        rotor_inertia: Reflected rotor inertia by joint [kg m^2]; only where there is no actuator file.
        limits: By joint, the limits that replace the URDF's: `effort`, `velocity`, `lower`, `upper`.
        posture: (n,) where the joints start [rad].
        source: The robot file.
        splits: Links that an F/T sensor inside them divides in two.
        unused: Sentences on what the URDF says of the driven joints' physics and is not used.
        changes: What `close-loop` found of the links' inertias and payloads, as the actuator model file says.

    Example:
        >>> robot = load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")
        >>> len(robot.joints), robot.fixed_base
        (6, True)
    """

    name: str
    urdf: Path
    base: str
    fixed_base: bool
    joints: tuple[str, ...]
    posture: FloatArray
    source: Path
    base_pose: Pose = field(default_factory=Pose)
    locked: Mapping[str, float] = field(default_factory=dict)
    imu: tuple[Mount, ...] = ()
    force_torque: tuple[ForceTorqueMount, ...] = ()
    actuators: Path | None = None
    rotor_inertia: Mapping[str, float] = field(default_factory=dict)
    limits: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    splits: tuple[LinkSplit, ...] = ()
    followers: Mapping[str, Mimic] = field(default_factory=dict)
    changes: LinkChanges = field(default_factory=LinkChanges)
    unused: tuple[str, ...] = ()

    @property
    def follower_posture(self) -> dict[str, float]:
        """Where the followers are while the joints are in the posture [rad or m]."""
        start = dict(zip(self.joints, self.posture.tolist(), strict=True))
        return {name: law.multiplier * start[law.of] + law.offset for name, law in self.followers.items()}


def _check_joints(where: str, joints: tuple[str, ...], tree: UrdfTree) -> None:
    for name in joints:
        if name in (mount.name for mount in tree.mounts.values()):
            raise ParamsError(
                f"{where}: the parent of joint {name!r} is the link 'world', which is reserved for the fixed world;"
                " give that link another name"
            )
        if name not in tree.joints:
            listed = f"movable joints: {', '.join(tree.movable)}"
            raise ParamsError(f"{where}: no joint {name!r} in the URDF{did_you_mean(name, tree.movable)}; {listed}")
        if not tree.joints[name].movable:
            raise ParamsError(
                f"{where}: joint {name!r} is {tree.joints[name].kind}, not movable;"
                f" movable joints: {', '.join(tree.movable)}"
            )


def _check_floating_base(base: str, joints: tuple[str, ...], tree: UrdfTree) -> None:
    above = {joint.child: joint for joint in tree.joints.values()}
    link = base
    while link in above:
        joint = above[link]
        if joint.name in joints:
            raise ParamsError(
                f"base: expected no driven joint between a floating base and the URDF's root;"
                f" {joint.name!r} is above {base!r}"
            )
        link = joint.parent


def _base_pose(base: str, tree: UrdfTree) -> Pose:
    """X_WB by the fixed joints from the URDF's link `world` to the base; the identity without such joints."""
    X_LB, link, above = RigidTransform(), base, {joint.child: joint for joint in tree.joints.values()}
    while link in above and above[link].kind == "fixed":
        X_LB, link = above[link].origin.transform @ X_LB, above[link].parent
    if link not in tree.mounts:
        return Pose()
    X_WB: Any = tree.mounts[link].origin.transform @ X_LB
    return Pose(tuple(X_WB.translation().tolist()), tuple(RollPitchYaw(X_WB.rotation()).vector().tolist()))


def position_range(joint: str, tree: UrdfTree, limits: Mapping[str, Mapping[str, float]]) -> tuple[float, float]:
    """(lower, upper) of a joint [rad or m]: the URDF's, unless replaced."""
    given = limits.get(joint, {})
    return given.get("lower", tree.joints[joint].lower), given.get("upper", tree.joints[joint].upper)


def _posture(
    given: Mapping[str, float], joints: tuple[str, ...], tree: UrdfTree, limits: Mapping[str, Mapping[str, float]]
) -> FloatArray:
    posture = np.zeros(len(joints))
    for i, joint in enumerate(joints):
        lower, upper = position_range(joint, tree, limits)
        if not lower < upper:
            raise ParamsError(f"limits.{joint}: expected lower < upper, got {lower:g} and {upper:g}")
        posture[i] = given[joint] if joint in given else min(max(0.0, lower), upper)
        if not lower <= posture[i] <= upper:
            raise ParamsError(f"posture.{joint}: expected {lower:g} to {upper:g}, got {posture[i]:g}")
    posture.setflags(write=False)
    return posture


def _locked(given: Mapping[str, float], joints: tuple[str, ...], tree: UrdfTree) -> dict[str, float]:
    """Positions of all movable joints outside `joints`; one that mimics a locked joint follows it unless given."""
    free = [name for name in tree.movable if name not in joints]
    for name in given:
        if name not in free:
            raise ParamsError(f"locked: {unknown_key(name, free)}")
    following = _followers(given, joints, tree)

    def position(name: str, followers: tuple[str, ...] = ()) -> float:
        if name in given:
            return given[name]
        tag, value = tree.joints[name], 0.0
        if tag.mimic is not None and tag.mimic.of in free and tag.mimic.of not in (name, *followers):
            value = tag.mimic.multiplier * position(tag.mimic.of, (name, *followers)) + tag.mimic.offset
        return min(max(value, tag.lower), tag.upper)

    return {name: position(name) for name in free if name not in following}


def _followers(given: Mapping[str, float], joints: tuple[str, ...], tree: UrdfTree) -> dict[str, Mimic]:
    """Joints that follow a driven one, over others where it is so; not those that the robot file locks."""
    found = {}
    for name in tree.movable:
        multiplier, offset, at, seen = 1.0, 0.0, name, {name}
        while at not in joints and at not in given and at in tree.joints:
            mimic = tree.joints[at].mimic
            if mimic is None or mimic.of in seen:
                break
            offset, multiplier, at = offset + multiplier * mimic.offset, multiplier * mimic.multiplier, mimic.of
            seen.add(at)
        if at in joints and at != name:
            found[name] = Mimic(at, multiplier, offset)
    return found


def _unused(urdf: Path, tree: UrdfTree, driven: Sequence[str], followers: Sequence[str]) -> tuple[str, ...]:
    """What the URDF says of joints and is not used, one sentence for joints of which it says the same."""
    try:
        read = urdf_joints(tree.root, robot=True)
    except ValueError as problem:
        return (f"{urdf.name}: physics of its joints was not read: {problem}.",)
    told: dict[str, list[str]] = {}
    for mount in tree.mounts.values():
        if mount.movable:
            of_world = f"that it moves {mount.child} relative to the link 'world' (it is held at 0)"
            told.setdefault(of_world, []).append(f"{mount.name} (line {mount.line})")
    for name in (*driven, *followers):
        terms, parts = read[name].terms, []
        values = (("damping", terms.damping), ("dry friction", terms.frictionloss), ("rotor inertia", terms.armature))
        parts += [f"its {what} of {value:.4g}" for what, value in values if value]
        parts += ["the gains of its servo"] if read[name].driven else []
        parts += read[name].unused
        law = tree.joints[name].mimic
        parts += [f"that it follows {law.of!r} (mimic)"] if law is not None and name in driven else []
        if parts:
            told.setdefault(", ".join(parts), []).append(f"{name} (line {tree.joints[name].line})")
    return tuple(
        f"{urdf.name}: not used of {', '.join(joints[:SHOWN])}"
        f"{f' and {len(joints) - SHOWN} more joints' if len(joints) > SHOWN else ''}: {what}."
        for what, joints in told.items()
    )


def _robot(source: Path, read: RobotDocument, *, found_links: bool) -> Robot:
    urdf = resolve(read.urdf, source.parent)
    splits = link_splits(read.force_torque or {}, read_urdf(urdf))
    tree = read_urdf(urdf, splits)
    base = check_link("base", read.base, tree)
    joints = tuple(read.joints)
    _check_joints("joints", joints, tree)
    if not read.fixed_base:
        _check_floating_base(base, joints, tree)
    actuators = None if read.actuators is None else resolve(read.actuators, source.parent)
    limits = {joint: entry.given() for joint, entry in (read.limits or {}).items()}
    own_pose = _base_pose(base, tree) if read.fixed_base else Pose()
    return Robot(
        name=read.name,
        urdf=urdf,
        base=base,
        fixed_base=read.fixed_base,
        base_pose=own_pose if read.base_pose is None else read.base_pose.pose,
        joints=joints,
        locked=_locked(read.locked or {}, joints, tree),
        followers=_followers(read.locked or {}, joints, tree),
        imu=imu_mounts(read.imu or {}, tree),
        force_torque=force_torque_mounts(read.force_torque or {}, joints, base, tree, splits),
        actuators=actuators,
        changes=LinkChanges() if actuators is None or not found_links else link_changes(actuators),
        rotor_inertia=read.rotor_inertia or {},
        limits=limits,
        posture=_posture(read.posture or {}, joints, tree, limits),
        source=source,
        splits=splits,
        unused=_unused(urdf, tree, joints, tuple(_followers(read.locked or {}, joints, tree))),
    )


def load_robot(path: Path | str, *, found_links: bool = True) -> Robot:
    """Read a robot file and check it against its URDF.

    Args:
        path: YAML; `drake-tc schema robot --page` has the keys.
        found_links: Take masses, centres of mass and payloads that `close-loop` found from the actuator model file
            that the robot file names; otherwise the links are those of the URDF.

    Raises:
        ParamsError: the file or its URDF cannot be read, a key is unknown, missing or given twice, a joint or link is
            not in the URDF, or a value is not possible; the message names file and field.

    Example:
        >>> load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml").joints[3]
        'r_knee'
    """
    source = Path(path)
    read = validated(RobotDocument, read_yaml(source, "robot file (YAML)"), str(source))
    try:
        return _robot(source, read, found_links=found_links)
    except ParamsError as error:
        raise ParamsError(f"{source}: {error}") from None
