"""Where contacts and IMU are and how they move, in the axes of the base; and what an F/T reading says at a contact.

The tables of it; what computes with them is `drake_tc.kernels.base.sample`.

With B the base, C a contact and I the IMU, from encoders alone:

    R = R_BC,  p = p_BC,  omega = angular velocity, v = velocity of C's origin, relative to B, in B's axes

The reading of a sensor S is the load that the limb puts on the part beyond it, which stands still as far as its weight
shows: the external wrench E = [f; t] at C in C's axes is

    E = T reading - m [R^T g; c x R^T g]

with T the constant transform from S to C, m and c the mass and centre of mass (at C, in C) of the part beyond.

`Sample` and the state: what goes into a tick, what is remembered between ticks, and what comes out; all arrays are of a
fixed size.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from pydrake.math import RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, QuaternionFloatingJoint

from drake_tc.errors import ParamsError
from drake_tc.estimation.base_rig import ContactSpec
from drake_tc.kernels.base.state import (
    CONTACT_FLAGS,
    CONTACT_MEMORY,
    FLAGS,
    GROUND,
    SCALARS,
    YAW,
    Memory,
    memory_of,
    size_of,
)
from drake_tc.robot.fields import ForceTorqueMount, Mount
from drake_tc.robot.plant import in_order, make_plant, tree_of
from drake_tc.robot.robot import Robot
from drake_tc.robot.urdf import reduced_urdf
from drake_tc.robot.urdf_tree import read_urdf
from drake_tc.types import GRAVITY, FloatArray


class BaseKinematics:
    """The robot's contacts and its IMU against the base; holds no state.

    Attributes:
        tree: (places, constants, frames, frame_bodies) of `drake_tc.kernels.dynamics`; a frame a contact, then the
            IMU's; joints in the robot's order.
        between: (k, 54) what stands between each contact's sensor and the contact: T (6, 6) and (6, 3) K with
            K g = [m g; c x m g].
        weight: Of the robot [N].
        order: (nq + nv,) where each of the whole robot's [q; v] is in [base pose (7); q (n); base velocity (6); qd (n);
            0].
    """

    def __init__(self, robot: Robot, contacts: tuple[ContactSpec, ...]) -> None:
        """Build the plants and precompute what is constant.

        Args:
            robot: With a floating base and at least one IMU; the first one is used.
            contacts: Where it may touch.

        Raises:
            ParamsError: a fixed base, no IMU, or a contact whose link or sensor is not there.
        """
        if robot.fixed_base:
            raise ParamsError(f"base estimator: expected a floating base; {robot.name} has a fixed one")
        if not robot.imu:
            raise ParamsError(f"base estimator: expected an IMU; {robot.name} has none in its robot file")
        self.robot, self.contacts = robot, contacts
        plant = MultibodyPlant(0.0)
        Parser(plant).AddModelsFromString(reduced_urdf(robot, followers="free"), "urdf")
        body = plant.GetBodyByName(robot.base)
        plant.AddJoint(QuaternionFloatingJoint(robot.base, plant.world_frame(), body.body_frame()))
        mounts = [*(contact.mount for contact in contacts), robot.imu[0]]
        frames = [_frame(plant, f"base_estimator_{i}", mount) for i, mount in enumerate(mounts)]
        plant.Finalize()
        named = {str(i): frame for i, frame in enumerate(frames)}
        tree = tree_of(plant, body, in_order(robot), named)
        self.tree = tree.places, tree.constants, tree.frames, tree.frame_bodies
        loads = [_load(plant, robot, contact, frame) for contact, frame in zip(contacts, frames, strict=False)]
        self.between = np.array([[*load.transform.ravel(), *_weighs(load).ravel()] for load in loads])
        self.weight = GRAVITY * float(plant.CalcTotalMass(plant.CreateDefaultContext()))
        whole = make_plant(robot, 0.0, followers="weld")
        whole_joints = [whole.GetJointByName(name) for name in robot.joints]
        self.state_size = whole.num_multibody_states()
        self.num_positions = whole.num_positions()
        base = whole.GetBodyByName(robot.base)
        self.base_position = int(base.floating_positions_start())
        self.base_velocity = int(whole.num_positions() + base.floating_velocities_start_in_v())
        self.joint_position = np.array([joint.position_start() for joint in whole_joints], dtype=np.intp)
        self.joint_velocity = self.num_positions + np.array(
            [joint.velocity_start() for joint in whole_joints], dtype=np.intp
        )
        at, turning = np.arange(7) + self.base_position, np.arange(6) + self.base_velocity
        places = np.concatenate((at, self.joint_position, turning, self.joint_velocity))
        self.order = np.full(self.state_size, places.size)
        self.order[places] = np.arange(places.size)


@dataclass(frozen=True, eq=False)
class _Load:
    transform: FloatArray
    mass: float
    centre: FloatArray


def _weighs(load: _Load) -> FloatArray:
    """(6, 3) K with K g = [m g; c x m g]."""
    x, y, z = load.centre
    arm = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return load.mass * np.concatenate([np.eye(3), arm])


def _frame(plant: MultibodyPlant, name: str, mount: Mount) -> Any:
    if not plant.HasBodyNamed(mount.link):
        raise ParamsError(f"{mount.name}: expected a link of the URDF; there is no link {mount.link!r}")
    return plant.AddFrame(FixedOffsetFrame(name, plant.GetFrameByName(mount.link), mount.pose.transform))


def _load(plant: MultibodyPlant, robot: Robot, contact: ContactSpec, frame: Any) -> _Load:
    """Transform, mass and centre of what hangs beyond a contact's sensor."""
    if contact.sensor is None:
        return _Load(np.eye(6), 0.0, np.zeros(3))
    sensors = {mount.name: mount for mount in robot.force_torque}
    if contact.sensor not in sensors:
        there = ", ".join(sensors) or "none"
        raise ParamsError(f"contact {contact.mount.name!r}: no F/T sensor {contact.sensor!r}; sensors: {there}")
    sensor = sensors[contact.sensor]
    child = plant.GetBodyByName(read_urdf(robot.urdf, robot.splits).joints[sensor.joint].child)
    rigid = {body.index() for body in plant.GetBodiesWeldedTo(frame.body())}
    if child.index() not in rigid or _moves_beyond(plant, robot, sensor):
        if contact.polygon is not None:
            raise ParamsError(
                f"contact {contact.mount.name!r}: the sole requires its sensor {sensor.name!r} rigidly above it;"
                " a joint lies between"
            )
        return _Load(np.eye(6), 0.0, np.zeros(3))  # of a point only the force's length is looked at
    context = plant.CreateDefaultContext()
    X_WS = child.body_frame().CalcPoseInWorld(context).multiply(sensor.pose.transform)
    X_CS = frame.CalcPoseInWorld(context).inverse().multiply(X_WS)
    R, p = X_CS.rotation().matrix(), X_CS.translation()
    transform = np.zeros((6, 6))
    transform[:3, :3] = transform[3:, 3:] = R
    transform[3:, :3] = np.column_stack([np.cross(p, R[:, i]) for i in range(3)])
    names = read_urdf(robot.urdf, robot.splits).beyond(child.name())
    bodies = [plant.get_body(i) for i in sorted(rigid, key=int) if plant.get_body(i).name() in names]
    mass, moment = 0.0, np.zeros(3)
    for body in bodies:
        m = float(body.get_mass(context))
        mass += m
        moment += (
            m * np.array(plant.CalcPointsPositions(context, body.body_frame(), _centre(body, context), frame))[:, 0]
        )
    return _Load(transform, mass, moment / mass if mass > 0.0 else np.zeros(3))


def _centre(body: Any, context: Any) -> Any:
    return np.array(body.CalcCenterOfMassInBodyFrame(context))


def _moves_beyond(plant: MultibodyPlant, robot: Robot, sensor: ForceTorqueMount) -> bool:
    """Whether a joint that moves lies beyond the sensor."""
    tree = read_urdf(robot.urdf, robot.splits)
    beyond = tree.beyond(tree.joints[sensor.joint].child)
    return any(tree.joints[name].parent in beyond for name in (*robot.joints, *robot.followers))


__all__ = [
    "CONTACT_FLAGS",
    "CONTACT_MEMORY",
    "FLAGS",
    "SCALARS",
    "BaseState",
    "Sample",
    "initial_state",
    "packed",
    "place_of",
    "unpacked",
]


class Sample(NamedTuple):
    """One sample of all sensors as a tick takes it; n joints, k contacts. NaN marks what is missing.

    Attributes:
        q: (n,) encoders [rad].
        qd: (n,) their speeds [rad/s].
        imu: (6,) [gyro; accel] in the IMU's axes [rad/s, m/s^2 (specific force)].
        tilt: (2,) roll and pitch of the IMU's frame [rad]; NaN where the IMU gives none.
        wrench: (6k,) [f; t] of each contact's sensor, its axes [N, N m].
        switch: (k,) 0 by the load's thresholds, 1 held on, -1 held off.
    """

    q: FloatArray
    qd: FloatArray
    imu: FloatArray
    tilt: FloatArray
    wrench: FloatArray
    switch: FloatArray


class BaseState(Memory):
    """Between two ticks; its attributes are those of `Memory`."""

    __slots__ = ()

    def flag(self, name: str) -> bool:
        """Whether a flag of `FLAGS` is up."""
        return bool(self.flags[FLAGS.index(name)])


def place_of(name: str, n: int, k: int) -> slice:
    """Where an array stands in a packed state, for n joints and k contacts."""
    places = np.ravel(getattr(memory_of(np.arange(float(size_of(n, k))), n, k), name))
    return slice(int(places[0]), int(places[-1]) + 1)


def packed(state: BaseState) -> FloatArray:
    """All of a state in one vector."""
    return np.concatenate([part.ravel() for part in state], dtype=float)


def unpacked(vector: FloatArray, n: int, k: int) -> BaseState:
    """The state in a vector, for n joints and k contacts, as views."""
    return BaseState(*memory_of(vector, n, k))


def initial_state(q: FloatArray, k: int, position: FloatArray, yaw: float) -> BaseState:
    """Before the first tick.

    Args:
        q: (n,) what the joints are taken to be until then [rad].
        k: Contacts.
        position: (3,) where the base starts [m].
        yaw: Its yaw there [rad].
    """
    state = unpacked(np.zeros(size_of(len(q), k)), len(q), k)
    state.scalars[YAW], state.scalars[GROUND] = yaw, np.nan
    state.position[:], state.rotation[:] = position, RotationMatrix.MakeZRotation(yaw).matrix()
    state.foot[:], state.q[:] = np.eye(3), q
    return state
