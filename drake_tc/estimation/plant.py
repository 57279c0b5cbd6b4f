"""The plant in which torques are estimated: a free base without gravity, and a free joint at every F/T sensor.

What an inertial sensor reads is the acceleration against free fall, so a plant without gravity whose base has the
proper acceleration of the sensor moves, body by body, as the robot feels. Neither the pose nor the linear velocity of
the base enters: its pose is the identity (so base axes are world axes here) and its linear velocity is zero.

The fixed joint that carries a force/torque sensor becomes a joint with six degrees of freedom at rest: inverse
dynamics then gives, as that joint's force, the wrench that the part beyond needs to move as it does (Del Prete et al.,
2016, Algorithm 1).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, QuaternionFloatingJoint, RpyFloatingJoint

from drake_tc.errors import ParamsError
from drake_tc.robot.robot import ForceTorqueMount, Mount, Robot
from drake_tc.robot.urdf import reduced_urdf
from drake_tc.types import FloatArray, IntArray

CUT_SUFFIX = "_cut"
CONTACT_SUFFIX = "_contact"
IMU_SUFFIX = "_imu"
SENSOR_SUFFIX = "_sensor"


@dataclass(frozen=True)
class SensorCut:
    """A force/torque sensor in the plant.

    Attributes:
        name: Of the sensor.
        rows: (6,) velocities of its joint: [rotation; translation], axes of its child frame M.
        child: M, the frame on the child link where the joint was.
        sensor: S, in which the sensor reads.
        contact: C, where the external wrench on the part beyond acts.
        rigid: C sits on a body welded to M's.
        shift: (6, 6) from a wrench [t; f] at M to the same at D, both in M; D is C where rigid, else M.
        reading_to_contact: (6, 6) from a reading [f; t] at the sensor frame S, in S, to [t; f] at D, in M.
    """

    name: str
    rows: slice
    child: Any
    sensor: Any
    contact: Any
    rigid: bool
    shift: FloatArray
    reading_to_contact: FloatArray


@dataclass(frozen=True)
class EstimationPlant:
    """The plant and where its quantities sit.

    Attributes:
        plant: Finalized; velocities [base rotation (3), base translation (3), joints and sensor joints].
        state: (nq + nv,) at rest, base at the identity.
        position_index, velocity_index: (n,) of the actuated joints, in `state` and in the velocities.
        base: B, frame of the base link; it rests in the world's origin, and its velocities come first.
        cuts: Sensors in the robot's order.
        inward: Indices of `cuts`, those farther out first.
    """

    plant: Any
    state: FloatArray
    position_index: IntArray
    velocity_index: IntArray
    base: Any
    cuts: tuple[SensorCut, ...]
    inward: tuple[int, ...]

    def welded_to_base(self, frame: Any) -> bool:
        """Whether no joint lies between the base and `frame`."""
        welded = self.plant.GetBodiesWeldedTo(self.base.body())
        return any(frame.body().index() == body.index() for body in welded)


def skew(p: FloatArray) -> FloatArray:
    """(..., 3, 3) P with P x = p × x, of vectors (..., 3)."""
    out = np.zeros((*p.shape, 3))
    out[..., 0, 1], out[..., 0, 2] = -p[..., 2], p[..., 1]
    out[..., 1, 0], out[..., 1, 2] = p[..., 2], -p[..., 0]
    out[..., 2, 0], out[..., 2, 1] = -p[..., 1], p[..., 0]
    return out


def build_plant(robot: Robot, *, cuts: bool = True) -> EstimationPlant:
    """Parse the robot's reduced URDF, free its base and (on request) its F/T sensors.

    Args:
        robot: The robot.
        cuts: Put free joints where the F/T sensors are; False leaves the robot in one piece.

    Raises:
        ParamsError: A joint or link that is not in the URDF, or a sensor's joint that moves.
    """
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(reduced_urdf(robot, followers="free"), "urdf")
    body = plant.GetBodyByName(robot.base)
    plant.AddJoint(QuaternionFloatingJoint(robot.base, plant.world_frame(), body.body_frame()))
    still: Any = np.zeros(3)
    plant.mutable_gravity_field().set_gravity_vector(still)
    frames = []
    for mount in robot.force_torque:
        where = f"{robot.name}: force_torque {mount.name}"
        if not plant.HasJointNamed(mount.joint):
            raise ParamsError(f"{where}: expected a fixed joint of the URDF; there is no joint {mount.joint!r}")
        weld = plant.GetJointByName(mount.joint)
        if weld.num_velocities() != 0:
            raise ParamsError(f"{where}: expected a fixed joint; {mount.joint!r} moves")
        ends = weld.frame_on_parent().index(), weld.frame_on_child().index()
        if cuts:
            plant.RemoveJoint(weld)
        del weld  # a frame taken from it would keep it in Python, and pass for any later joint at its address
        parent, child = map(plant.get_frame, ends)
        if cuts:
            plant.AddJoint(RpyFloatingJoint(mount.joint + CUT_SUFFIX, parent, child))
        offset = _at_body_of(child, f"{mount.name}{SENSOR_SUFFIX}", mount)
        contact = _add_mount(plant, where, f"{mount.name}{CONTACT_SUFFIX}", mount.contact)
        frames.append((child, plant.AddFrame(offset), contact))
    for imu in robot.imu:
        _add_mount(plant, f"{robot.name}: imu {imu.name}", f"{imu.name}{IMU_SUFFIX}", imu)
    plant.Finalize()
    return _index(robot, plant, frames if cuts else [])


def _at_body_of(frame: Any, name: str, mount: ForceTorqueMount) -> Any:
    """The frame of a sensor on the body that has this frame."""
    return FixedOffsetFrame(name, frame.body().body_frame(), mount.pose.transform)


def _add_mount(plant: MultibodyPlant, where: str, name: str, mount: Mount) -> Any:
    """The frame of a mount on its link."""
    if not plant.HasBodyNamed(mount.link):
        raise ParamsError(f"{where}: expected a link of the URDF; there is no link {mount.link!r}")
    return plant.AddFrame(FixedOffsetFrame(name, plant.GetFrameByName(mount.link), mount.pose.transform))


def _index(robot: Robot, plant: MultibodyPlant, frames: list[tuple[Any, Any, Any]]) -> EstimationPlant:
    """Find base, joints and sensors in the finalized plant."""
    context = plant.CreateDefaultContext()
    joints = [plant.GetJointByName(name) for name in robot.joints]
    made = tuple(
        _cut(plant, context, mount, *found) for mount, found in zip(robot.force_torque, frames, strict=bool(frames))
    )
    return EstimationPlant(
        plant=plant,
        state=np.array(plant.GetPositionsAndVelocities(context)),
        position_index=np.array([joint.position_start() for joint in joints], dtype=np.int64),
        velocity_index=np.array([joint.velocity_start() for joint in joints], dtype=np.int64),
        base=plant.GetFrameByName(robot.base),
        cuts=made,
        inward=tuple(sorted(range(len(made)), key=lambda i: -_depth(plant, robot, made, i))),
    )


def _cut(
    plant: MultibodyPlant, context: Any, mount: ForceTorqueMount, child: Any, sensor: Any, contact: Any
) -> SensorCut:
    """Where one sensor sits, and the constant transform of its readings."""
    X_MS = sensor.CalcPose(context, child)
    rotation = X_MS.rotation().matrix()
    reading = np.zeros((6, 6))
    reading[3:, :3] = rotation
    reading[:3, 3:] = rotation
    reading[:3, :3] = skew(X_MS.translation()) @ rotation
    first = plant.GetJointByName(mount.joint + CUT_SUFFIX).velocity_start()
    rigid = any(body.index() == contact.body().index() for body in plant.GetBodiesWeldedTo(child.body()))
    shift = np.eye(6)
    if rigid:
        shift[:3, 3:] = -skew(contact.CalcPose(context, child).translation())
    return SensorCut(
        name=mount.name,
        rows=slice(first, first + 6),
        child=child,
        sensor=sensor,
        contact=contact,
        rigid=rigid,
        shift=shift,
        reading_to_contact=shift @ reading,
    )


def _depth(plant: MultibodyPlant, robot: Robot, cuts: tuple[SensorCut, ...], index: int) -> int:
    """How many sensors lie between the base and this one (itself counted)."""
    own = cuts[index].child.body().index()
    depth = 0
    for mount in robot.force_torque:
        joint = plant.GetJointByName(mount.joint + CUT_SUFFIX)
        depth += own in plant.GetBodiesKinematicallyAffectedBy([joint.index()])
    return depth
