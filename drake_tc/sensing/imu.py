"""`Imu`: gyroscopes and accelerometers of a robot; the truth comes from Drake's own sensors."""

from collections.abc import Sequence
from typing import Any

from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import Multiplexer
from pydrake.systems.sensors import Accelerometer, Gyroscope

from drake_tc.errors import ParamsError
from drake_tc.robot.robot import Mount, Robot
from drake_tc.sensing.fault import SensorFault
from drake_tc.sensing.sensor import Sensor
from drake_tc.sensing.spec import SensorSpec, joined


class Imu(Sensor):
    """k inertial units: `truth` (6k) to `reading` (6k). See `Sensor`.

    Six channels a unit, in the unit's frame S: [gyro_x gyro_y gyro_z accel_x accel_y accel_z], ω_WS_S [rad/s] and the
    proper acceleration R_SW (a_WS - g) [m/s²]: 9.81 upwards at rest.
    """


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


def add_imu(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    robot: Robot,
    gyro: SensorSpec,
    accel: SensorSpec,
    dt: float,
    faults: Sequence[SensorFault] = (),
    seed: int = 0,
) -> Imu:
    """Add the robot's IMUs to the builder, all in one Imu, and wire them to a plant that is already in it.

    With live ports (`plant.SetUseSampledOutputPorts(False)`) the accelerometer feels the torques of the same tick; with
    sampled ones gyroscope and accelerometer lag one step.

    Args:
        builder: Holds `plant`.
        plant: Finalized plant with the robot; its gravity is taken as it is now.
        robot: With at least one IMU.
        gyro: Of each gyroscope, 1 or 3 values a field [rad/s].
        accel: Of each accelerometer, 1 or 3 values a field [m/s²].
        dt: Period [s].
        faults: When it fails; channels 6 i ... 6 i + 5 are the unit i.
        seed: Of its random numbers.

    Returns:
        The system, with the port `reading`.

    Raises:
        ParamsError: A robot without IMU; otherwise as `Sensor` and `imu_spec`.
    """
    if not robot.imu:
        raise ParamsError(f"{robot.source}: imu: expected at least one; the robot file has none")
    ports = [port for mount in robot.imu for port in _add_mount(builder, plant, robot, mount)]
    truth = builder.AddNamedSystem("imu_truth", Multiplexer([3] * len(ports)))
    for index, port in enumerate(ports):
        builder.Connect(port, truth.get_input_port(index))
    units = len(robot.imu)
    imu = Imu(6 * units, imu_spec(gyro, accel, units), dt, faults, seed)
    builder.AddNamedSystem("imu", imu)
    builder.Connect(truth.get_output_port(), imu.GetInputPort("truth"))
    return imu
