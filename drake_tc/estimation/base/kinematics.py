"""Where contacts and IMU are and how they move, in the axes of the base; and what an F/T reading says at a contact.

With B the base, C a contact and I the IMU, from encoders alone:

    R = R_BC,  p = p_BC,  omega = angular velocity, v = velocity of C's origin, relative to B, in B's axes

The reading of a sensor S is the load that the limb puts on the part beyond it, which stands still as far as its weight
shows: the external wrench E = [f; t] at C in C's axes is

    E = T reading - m [R^T g; c x R^T g]

with T the constant transform from S to C, m and c the mass and centre of mass (at C, in C) of the part beyond.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, QuaternionFloatingJoint

from drake_tc.errors import ParamsError
from drake_tc.estimation.base.spec import ContactSpec
from drake_tc.robot.mounts import ForceTorqueMount, Mount
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import Robot
from drake_tc.robot.urdf import reduced_urdf
from drake_tc.robot.urdf_tree import read_urdf
from drake_tc.types import FloatArray

_EPSILON = np.zeros((3, 3, 3))
_EPSILON[[0, 1, 2], [2, 0, 1], [1, 2, 0]], _EPSILON[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0, -1.0
_SKEW: FloatArray = _EPSILON.reshape(3, 9)


def skews(a: FloatArray) -> FloatArray:
    """(..., 3, 3) matrices S(a), S(a) b = a x b, of vectors (..., 3)."""
    S: FloatArray = (a @ _SKEW).reshape(*a.shape, 3)
    return S


class Posture(NamedTuple):
    """Of k contacts and, behind them, the IMU; in the axes of the base.

    Attributes:
        rotation: (k + 1, 3, 3) R_BC.
        position: (k + 1, 3) p_BC [m].
        rate: (k + 1, 3) omega_BC against the base [rad/s], or omega_b + omega_BC after `turning`.
        velocity: (k + 1, 3) v_BC [m/s], or v_BC + omega_b x p_BC.
    """

    rotation: FloatArray
    position: FloatArray
    rate: FloatArray
    velocity: FloatArray

    def turning(self, rate: FloatArray) -> "Posture":
        """The same on a base that turns with omega_b (3,) [rad/s], in axes that do not."""
        swept = self.position @ skews(rate).T
        return Posture(self.rotation, self.position, self.rate + rate, self.velocity + swept)


class BaseKinematics:
    """The robot's contacts and its IMU against the base; holds no state.

    Attributes:
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
        Parser(plant).AddModelsFromString(reduced_urdf(robot), "urdf")
        body = plant.GetBodyByName(robot.base)
        plant.AddJoint(QuaternionFloatingJoint(robot.base, plant.world_frame(), body.body_frame()))
        mounts = [*(contact.mount for contact in contacts), robot.imu[0]]
        frames = [_frame(plant, f"base_estimator_{i}", mount) for i, mount in enumerate(mounts)]
        plant.Finalize()
        self._plant, self._frames = plant, frames
        joints = [plant.GetJointByName(name) for name in robot.joints]
        nq = plant.num_positions()
        self._positions = np.array([joint.position_start() for joint in joints], dtype=np.intp)
        self._velocities = nq + np.array([joint.velocity_start() for joint in joints], dtype=np.intp)
        self._rest: FloatArray = np.array(plant.GetPositionsAndVelocities(plant.CreateDefaultContext()))
        loads = [_load(plant, robot, contact, frame) for contact, frame in zip(contacts, frames, strict=False)]
        self.transform = np.stack([load.transform for load in loads])
        self.mass = np.array([load.mass for load in loads])
        self.centre = np.stack([load.centre for load in loads])
        self._weighs = np.stack([_weighs(load) for load in loads])
        self._plain = not self.mass.any() and bool((self.transform == np.eye(6)).all())
        self.weight = 9.81 * float(plant.CalcTotalMass(plant.CreateDefaultContext()))
        whole = make_plant(robot, 0.0)
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

    def create_scratch(self) -> Any:
        """Memory to compute in; one for each context that uses this object."""
        return self._plant.CreateDefaultContext()

    def posture(self, scratch: Any, q: FloatArray, qd: FloatArray) -> Posture:
        """Contacts and IMU against the base.

        Args:
            scratch: From `create_scratch`.
            q: (n,) encoders [rad], in the robot's order.
            qd: (n,) their speeds [rad/s].
        """
        state: Any = self._rest.copy()
        state[self._positions] = q
        state[self._velocities] = qd
        self._plant.SetPositionsAndVelocities(scratch, state)
        poses = np.array([frame.CalcPoseInWorld(scratch).GetAsMatrix34() for frame in self._frames])
        speeds = np.array([frame.CalcSpatialVelocityInWorld(scratch).get_coeffs() for frame in self._frames])
        return Posture(poses[:, :, :3], poses[:, :, 3], speeds[:, :3], speeds[:, 3:])

    def external_wrench(self, readings: FloatArray, down: FloatArray) -> FloatArray:
        """(k, 6) E = [f; t] at the contacts, in their axes [N, N m].

        Args:
            readings: (k, 6) [f; t] in the sensors' axes.
            down: (k, 3) gravity R^T g in the contacts' axes [m/s^2].
        """
        if self._plain:
            return readings
        seen: FloatArray = self.transform @ readings[:, :, None] - self._weighs @ down[:, :, None]
        return seen[:, :, 0]


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
    """Whether a driven joint lies beyond the sensor."""
    tree = read_urdf(robot.urdf, robot.splits)
    beyond = tree.beyond(tree.joints[sensor.joint].child)
    return any(tree.joints[name].parent in beyond for name in robot.joints)
