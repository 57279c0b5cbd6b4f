"""Sensors of a robot: encoders and torque sensors of its joints, IMUs and force-torque sensors of its links.

`JointTorque`, on the links' side of the gears, is the ground truth with a perfect spec; the truth of `Imu` comes from
Drake's own sensors; `ForceTorque` are six-axis sensors inside fixed joints.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Joint
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import MatrixGain, Multiplexer
from pydrake.systems.sensors import Accelerometer, Gyroscope

from drake_tc.errors import ParamsError
from drake_tc.robot.plant import has_axis, is_revolute, joint_axes
from drake_tc.robot.robot import Mount, Robot
from drake_tc.sensing.corruption import Corruption
from drake_tc.sensing.sensor import Sensor, SensorBase
from drake_tc.sensing.spec import Sampling, SensorSpec, joined
from drake_tc.types import FloatArray


class Encoder(Sensor):
    """Positions of n joints, link side: `truth` (n) [rad or m] to `reading` (n). See `Sensor`."""

    is_drawn = True


def add_encoder(
    builder: DiagramBuilder, plant: MultibodyPlant, robot: Robot, spec: SensorSpec, sampling: Sampling
) -> Encoder:
    """Add an Encoder of the robot's joints to the builder and wire it to a plant that is already in it.

    Between them stands `joint_positions`, which picks the positions from the plant's state in the robot's order.

    Args:
        builder: Holds `plant`.
        plant: Finalized plant with the robot.
        robot: Names the joints.
        spec: [rad or m].
        sampling: When it samples and fails.

    Returns:
        The system.

    Raises:
        ParamsError: As `Sensor`.
    """
    model = plant.GetModelInstanceByName(robot.name)
    joints = [plant.GetJointByName(name, model).index() for name in robot.joints]
    pick = plant.MakeStateSelectorMatrix(joints)[: len(joints)]
    gain: Any = np.ascontiguousarray(pick)
    positions = builder.AddNamedSystem("joint_positions", MatrixGain(gain))
    encoder = Encoder(len(joints), spec, *sampling)
    builder.AddNamedSystem("encoder", encoder)
    builder.Connect(plant.get_state_output_port(), positions.get_input_port())
    builder.Connect(positions.get_output_port(), encoder.GetInputPort("truth"))
    return encoder


def _axes(plant: MultibodyPlant, joints: Sequence[Joint]) -> FloatArray:
    """(n, 6) s of τ = s · [τ_J; f_J], in Jc."""
    for joint in joints:
        if not has_axis(joint):
            raise ParamsError(
                f"joint {joint.name()!r}: expected a revolute or prismatic joint, got {joint.type_name()}"
            )
    turns = np.array([is_revolute(joint) for joint in joints])[:, None]
    axes = joint_axes(plant, joints)
    return np.concatenate([turns * axes, ~turns * axes], axis=1)


class JointTorque(SensorBase):
    """Torques of n joints, about their axes (forces along them, of prismatic joints).

        τ = s · F_CJc_Jc,   s the joint's axis

    What gear and joint transmit to the child link: the actuator's torque less its rotor's inertia and less the joint's
    damping. A generalized force applied to the joint from outside counts too.

    Input:
        reaction_forces: of the MultibodyPlant.
    Output:
        reading (n): [N m], of prismatic joints [N].

    See `SensorBase` for the recursion.
    """

    def __init__(self, plant: MultibodyPlant, robot: Robot, spec: SensorSpec, sampling: Sampling) -> None:
        """Declare ports, state and the periodic update.

        Args:
            plant: Finalized plant with the robot.
            robot: Names the joints.
            spec: [N m]; `SensorSpec()` reads the truth.
            sampling: When it samples and fails.

        Raises:
            ParamsError: A joint that is neither revolute nor prismatic; otherwise as `Corruption`.
        """
        super().__init__()
        model = plant.GetModelInstanceByName(robot.name)
        joints = [plant.GetJointByName(name, model) for name in robot.joints]
        self._joints = [int(joint.index()) for joint in joints]
        self._axes = _axes(plant, joints)
        reactions = self.DeclareAbstractInputPort("reaction_forces", Value[list[SpatialForce]]())
        self._declare(reactions, Corruption(len(joints), spec, *sampling))

    def _truth_of(self, forces: Any) -> FloatArray:
        wrenches = np.array([forces[i].get_coeffs() for i in self._joints])
        return np.asarray((self._axes * wrenches).sum(axis=1))


class Imu(Sensor):
    """k inertial units: `truth` (6k) to `reading` (6k). See `Sensor`.

    Six channels a unit, in the unit's frame S: [gyro_x gyro_y gyro_z accel_x accel_y accel_z], ω_WS_S [rad/s] and the
    proper acceleration R_SW (a_WS - g) [m/s²]: 9.81 upwards at rest.
    """

    is_drawn = True


def imu_spec(gyro: SensorSpec, accel: SensorSpec, mounts: int = 1) -> SensorSpec:
    """The spec of `Imu` from those of a gyroscope and an accelerometer, of three channels each.

    Raises:
        ParamsError: Different latencies, or values for another number of channels than 3.
    """
    return joined([(gyro, 3), (accel, 3)] * mounts)


def _add_mount(builder: DiagramBuilder, plant: Any, robot: Robot, mount: Mount) -> list[OutputPort]:
    body = plant.GetBodyByName(mount.link, plant.GetModelInstanceByName(robot.name))
    pose = mount.pose.transform
    gravity = plant.gravity_field().gravity_vector()
    gyroscope, accelerometer = Gyroscope(body, pose), Accelerometer(body, pose, gravity)
    builder.AddNamedSystem(f"gyroscope_{mount.name}", gyroscope)
    builder.AddNamedSystem(f"accelerometer_{mount.name}", accelerometer)
    for sensor in (gyroscope, accelerometer):
        builder.Connect(plant.get_body_poses_output_port(), sensor.get_body_poses_input_port())
        builder.Connect(plant.get_body_spatial_velocities_output_port(), sensor.get_body_velocities_input_port())
    accelerations = plant.get_body_spatial_accelerations_output_port()
    builder.Connect(accelerations, accelerometer.get_body_accelerations_input_port())
    return [gyroscope.get_measurement_output_port(), accelerometer.get_measurement_output_port()]


def add_imu(builder: DiagramBuilder, plant: MultibodyPlant, robot: Robot, spec: SensorSpec, sampling: Sampling) -> Imu:
    """Add the robot's IMUs to the builder, all in one Imu, and wire them to a plant that is already in it.

    With live ports (`plant.SetUseSampledOutputPorts(False)`) the accelerometer feels the torques of the same tick; with
    sampled ones gyroscope and accelerometer lag one step.

    Args:
        builder: Holds `plant`.
        plant: Finalized plant with the robot; its gravity is taken as it is now.
        robot: With at least one IMU.
        spec: Of all 6k channels, see `imu_spec`.
        sampling: When it samples and fails; channels 6 i ... 6 i + 5 are the unit i.

    Returns:
        The system, with the port `reading`.

    Raises:
        ParamsError: A robot without IMU; otherwise as `Sensor`.
    """
    if not robot.imu:
        raise ParamsError(f"{robot.source}: imu: expected at least one; the robot file has none")
    ports = [port for mount in robot.imu for port in _add_mount(builder, plant, robot, mount)]
    truth = builder.AddNamedSystem("imu_truth", Multiplexer([3] * len(ports)))
    for index, port in enumerate(ports):
        builder.Connect(port, truth.get_input_port(index))
    imu = Imu(6 * len(robot.imu), spec, *sampling)
    builder.AddNamedSystem("imu", imu)
    builder.Connect(truth.get_output_port(), imu.GetInputPort("truth"))
    return imu


def wrench_map(X_JS: RigidTransform) -> FloatArray:
    """(6, 6) A of W_S = A [τ_J; f_J]: from Drake's reaction on the child at Jc to what the sensor reads.

        W_S = -[R_SJ f_J; R_SJ (τ_J - p_JS × f_J)]

    The reaction F_CJc_Jc acts on the child; what the distal part exerts on the proximal one is its opposite.

    Args:
        X_JS: Pose of the sensor frame S in the joint's child frame Jc.
    """
    R_SJ = np.asarray(X_JS.rotation().matrix().T, dtype=np.float64)
    x, y, z = X_JS.translation()
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.block([[np.zeros((3, 3)), -1.0 * R_SJ], [-1.0 * R_SJ, R_SJ @ cross]])


class ForceTorque(SensorBase):
    """k force/torque sensors.

    Input:
        reaction_forces: of the MultibodyPlant.
    Output:
        reading (6k): [fx fy fz tx ty tz] a sensor, [N] and [N m], at the sensor frame S, in S: the wrench that the
            distal part, and whatever touches it, exerts on the proximal part. A standing robot reads +fz upwards.

    See `SensorBase` for the recursion, `wrench_map` for the truth.
    """

    def __init__(self, plant: MultibodyPlant, robot: Robot, spec: SensorSpec, sampling: Sampling) -> None:
        """Declare ports, state and the periodic update.

        Args:
            plant: Finalized plant with the robot.
            robot: With at least one force/torque sensor.
            spec: Of all 6k channels: 1 or 6k values a field (`force_torque_spec`).
            sampling: When it samples and fails; channels 6 i ... 6 i + 5 are the sensor i.

        Raises:
            ParamsError: A robot without such a sensor; otherwise as `Corruption`.
        """
        super().__init__()
        if not robot.force_torque:
            raise ParamsError(f"{robot.source}: force_torque: expected at least one; the robot file has none")
        model = plant.GetModelInstanceByName(robot.name)
        self._joints: list[int] = []
        count = len(robot.force_torque)
        self._map = np.zeros((6 * count, 6 * count))
        for k, mount in enumerate(robot.force_torque):
            joint = plant.GetJointByName(mount.joint, model)
            X_CJ = joint.frame_on_child().GetFixedPoseInBodyFrame()
            self._joints.append(int(joint.index()))
            part = slice(6 * k, 6 * k + 6)
            self._map[part, part] = wrench_map(X_CJ.inverse() @ mount.pose.transform)
        reactions = self.DeclareAbstractInputPort("reaction_forces", Value[list[SpatialForce]]())
        self._declare(reactions, Corruption(6 * count, spec, *sampling))

    def _truth_of(self, forces: Any) -> FloatArray:
        reactions = np.empty((len(self._joints), 6))
        for row, joint in enumerate(self._joints):
            reactions[row] = forces[joint].get_coeffs()
        return np.asarray(self._map.dot(reactions.ravel()))


def force_torque_spec(force: SensorSpec, torque: SensorSpec, sensors: int = 1) -> SensorSpec:
    """The spec of `ForceTorque` from those of its forces and torques, of three channels each.

    Raises:
        ParamsError: Different latencies, or values for another number of channels than 3.
    """
    return joined([(force, 3), (torque, 3)] * sensors)
