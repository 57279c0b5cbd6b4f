"""Machines to estimate on: random trees written as URDF, and the truth about an instant of their motion.

The truth comes from Drake's forward dynamics (accelerations, reaction forces and frame accelerations of a plant that
knows gravity, the base's pose and every force); the estimator knows none of these.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame

from drake_tc.robot.plant import add_robot
from drake_tc.robot.robot import ForceTorqueMount, Mount, Pose, Robot


def text(values) -> str:
    return " ".join(repr(float(x)) for x in values)


def random_pose(rng) -> Pose:
    return Pose(tuple(rng.uniform(-0.3, 0.3, 3).tolist()), tuple(rng.uniform(-1.5, 1.5, 3).tolist()))


def link_xml(name: str, rng) -> str:
    mass = rng.uniform(0.5, 5.0)
    sides = rng.uniform(0.05, 0.3, 3) ** 2
    inertia = mass / 12.0 * (sides.sum() - sides)
    named = " ".join(f'{key}="{value!r}"' for key, value in zip(("ixx", "iyy", "izz"), inertia.tolist(), strict=True))
    origin = f'<origin xyz="{text(rng.uniform(-0.1, 0.1, 3))}" rpy="{text(rng.uniform(-1, 1, 3))}"/>'
    return (
        f'<link name="{name}"><inertial>{origin}<mass value="{mass!r}"/>'
        f'<inertia {named} ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def joint_xml(name: str, kind: str, parent: str, child: str, pose: Pose, axis) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{text(pose.xyz)}" rpy="{text(pose.rpy)}"/><axis xyz="{text(axis)}"/></joint>'
    )


def random_robot(folder, rng, *, fixed_base: bool, links: int = 9, sensors: int = 2) -> Robot:
    """A random tree of revolute and prismatic joints, some of them fixed joints with F/T sensors, IMU anywhere."""
    xml = [link_xml("l0", rng)]
    parent_of = {i: int(rng.integers(max(0, i - 3), i)) for i in range(1, links)}
    cut = sorted(rng.choice(np.arange(1, links), size=sensors, replace=False).tolist())
    joints, mounts = [], []
    part = {0: 0}  # the sensor beyond which a link is
    for i in range(1, links):
        axis = rng.normal(size=3)
        kind = "fixed" if i in cut else ("prismatic" if rng.random() < 0.2 else "revolute")
        xml += [
            link_xml(f"l{i}", rng),
            joint_xml(f"j{i}", kind, f"l{parent_of[i]}", f"l{i}", random_pose(rng), axis / np.linalg.norm(axis)),
        ]
        part[i] = i if i in cut else part[parent_of[i]]
        if kind != "fixed":
            joints.append(f"j{i}")
    for i in cut:
        touched = int(rng.choice([j for j in part if part[j] == i]))
        mounts.append(
            ForceTorqueMount(f"ft{i}", f"j{i}", random_pose(rng), Mount("sole", f"l{touched}", random_pose(rng)))
        )
    rng.shuffle(joints)
    file = folder / "tree.urdf"
    file.write_text(f'<robot name="tree">{"".join(xml)}</robot>')
    imu = Mount("imu", f"l{0 if rng.random() < 0.3 else int(rng.integers(0, links))}", random_pose(rng))
    return Robot(
        name="tree",
        urdf=file,
        base="l0",
        fixed_base=fixed_base,
        joints=tuple(joints),
        posture=np.zeros(len(joints)),
        source=folder / "tree.yaml",
        base_pose=random_pose(rng),
        imu=(imu,),
        force_torque=tuple(mounts),
    )


@dataclass(frozen=True)
class Push:
    """An external wrench at the origin of a mount's frame, axes of the base: [f; t]."""

    mount: Mount
    wrench: np.ndarray


class Instant(NamedTuple):
    q: np.ndarray
    v: np.ndarray
    vdot: np.ndarray
    imu: np.ndarray
    gyro_dot: np.ndarray
    readings: np.ndarray
    torque: np.ndarray
    base_reaction: np.ndarray  # [f; t] that a weld exerts on the base, base axes; 0 where it floats


class Truth:
    """A plant of the whole robot with gravity, at random instants."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.plant = MultibodyPlant(0.0)
        add_robot(self.plant, robot)
        imu = robot.imu[0]
        self.imu = self.plant.AddFrame(FixedOffsetFrame("imu", self.plant.GetFrameByName(imu.link), imu.pose.transform))
        self.plant.Finalize()

    def instant(self, rng, pushes=()) -> Instant:
        plant, robot = self.plant, self.robot
        context = plant.CreateDefaultContext()
        base = plant.GetBodyByName(robot.base)
        joints = [plant.GetJointByName(name) for name in robot.joints]
        q, v = plant.GetPositions(context), plant.GetVelocities(context)
        for joint in joints:
            q[joint.position_start()] = rng.uniform(-1.5, 1.5)
            v[joint.velocity_start()] = rng.uniform(-2.0, 2.0)
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)
        if not robot.fixed_base:
            plant.SetFreeBodyPose(context, base, random_pose(rng).transform)
            velocity = plant.GetVelocities(context)
            free = plant.GetJointByName(robot.base)
            velocity[free.velocity_start() : free.velocity_start() + 6] = rng.uniform(-2.0, 2.0, 6)
            plant.SetVelocities(context, velocity)
        plant.get_actuation_input_port().FixValue(context, rng.uniform(-30.0, 30.0, plant.num_actuators()))
        R_WB = base.EvalPoseInWorld(context).rotation().matrix()
        forces = []
        for push in pushes:
            force = ExternallyAppliedSpatialForce()
            force.body_index = plant.GetBodyByName(push.mount.link).index()
            force.p_BoBq_B = push.mount.pose.transform.translation()
            force.F_Bq_W = SpatialForce(R_WB @ push.wrench[3:], R_WB @ push.wrench[:3])
            forces.append(force)
        port = plant.get_applied_spatial_force_input_port()
        port.FixValue(context, Value[list[ExternallyAppliedSpatialForce]](forces))
        vdot = plant.get_generalized_acceleration_output_port().Eval(context)
        reactions = plant.get_reaction_forces_output_port().Eval(context)
        start = [joint.velocity_start() for joint in joints]
        R_WI = self.imu.CalcPoseInWorld(context).rotation().matrix()
        moving = self.imu.CalcSpatialVelocityInWorld(context)
        speeding = self.imu.CalcSpatialAccelerationInWorld(context)
        proper = speeding.translational() - plant.gravity_field().gravity_vector()
        return Instant(
            q=q[[joint.position_start() for joint in joints]],
            v=plant.GetVelocities(context)[start],
            vdot=vdot[start],
            imu=np.concatenate([R_WI.T @ moving.rotational(), R_WI.T @ proper]),
            gyro_dot=R_WI.T @ speeding.rotational(),
            readings=np.concatenate([np.zeros(0), *(self.reading(mount, reactions) for mount in robot.force_torque)]),
            torque=np.array([self.along(joint, q, reactions[int(joint.index())]) for joint in joints]),
            base_reaction=self.weld(reactions),
        )

    def weld(self, reactions) -> np.ndarray:
        if not self.robot.fixed_base:
            return np.zeros(6)
        base = self.plant.GetBodyByName(self.robot.base).index()
        (weld,) = (
            joint
            for joint in map(self.plant.get_joint, self.plant.GetJointIndices())
            if joint.child_body().index() == base and joint.parent_body().index() == self.plant.world_body().index()
        )
        force = reactions[int(weld.index())]
        return np.concatenate([force.translational(), force.rotational()])

    def along(self, joint, q: np.ndarray, force: SpatialForce) -> float:
        """Power of a joint's reaction at unit speed: the force along its axis, whatever kind of joint it is."""
        context = self.plant.CreateDefaultContext()
        v = np.zeros(self.plant.num_velocities())
        v[joint.velocity_start()] = 1.0
        self.plant.SetPositionsAndVelocities(context, np.concatenate([q, v]))
        child, parent = joint.frame_on_child(), joint.frame_on_parent()
        unit = child.CalcSpatialVelocity(context, parent, child)
        return float(unit.rotational() @ force.rotational() + unit.translational() @ force.translational())

    def reading(self, mount: ForceTorqueMount, reactions) -> np.ndarray:
        joint = self.plant.GetJointByName(mount.joint)
        onto_child = reactions[int(joint.index())]
        X_LJ = joint.frame_on_child().GetFixedPoseInBodyFrame()
        X_LS: RigidTransform = mount.pose.transform
        lever = X_LJ.translation() - X_LS.translation()  # from S to Jc, in L
        force = X_LJ.rotation().matrix() @ -onto_child.translational()
        moment = X_LJ.rotation().matrix() @ -onto_child.rotational() + np.cross(lever, force)
        to_sensor = X_LS.rotation().matrix().T
        return np.concatenate([to_sensor @ force, to_sensor @ moment])
