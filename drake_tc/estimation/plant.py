"""The plant in which torques are estimated: a free base without gravity, and a free joint at every F/T sensor.

What an inertial sensor reads is the acceleration against free fall, so a plant without gravity whose base has the
proper acceleration of the sensor moves, body by body, as the robot feels. Neither the pose nor the linear velocity of
the base enters: its pose is the identity (so base axes are world axes here) and its linear velocity is zero.

The fixed joint that carries a force/torque sensor becomes a joint with six degrees of freedom at rest: inverse
dynamics then gives, as that joint's force, the wrench that the part beyond needs to move as it does (Del Prete et al.,
2016, Algorithm 1).

How the base moves, from an IMU anywhere on the robot (Del Prete et al., 2016, Algorithm 1).

With I the IMU's frame, B the base (whose axes are the world's in `EstimationPlant`), J and b = Jdot v the Jacobian and
bias acceleration of I over all velocities:

    omega   = R_BI gyro - J_omega,j qdot                       angular velocity of the base
    alpha   = R_BI gyro_dot - J_omega,j qddot - b_omega        its angular acceleration
    a       = R_BI accel - J_v,j qddot - b_v - alpha x p_BI    proper acceleration (a - g) of B's origin

b holds the centripetal and Coriolis terms of the joints between base and IMU and of the base's rotation. With no
joint between them the transform is constant: a = R_BI accel - alpha x p - omega x (omega x p).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Frame,
    JacobianWrtVariable,
    QuaternionFloatingJoint,
    RpyFloatingJoint,
)

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
        moves: (nv, n) velocities for a unit velocity of each joint, those of joints that follow it among them.
        follows: (nq + nv, 2 n + 1) what joints that follow others have in `state`, of [q; v; 1]; None: there are none.
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
    moves: FloatArray
    follows: FloatArray | None

    def state_of(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """(nq + nv,) `state` with joints at q, v (n,) and those that follow them."""
        state = self.state.copy()
        state[self.position_index] = q
        state[self.plant.num_positions() + self.velocity_index] = v
        return state if self.follows is None else state + self.follows @ np.concatenate((q, v, (1.0,)))

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
        _cut(plant, context, mount, found) for mount, found in zip(robot.force_torque, frames, strict=bool(frames))
    )
    n, positions = len(joints), plant.num_positions()
    moves = np.zeros((plant.num_velocities(), n))
    moves[[joint.velocity_start() for joint in joints], np.arange(n)] = 1.0
    follows = np.zeros((plant.num_multibody_states(), 2 * n + 1)) if robot.followers else None
    for name, law in robot.followers.items():
        joint, leader = plant.GetJointByName(name), robot.joints.index(law.of)
        moves[joint.velocity_start(), leader] = law.multiplier
        if follows is not None:
            follows[joint.position_start(), [leader, -1]] = law.multiplier, law.offset
            follows[positions + joint.velocity_start(), n + leader] = law.multiplier
    return EstimationPlant(
        plant=plant,
        state=np.array(plant.GetPositionsAndVelocities(context)),
        position_index=np.array([joint.position_start() for joint in joints], dtype=np.int64),
        velocity_index=np.array([joint.velocity_start() for joint in joints], dtype=np.int64),
        base=plant.GetFrameByName(robot.base),
        cuts=made,
        inward=tuple(sorted(range(len(made)), key=lambda i: -_depth(plant, robot, made, i))),
        moves=moves,
        follows=follows,
    )


def _cut(plant: MultibodyPlant, context: Any, mount: ForceTorqueMount, frames: tuple[Any, Any, Any]) -> SensorCut:
    """Where one sensor sits, and the constant transform of its readings; frames of child, sensor and contact."""
    child, sensor, contact = frames
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


class BaseMotion:
    """Angular velocity, angular and proper acceleration of the base, in base axes, from one IMU."""

    def __init__(self, model: EstimationPlant, imu: Frame) -> None:
        """Precompute what is constant."""
        plant: Any = model.plant
        self._plant, self._imu, self._world = plant, imu, plant.world_frame()
        self._joints, self._moves = model.velocity_index, model.moves
        self._first_velocity = plant.num_positions()
        self._origin: Any = np.zeros(3)
        context = plant.CreateDefaultContext()
        plant.SetPositionsAndVelocities(context, model.state)
        self.rigid = model.welded_to_base(imu)
        X_BI = imu.CalcPoseInWorld(context)
        self.rotation = np.array(X_BI.rotation().matrix())
        arm = np.array(X_BI.translation())
        self._place: tuple[float, ...] = tuple(arm.tolist())
        self._lever = skew(arm)
        self._turn = np.kron(np.eye(2), self.rotation)

    def solve(
        self, context: Any, state: FloatArray, vdot: FloatArray, imu: FloatArray, gyro_dot: FloatArray | None
    ) -> FloatArray:
        """Write the base's rates into `state` and into the plant's context.

        Args:
            context: Of the plant; leaves with positions and velocities of `state`.
            state: (nq + nv,) of the plant with the joints' part in place, base velocity zero; its base part is filled.
            vdot: (n,) joint accelerations [rad/s^2].
            imu: (6,) [gyro; accel] in I [rad/s, m/s^2].
            gyro_dot: (3,) derivative of the gyro [rad/s^2]; None: the base's angular acceleration is known to be zero.

        Returns:
            (6,) [alpha; a] of B's origin, base axes [rad/s^2, m/s^2].
        """
        first = self._first_velocity
        if self.rigid:
            x, y, z, *accel = self._turn.dot(
                imu
            ).tolist()  # omega and the IMU's acceleration; as floats: 3 numbers each
            state[first : first + 3] = x, y, z
            self._plant.SetPositionsAndVelocities(context, state)
            px, py, pz = self._place
            square, along = x * x + y * y + z * z, x * px + y * py + z * pz
            a = (  # with - omega x (omega x p)
                accel[0] + square * px - along * x,
                accel[1] + square * py - along * y,
                accel[2] + square * pz - along * z,
            )
            if gyro_dot is None:
                return np.array((0.0, 0.0, 0.0, *a))
            alpha = self.rotation.dot(gyro_dot)
            return np.concatenate((alpha, a + self._lever.dot(alpha)))
        plant, world, origin = self._plant, self._world, self._origin
        plant.SetPositionsAndVelocities(context, state)
        jacobian = plant.CalcJacobianSpatialVelocity(context, JacobianWrtVariable.kV, self._imu, origin, world, world)
        rotation = self._imu.CalcRotationMatrixInWorld(context).matrix()
        own = jacobian @ self._moves
        state[first : first + 3] = rotation @ imu[:3] - own[:3] @ state[first + self._joints]
        plant.SetVelocities(context, state[first:])
        bias = plant.CalcBiasSpatialAcceleration(
            context, JacobianWrtVariable.kV, self._imu, origin, world, world
        ).get_coeffs()
        rest = own @ vdot + bias
        alpha = origin if gyro_dot is None else rotation @ gyro_dot - rest[:3]
        a = rotation @ imu[3:] - rest[3:] - jacobian[3:, :3] @ alpha
        return np.concatenate((alpha, a))

    def coupling(self, context: Any, *, rotates: bool = True) -> FloatArray | None:
        """Derivative of [alpha; a] by qddot (6, n), None where it is zero, at the last `solve`.

        The IMU's acceleration holds that of the joints between it and the base.

        Args:
            context: As `solve` left it.
            rotates: False where the base's angular acceleration is known to be zero.
        """
        if self.rigid:
            return None
        world = self._world
        jacobian = self._plant.CalcJacobianSpatialVelocity(
            context, JacobianWrtVariable.kV, self._imu, self._origin, world, world
        )
        own = -jacobian @ self._moves
        if rotates:
            own[3:] -= jacobian[3:, :3] @ own[:3]
        else:
            own[:3] = 0.0
        return np.asarray(own)
