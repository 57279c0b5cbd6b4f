"""All sensors of a robot at once: their specs with presets, and their wiring."""

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, Any, Literal

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort
from pydrake.systems.primitives import LinearSystem

from drake_tc.config.keys import Keys, key, one_of
from drake_tc.config.records import record_keys, validated
from drake_tc.errors import ParamsError
from drake_tc.robot.robot import Robot
from drake_tc.sensing.corruption import DRAW
from drake_tc.sensing.robot_sensors import (
    Encoder,
    ForceTorque,
    Imu,
    JointTorque,
    add_encoder,
    add_imu,
    force_torque_spec,
    imu_spec,
)
from drake_tc.sensing.spec import Sampling, SensorFault, SensorSpec
from drake_tc.types import FloatArray

SENSORS = ("encoder", "imu", "force_torque", "joint_torque")
"""Names under which a scenario gives faults."""


@dataclass(frozen=True)
class SensorSuiteSpec:
    """Specs of a robot's sensors. As it stands, all are perfect.

    Attributes:
        encoder: [rad].
        gyro: [rad/s]; 1 or 3 values a field.
        accel: [m/s²]; 1 or 3 values a field.
        force: Of the F/T sensors [N]; 1 or 3 values a field.
        torque: Of the F/T sensors [N m]; 1 or 3 values a field.
        joint_torque: [N m]; by default the ground truth, for logs alone.

    Example:
        >>> SensorSuiteSpec.realistic().encoder.resolution
        1e-05
    """

    encoder: SensorSpec = field(default_factory=SensorSpec)
    gyro: SensorSpec = field(default_factory=SensorSpec)
    accel: SensorSpec = field(default_factory=SensorSpec)
    force: SensorSpec = field(default_factory=SensorSpec)
    torque: SensorSpec = field(default_factory=SensorSpec)
    joint_torque: SensorSpec = field(default_factory=SensorSpec)

    @classmethod
    def perfect(cls) -> "SensorSuiteSpec":
        """Every reading is the truth of the same tick."""
        return cls()

    @classmethod
    def realistic(cls) -> "SensorSuiteSpec":
        """The orders of magnitude of a humanoid's sensors, at 1 kHz; chosen, no device's data sheet.

        encoder: 1e-5 rad, a motor's encoder of some 10³ lines, four counts a line, over a gear of 100 (2π/4e5 is
            1.6e-5); white noise of the same size, so that a live encoder never stands exactly still.
        gyro: 5e-3 rad/s a sample, bias 2e-3. Data sheets of MEMS units state 0.005 to 0.02 deg/s/√Hz, which over
            500 Hz is 2e-3 to 8e-3 rad/s; the bias is what is left after it was zeroed at rest.
        accel: 0.05 m/s² a sample, bias 0.02. Data sheets: 100 to 300 µg/√Hz, 0.02 to 0.07 m/s² over 500 Hz.
        force, torque: 0.5 N and 0.02 N m a sample, bias 1 N and 0.03 N m, scale 0.5 %: about 5e-4 and 2e-3 of ranges of
            1 kN and 40 N m to 60 N m, as data sheets of ankle sensors state for noise and for drift after zeroing.
        joint_torque: perfect; such a robot has none.
        """
        return cls(
            encoder=SensorSpec(noise=1e-5, resolution=1e-5),
            gyro=SensorSpec(noise=5e-3, bias=(2e-3, -1e-3, 1.5e-3), resolution=1e-4),
            accel=SensorSpec(noise=0.05, bias=(0.02, -0.015, 0.02), resolution=1e-3),
            force=SensorSpec(noise=0.5, bias=(0.6, -0.5, 1.0), scale=1.005, resolution=0.05),
            torque=SensorSpec(noise=0.02, bias=(0.03, -0.02, 0.01), scale=1.005, resolution=1e-3),
        )


PRESETS = {"perfect": SensorSuiteSpec.perfect, "realistic": SensorSuiteSpec.realistic}
_Spec: Any = record_keys(SensorSpec)


class SuiteKeys(Keys):
    """The sensors of a robot: a preset, and what differs from it."""

    preset: Annotated[Literal["perfect", "realistic"], one_of(tuple(PRESETS))] = key(
        "Where the values come from that are not given.", example="realistic", default="perfect", absent="perfect"
    )
    encoder: _Spec | None = key("Encoders.", unit="rad", example={"latency": 0.002}, absent="those of `preset`")
    gyro: _Spec | None = key("Gyros.", unit="rad/s", example={"noise": 0.005}, absent="those of `preset`")
    accel: _Spec | None = key("Accelerometers.", unit="m/s²", example={"noise": 0.05}, absent="those of `preset`")
    force: _Spec | None = key("Forces.", unit="N", example={"bias": [0.0, 0.0, 3.0]}, absent="those of `preset`")
    torque: _Spec | None = key(
        "Torques of F/T sensors.", unit="N·m", example={"noise": 0.02}, absent="those of `preset`"
    )
    joint_torque: _Spec | None = key(
        "Joint torques, for logs alone.", unit="N·m", example={"noise": 0.1}, absent="those of `preset`"
    )


def load_suite(where: str, entry: object) -> SensorSuiteSpec:
    """A suite, that of a preset, or one from a mapping: `preset` (perfect where absent), and what differs from it.

        sensors:
          preset: realistic
          encoder: {latency: 0.002}
          force: {bias: [0.0, 0.0, 3.0]}

    Args:
        where: File and field, for the error.
        entry: The suite, the preset's name, or the mapping; None is the perfect suite.

    Raises:
        ParamsError: An unknown key or preset, or an impossible value; one line that starts with `where`.
    """
    if isinstance(entry, SensorSuiteSpec):
        return entry
    mapping = {"preset": entry} if isinstance(entry, str) else entry
    read = validated(SuiteKeys, {} if mapping is None else mapping, within=where)
    suite = PRESETS[read.preset]()
    for each in fields(SensorSuiteSpec):
        changes = getattr(read, each.name)
        if changes is not None:
            try:
                suite = replace(suite, **{each.name: replace(getattr(suite, each.name), **changes.given())})
            except ParamsError as error:
                raise ParamsError(f"{where}.{each.name}.{error}") from None
    return suite


@dataclass(frozen=True, eq=False)
class Readings:
    """What a controller reads of a robot, whether simulated sensors or input ports of the diagram bring it.

    Attributes:
        encoder: (n) positions of the joints [rad].
        imu: (6) [gyro; accel] of each IMU; None where there is none.
        force_torque: (6) wrench of each F/T sensor; None where there is none.
        joint_torque: (n) of joint-torque sensors [N m]; None where there are none.
    """

    encoder: OutputPort
    imu: OutputPort | None = None
    force_torque: OutputPort | None = None
    joint_torque: OutputPort | None = None


@dataclass(frozen=True)
class SensorSuite:
    """The sensors in a diagram; each has the port `reading`. None where the robot has no such sensor."""

    encoder: Encoder
    imu: Imu | None
    force_torque: ForceTorque | None
    joint_torque: JointTorque

    @property
    def readings(self) -> Readings:
        """The ports `reading`."""

        def reading(system: Any) -> Any:
            return None if system is None else system.GetOutputPort("reading")

        return Readings(*map(reading, (self.encoder, self.imu, self.force_torque, self.joint_torque)))


class RandomDraw(LinearSystem):
    """A number that `SetRandomContext` draws from N(0, 1), and that is 0 in the default context; it stays what it is.

    Output: y0 (1), by which sensors are other samples of their kind.
    """

    graph_stage = "logging"  # pictures leave it out, as logs

    def __init__(self, dt: float) -> None:
        """Declare the state.

        Args:
            dt: Period [s].
        """
        one: Any = np.eye(1)
        nothing: Any = np.zeros((1, 0))
        super().__init__(one, nothing, one, nothing, dt)
        self.configure_random_state(one)

    def coordinates(self, context: Context) -> FloatArray:
        """(0,): what never changes is no state of the loop (`drake_tc.analysis`)."""
        return np.zeros(0)

    def set_coordinates(self, context: Context, x: FloatArray) -> None:
        """Nothing to set."""


def sensor_seed(seed: int, name: str) -> int:
    """A sensor's own seed from the scenario's: streams of different names are independent."""
    return int(np.random.SeedSequence([seed, zlib.crc32(name.encode())]).generate_state(1, np.uint64)[0] >> 1)


def add_sensors(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    robot: Robot,
    suite: SensorSuiteSpec,
    dt: float,
    seed: int = 0,
    faults: Mapping[str, tuple[SensorFault, ...]] | None = None,
) -> SensorSuite:
    """Add all of a robot's sensors to the builder and wire them to a plant that is already in it.

    The plant should have live ports (`SetUseSampledOutputPorts(False)` before `Finalize`): with sampled ones force,
    torque and acceleration lag the encoders by one step.

    Args:
        builder: Holds `plant`.
        plant: Finalized plant with the robot.
        robot: What it has and where.
        suite: What the sensors do.
        dt: Their period [s].
        seed: The scenario's; each sensor derives its own.
        faults: By the names in `SENSORS` ; None is none.

    Returns:
        The systems.

    Raises:
        ParamsError: A fault of an unknown sensor, or of one that the robot does not have; otherwise as `Sensor`.

    Example:
        >>> robot = load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")
        >>> builder = DiagramBuilder()
        >>> plant = add_robot_plant(builder, robot)
        >>> sensors = add_sensors(builder, plant, robot, SensorSuiteSpec.realistic(), 1e-3)
        >>> sensors.encoder.get_reading_output_port().size()
        6
    """
    failing = dict(faults or {})
    for name in failing:
        if name not in SENSORS:
            raise ParamsError(f"faults: no sensor {name!r}; possible: {', '.join(SENSORS)}")
        if failing[name] and ((name == "imu" and not robot.imu) or (name == "force_torque" and not robot.force_torque)):
            raise ParamsError(f"faults: {robot.source} has no sensor {name!r} that could fail")

    def sampling(name: str) -> Sampling:
        return Sampling(dt, failing.get(name, ()), sensor_seed(seed, name))

    encoder = add_encoder(builder, plant, robot, suite.encoder, sampling("encoder"))
    imu = None
    if robot.imu:
        units = imu_spec(suite.gyro, suite.accel, len(robot.imu))
        imu = add_imu(builder, plant, robot, units, sampling("imu"))
    reactions = plant.get_reaction_forces_output_port()
    force_torque = None
    if robot.force_torque:
        spec = force_torque_spec(suite.force, suite.torque, len(robot.force_torque))
        force_torque = ForceTorque(plant, robot, spec, sampling("force_torque"))
        builder.AddNamedSystem("force_torque", force_torque)
        builder.Connect(reactions, force_torque.GetInputPort("reaction_forces"))
    joint_torque = JointTorque(plant, robot, suite.joint_torque, sampling("joint_torque"))
    builder.AddNamedSystem("joint_torque", joint_torque)
    builder.Connect(reactions, joint_torque.GetInputPort("reaction_forces"))
    if not builder.HasSubsystemNamed("random_draw"):
        builder.AddNamedSystem("random_draw", RandomDraw(dt))
    draw = builder.GetSubsystemByName("random_draw").get_output_port(0)
    for sensor in (encoder, imu, force_torque, joint_torque):
        if sensor is not None:
            builder.Connect(draw, sensor.GetInputPort(DRAW))
    return SensorSuite(encoder, imu, force_torque, joint_torque)
