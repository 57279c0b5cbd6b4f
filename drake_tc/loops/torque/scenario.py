"""A torque-control experiment as data: robot, controller, motion, surroundings, sensors and what goes wrong.

One YAML file holds many scenarios by name. `extends: NAME` takes another scenario of the file and changes what is
given, field by field. Everything is SI; joints are named as in the robot's YAML.

How a torque loop is controlled, whatever its robot and whatever it is asked to do.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal

from drake_tc.config.records import Checked, FromZero, Positive
from drake_tc.control.guard import GuardSpec
from drake_tc.control.torque_law import CompensationSpec
from drake_tc.errors import ParamsError
from drake_tc.estimation.disturbance_observer import ObserverSpec, PredictorSpec
from drake_tc.estimation.torque_model import BaseSource
from drake_tc.loops.scenarios import (
    FilterSpec,
    ForceSpec,
    GainSpec,
    ModelFactors,
    MotionSpec,
    ObjectSpec,
    PushSpec,
    ScenarioBase,
    Seed,
    SuspensionSpec,
    check_masses,
)
from drake_tc.robot.robot import Robot
from drake_tc.sensing.spec import SensorFault
from drake_tc.sensing.suite import SensorSuiteSpec, load_suite
from drake_tc.sensor_validation.monitor_spec import MonitorSpec

SENSORS = ("encoder", "imu", "force_torque")


@dataclass(frozen=True, kw_only=True)
class TorqueLoopSpec(Checked):
    """How a torque loop is controlled.

    Attributes:
        controller: "torque": the whole chain; "servo": the reference is the command of the vendor's position servos.
        dt: Period of control and sensors [s].
        seed: Seed of all random numbers.
        torque_from: Torque that is fed back: the "estimate" from F/T sensors, IMU and encoders, or the reading of a
            joint-torque "sensor".
        base_from: Source of the motion of the base: the "imu", or "fixed" for a base at rest. Default: "imu" for a
            robot that has one.
        angular_acceleration: Angular acceleration of the IMU's link: differentiated from the "gyro", "neglected", or
            "zero" for a welded base.
        tare: Time during which the F/T sensors are zeroed [s]; nothing may touch the robot until then. 0: they are not
            zeroed.
        sensors: "perfect", "realistic" or a mapping (`drake_tc.sensing.suite`).
        configuration: State at which the inverse dynamics computes M, h and J: the delayed "estimate" or the
            "reference".
        compensation: Motion for which the effects of the drives are compensated.
        filters: Filters of the sensors.
        guard: Limits of the command, and what happens after a fault.
        monitor: Thresholds of the fault monitor.
        predictor: Compensates the delay of the estimates with the models of the drives; None: off.
        observer: Estimates and compensates what these models lack; None: off.
        rotor_inertia: Reflected rotor inertia by joint that predictor and observer use [kg m^2]. Default: that of the
            controller's model.
        faults: Faults of the sensors "encoder", "imu" or "force_torque", by sensor.
        log_components: Also record the six components of the command.
        untouched: Whether nothing may touch the robot; a contact wrench then counts as a fault.

    Raises:
        ParamsError: a choice or a sensor that there is not, or a period that is not positive.

    Example:
        >>> TorqueLoopSpec(dt=2e-3, sensors="perfect").filters.window
        80
    """

    controller: Literal["torque", "servo"] = "torque"
    dt: Positive = 1e-3
    seed: Seed = 0
    torque_from: Literal["estimate", "sensor"] = "estimate"
    base_from: Literal["imu", "fixed"] | None = None
    angular_acceleration: Literal["gyro", "neglected", "zero"] = "zero"
    tare: FromZero = 0.3
    configuration: Literal["estimate", "reference"] = "reference"
    compensation: CompensationSpec = field(default_factory=CompensationSpec)
    sensors: Any = "realistic"
    filters: FilterSpec = field(default_factory=FilterSpec)
    guard: GuardSpec = field(default_factory=GuardSpec)
    monitor: MonitorSpec = field(default_factory=MonitorSpec)
    predictor: PredictorSpec | None = None
    observer: ObserverSpec | None = None
    rotor_inertia: Mapping[str, float] = field(default_factory=dict)
    faults: Mapping[str, tuple[SensorFault, ...]] = field(default_factory=dict)
    log_components: bool = False
    untouched: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in self.faults:
            if name not in SENSORS:
                raise ParamsError(f"faults: no sensor {name!r}; possible: {', '.join(SENSORS)}")


def loop_spec(scenario: "Scenario") -> "Scenario":
    """How a scenario's loop is controlled: without objects and pushes, nothing may touch the robot."""
    return scenario if scenario.objects or scenario.pushes else replace(scenario, untouched=True)


def base_source(spec: TorqueLoopSpec, robot: Robot) -> BaseSource:
    """Where estimator and controller take the motion of the robot's base from.

    Raises:
        ParamsError: a base that floats and is taken to have no angular acceleration.
    """
    source: BaseSource = spec.base_from or ("imu" if robot.imu else "fixed")
    if not robot.fixed_base and source == "imu" and spec.angular_acceleration == "zero":
        raise ParamsError(
            "angular_acceleration: expected gyro or neglected, as the base of"
            f" {robot.source} floats, got 'zero' (which base_from: fixed allows)"
        )
    return source


def sensor_suite(spec: TorqueLoopSpec) -> SensorSuiteSpec:
    """What the loop's sensors do; joint torques that are fed back are at least one tick old.

    Raises:
        ParamsError: an unknown preset or field.
    """
    suite = load_suite("sensors", spec.sensors)
    if spec.torque_from == "sensor" and suite.joint_torque.latency == 0.0:
        suite = replace(suite, joint_torque=replace(suite.joint_torque, latency=spec.dt))
    return suite


@dataclass(frozen=True)
class Scenario(ScenarioBase, TorqueLoopSpec):
    """One experiment: how the loop is controlled, and what it runs.

    Attributes:
        robot: Robot file, relative to the scenario file.
        duration: Length of the simulation [s].
        plant_step: Step of plant and actuators [s]; it divides dt.
        actuators: Model file of the simulated actuators; None: the one that the robot file names.
        model: Model file that the controller compensates with; None: the simulated actuators, so that the controller
            knows its plant exactly.
        model_factors: Deliberate errors of the controller's model.
        gains: Feedback gains.
        motion: Reference positions of the joints.
        suspension: Springs that carry a floating base; None: the base is as in the robot file.
        force: Force reference at the contact of an F/T sensor, by sensor.
        pushes, objects: Wrenches on links over time, and boxes that are fixed to the world.
        masses: Factor on the mass and the inertia of a link in the simulated plant, by link. The controller's model
            keeps the value of the robot file.
        joint_stops: "none" removes the stops from plant and model, for example to simulate an unstable joint.
        log_truth: Record the true joint torques.
        source: Folder that file names are relative to.
    """

    SCHEMA: ClassVar[str] = "scenario"

    robot: str
    duration: Positive = 2.0
    plant_step: Positive = 1e-3
    actuators: str | None = None
    model: str | None = None
    model_factors: ModelFactors = field(default_factory=ModelFactors)
    gains: GainSpec = field(default_factory=GainSpec)
    motion: MotionSpec = field(default_factory=MotionSpec)
    suspension: SuspensionSpec | None = None
    force: Mapping[str, ForceSpec] = field(default_factory=dict)
    pushes: tuple[PushSpec, ...] = ()
    objects: tuple[ObjectSpec, ...] = ()
    masses: Mapping[str, float] = field(default_factory=dict)
    joint_stops: Literal["modelled", "none"] = "modelled"
    log_truth: bool = False
    source: str = "."

    def __post_init__(self) -> None:
        super().__post_init__()
        check_masses(self.masses)
        ratio = self.dt / self.plant_step
        if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-6:
            raise ParamsError(f"plant_step: expected dt = {self.dt:g} s over a whole number, got {self.plant_step:g}")
