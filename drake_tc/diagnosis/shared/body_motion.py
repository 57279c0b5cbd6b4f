"""How every link of a robot moves over a stretch of log, as arrays: what the causes' columns are made of."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from drake_tc.estimation.off_line import Row
from drake_tc.estimation.plant import CUT_SUFFIX
from drake_tc.estimation.torque_model import MeasuredMotion, TorqueModel
from drake_tc.robot.plant import joint_axes
from drake_tc.types import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class Link:
    """A body between the base and the F/T sensors, whose own inertia loads joints.

    Attributes:
        name: As in the URDF.
        mass: [kg].
        com: (3,) in the link's frame [m].
        inertia: (3, 3) about the link's origin [kg m^2].
        loads: (n,) the joints between it and the base.
    """

    name: str
    mass: float
    com: FloatArray
    inertia: FloatArray
    loads: BoolArray


@dataclass(frozen=True, eq=False)
class Structure:
    """Which link loads which joint.

    Attributes:
        links: Those with mass that load at least one joint.
        above_sensor: (k, n) by F/T sensor the joints between it and the base.
    """

    links: tuple[Link, ...]
    above_sensor: BoolArray


@dataclass(frozen=True, eq=False)
class BodyMotion:
    """T instants, in base axes; L links, n joints, k sensors.

    Attributes:
        rotation: (T, L, 3, 3) R_BL.
        position: (T, L, 3) of the links' origins [m].
        omega, alpha: (T, L, 3) [rad/s, rad/s^2].
        proper: (T, L, 3) acceleration of the origins against free fall [m/s^2].
        axis: (T, n, 3) unit vectors of the joints. pivot: (T, n, 3) a point of each [m].
        sensor_rotation: (T, k, 3, 3) R_BS. sensor: (T, k, 3) origins of the F/T sensors [m].
        imu_rotation: (T, 3, 3) R_BI.
    """

    rotation: FloatArray
    position: FloatArray
    omega: FloatArray
    alpha: FloatArray
    proper: FloatArray
    axis: FloatArray
    pivot: FloatArray
    sensor_rotation: FloatArray
    sensor: FloatArray
    imu_rotation: FloatArray


def structure_of(model: TorqueModel) -> Structure:
    """Links and sensors of the model's robot."""
    plant: Any = model.model.plant
    robot, context = model.robot, plant.CreateDefaultContext()
    beyond = [_beyond(plant, name) for name in robot.joints]
    cut = {b for mount in robot.force_torque for b in _beyond(plant, mount.joint + CUT_SUFFIX)}
    links = []
    for index in plant.GetBodyIndices(plant.GetBodyByName(robot.base).model_instance()):
        loads = np.array([index in bodies for bodies in beyond])
        body = plant.get_body(index)
        mass = float(body.get_mass(context))
        if index in cut or not loads.any() or mass <= 0.0:
            continue
        spatial = body.CalcSpatialInertiaInBodyFrame(context)
        inertia = spatial.CalcRotationalInertia().CopyToFullMatrix3()
        links.append(Link(body.name(), mass, np.array(spatial.get_com()), np.array(inertia), loads))
    carriers = [plant.GetJointByName(mount.joint + CUT_SUFFIX).child_body().index() for mount in robot.force_torque]
    above = np.array([[carrier in bodies for bodies in beyond] for carrier in carriers], dtype=np.bool_)
    return Structure(tuple(links), above.reshape(len(carriers), len(robot.joints)))


def _beyond(plant: Any, joint: str) -> set[Any]:
    return set(plant.GetBodiesKinematicallyAffectedBy([plant.GetJointByName(joint).index()]))


def body_motion(model: TorqueModel, structure: Structure, rows: Iterable[Row]) -> BodyMotion:
    """The motion at `rows` (each a `Row`)."""
    plant: Any = model.model.plant
    robot, context = model.robot, model.create_context()
    bodies = [plant.GetBodyByName(link.name) for link in structure.links]
    joints = [plant.GetJointByName(name) for name in robot.joints]
    frames = [joint.frame_on_child() for joint in joints]
    own = joint_axes(plant, joints)
    sensors = [plant.GetBodyByName(_carrier(plant, mount.joint)) for mount in robot.force_torque]
    mounts = [mount.pose.transform for mount in robot.force_torque]
    imu = plant.GetFrameByName(f"{robot.imu[0].name}_imu") if robot.imu else None
    indices = [int(body.index()) for body in bodies]
    out: list[list[FloatArray]] = [[] for _ in range(10)]
    for row in rows:
        acceleration = model.acceleration(context, MeasuredMotion(*row[:5]))
        everywhere = plant.CalcSpatialAccelerationsFromVdot(context, acceleration)
        poses = [plant.EvalBodyPoseInWorld(context, body) for body in bodies]
        accelerations = np.array([everywhere[i].get_coeffs() for i in indices])
        velocities = np.array([plant.EvalBodySpatialVelocityInWorld(context, body).get_coeffs() for body in bodies])
        turned = [frame.CalcPoseInWorld(context) for frame in frames]
        at = [plant.EvalBodyPoseInWorld(context, b).multiply(m) for b, m in zip(sensors, mounts, strict=True)]
        values = (
            _rotations(poses),
            _origins(poses),
            velocities[:, :3],
            accelerations[:, :3],
            accelerations[:, 3:],
            np.einsum("jab,jb->ja", _rotations(turned), own),
            _origins(turned),
            _rotations(at),
            _origins(at),
            np.eye(3) if imu is None else np.array(imu.CalcRotationMatrixInWorld(context).matrix()),
        )
        for column, value in zip(out, values, strict=True):
            column.append(value)
    return BodyMotion(*(np.array(column) for column in out))


def _carrier(plant: Any, joint: str) -> str:
    return str(plant.GetJointByName(joint + CUT_SUFFIX).child_body().name())


def _rotations(poses: Sequence[Any]) -> FloatArray:
    return np.array([pose.rotation().matrix() for pose in poses]).reshape(len(poses), 3, 3)


def _origins(poses: Sequence[Any]) -> FloatArray:
    return np.array([pose.translation() for pose in poses]).reshape(len(poses), 3)


def joint_is_prismatic(model: TorqueModel) -> BoolArray:
    """(n,) the robot's joints that slide."""
    plant: Any = model.model.plant
    return np.array([plant.GetJointByName(name).type_name() == "prismatic" for name in model.robot.joints])
