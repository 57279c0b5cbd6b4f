"""An experiment with robust TSID as data: controller, motion, contacts, plant, drives, torque errors.

Series-elastic drives and the base estimator under a whole-body controller, as data (Faraji et al., 2015).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal

from drake_tc.config.records import Checked, FromZero, Positive, Range
from drake_tc.control.series_elastic import SeriesElasticSpec
from drake_tc.control.torque_law import CompensationSpec
from drake_tc.errors import ParamsError
from drake_tc.estimation.base_estimator import METHODS
from drake_tc.loops.scenarios import PushSpec, ScenarioBase, Seed, check_masses
from drake_tc.loops.whole_body.ground import GroundSpec
from drake_tc.loops.whole_body.references import KnotSpec, SpanSpec
from drake_tc.sensing.spec import SensorFault, SensorSpec


@dataclass(frozen=True)
class SpringDrivesSpec(Checked):
    """Voltage-driven series-elastic joints, their sensors and their torque control.

    Attributes:
        actuators: Model file of the simulated drives; None: the one that the robot file names.
        model_factors: Factor on `gain` or on an effect in the controller's model of the motors; 1 where absent.
        control: The torque law. Its `delay` should be that of the loop.
        delay: Delay between the computation of a voltage and its effect at the motor [s].
        acceleration_bandwidth: Bandwidth of the low pass for the desired accelerations of the links, which the law
            feeds forward [rad/s]; 0: no feedforward, so that motors follow their links by feedback alone.
        joint_damping: Damping that is subtracted from the desired torques, times the estimated velocity [N m s/rad].
            The controller does not know of it.
        damped_joints: Joints with this damping; empty: all joints.
        position_gain: Gain of a voltage loop that holds the initial position with each motor's own encoder [N m/rad];
            `control` is then not used. 0: torque control.
        link_from: Source of the joint positions: the fine encoder before the spring minus the deflection that the gauge
            gives ("motor"), or the coarse encoder behind the spring ("link"), which is `sensors.encoder` of the
            scenario.
        motor_encoder: Encoder before the spring [rad].
        gauge: Torque sensor of the spring [N m].
    """

    actuators: str | None = None
    model_factors: Mapping[str, float] = field(default_factory=dict)
    control: SeriesElasticSpec = field(default_factory=SeriesElasticSpec)
    delay: FromZero = 0.015
    acceleration_bandwidth: FromZero = 0.0
    joint_damping: FromZero = 0.0
    damped_joints: tuple[str, ...] = ()
    position_gain: FromZero = 0.0
    link_from: Literal["motor", "link"] = "motor"
    motor_encoder: SensorSpec = field(default_factory=lambda: SensorSpec(resolution=1.534e-5))
    gauge: SensorSpec = field(default_factory=lambda: SensorSpec(noise=0.02))

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.damped_joints and not self.joint_damping:
            raise ParamsError("series_elastic.damped_joints: expected a joint_damping > 0 beside it, got none")
        for name in ("joint_damping", "acceleration_bandwidth"):
            if self.position_gain and getattr(self, name):
                raise ParamsError(f"series_elastic.{name}: expected 0 beside a position_gain, which tracks no torque")
        for name, factor in self.model_factors.items():
            if not 0.0 <= factor < math.inf:
                raise ParamsError(f"series_elastic.model_factors.{name}: expected a factor >= 0, got {factor!r}")

    def ticks(self, period: float) -> int:
        """The delay in the controller's periods.

        Raises:
            ParamsError: it is no whole number of them.
        """
        ticks = self.delay / period
        if abs(ticks - round(ticks)) > 1e-6:
            raise ParamsError(
                f"series_elastic.delay: expected a multiple of the period {period:g} s, got {self.delay:g} s"
            )
        return round(ticks)


_NOT_TUNING = {"contacts", "period", "imu_age"}
_SWITCHES = {"quick_start"}


@dataclass(frozen=True)
class BaseEstimationSpec(Checked):
    """The base estimator of the controller.

    Attributes:
        method: "cop", or a baseline: "foot_centre" without the IMU, "foot_centre_imu" with it.
        beside: Second method that receives the same readings and is only recorded, as "beside_state"; None: no second
            method.
        make, break_: Load of a contact above which it is made and below which it is lost, as a share of the robot's
            weight [-].
        velocity_window: Length of the filter for the joint velocities [samples], evaluated at its end.
        sole_stiffness: Stiffness of a whole sole that the estimator assumes [N/m]; None: rigid.
        sole_points: Number of springs that represent the sole, along x and y.
        tuning: Fields of `BaseEstimatorSpec`: `{velocity_time: 0.01}`.
    """

    method: str = "cop"
    beside: str | None = None
    make: float = 0.05
    break_: float = 0.02
    velocity_window: Annotated[int, Range("a number >= 4", 4)] = 15
    sole_stiffness: float | None = None
    sole_points: Annotated[tuple[int, ...], Range("two numbers", size=2)] = (5, 3)
    tuning: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, method in (("method", self.method), ("beside", self.beside or self.method)):
            if method not in METHODS:
                raise ParamsError(f"estimator.{name}: expected one of {', '.join(METHODS)}, got {method!r}")
        if not 0.0 < self.break_ <= self.make < 1.0:
            raise ParamsError(
                f"estimator: expected 0 < break_ <= make < 1, got break_ {self.break_:g}, make {self.make:g}"
            )
        if strange := sorted(set(self.tuning) & _NOT_TUNING):
            raise ParamsError(
                f"estimator.tuning.{strange[0]}: expected fields that are a matter of taste; contacts, period and the"
                " IMU's age are those of robot, controller and sensors"
            )
        for name, value in self.tuning.items():
            if isinstance(value, bool) != (name in _SWITCHES):
                kind = "true or false" if name in _SWITCHES else "a number or a word"
                raise ParamsError(f"estimator.tuning.{name}: expected {kind}, got {value!r}")


@dataclass(frozen=True)
class DrivesSpec(Checked):
    """The drives under the controller and their torque control (Del Prete et al., 2016).

    Attributes:
        actuators: Model file of the simulated drives; None: the one that the robot file names.
        model: Model file that the torque control compensates with; None: the simulated drives.
        kp: Gain of the torque feedback [-].
        compensation: Motion for which the effects of the drives are compensated; "reference" is the desired motion of
            the controller.
        start_time: Duration of the transition from the drives' own position servos to the torques of the controller
            [s].
    """

    actuators: str | None = None
    model: str | None = None
    kp: FromZero = 1.0
    compensation: CompensationSpec = field(default_factory=CompensationSpec)
    start_time: Positive = 0.3


@dataclass(frozen=True)
class TorqueErrorSpec(Checked):
    """e ~ N(0, Sigma) that is added to the torques of the plant.

    Attributes:
        scale: Factor on the standard deviations of the controller file; 1.0: the controller knows the distribution of
            the errors.
        hold: Time for which a random error is held [s].
    """

    scale: FromZero = 1.0
    hold: Positive = 1e-3


SENSORS = "realistic"
"""Preset of a scenario that says nothing of sensors."""
FALLIBLE = ("encoder", "motor_encoder", "gauge", "imu", "force_torque", "contacts")
"""What a scenario's faults may name."""


@dataclass(frozen=True, kw_only=True)
class WholeBodySpec(Checked):
    """What stands between a whole-body controller and its robot.

    Attributes:
        seed: Seed of all random numbers.
        state: Source of the state: that of the "plant", "estimated" from encoders, gyro and soles, or the
            "base_estimator" with encoders, IMU and F/T sensors.
        torque: Path of the torques: "direct" to the joints, through "drives" with friction under torque control, or
            through voltage-driven "series_elastic" joints.
        sensors: "perfect", "realistic" or a mapping (`drake_tc.sensing.suite`); used only where the state or the torque
            is estimated.
        drives: Only with `torque: drives`.
        series_elastic: Only with `torque: series_elastic`.
        estimator: Only with `state: base_estimator`.
        torque_error: Random errors of the torques; None: no errors.
        ground: The floor and other bodies that the robot may touch.
        faults: Faults by sensor (`drake_tc.sensing.spec`); only with `state: base_estimator` and `torque:
            series_elastic`. The entry `contacts` corrupts the contact switches that the estimator receives.

    Example:
        >>> WholeBodySpec(state="estimated", torque="drives").drives.kp
        1.0
    """

    seed: Seed = 0
    state: Literal["plant", "estimated", "base_estimator"] = "plant"
    torque: Literal["direct", "drives", "series_elastic"] = "direct"
    sensors: Any = SENSORS
    drives: DrivesSpec = field(default_factory=DrivesSpec)
    series_elastic: SpringDrivesSpec = field(default_factory=SpringDrivesSpec)
    estimator: BaseEstimationSpec = field(default_factory=BaseEstimationSpec)
    torque_error: TorqueErrorSpec | None = None
    ground: GroundSpec = field(default_factory=GroundSpec)
    faults: Mapping[str, tuple[SensorFault, ...]] = field(default_factory=dict)

    @property
    def validated(self) -> bool:
        """Whether sensors are checked, and motions stop where they are lost: with base estimator and series springs."""
        return self.state == "base_estimator" and self.torque == "series_elastic"


@dataclass(frozen=True)
class TsidScenario(ScenarioBase, WholeBodySpec):
    """One experiment.

    Attributes:
        controller: Controller file (drake_tc/tsid/README.md), relative to the scenario file.
        changes: Changes that are merged into the controller file: `{formulation: {measure: classic}}`.
        duration: Length of the simulation [s].
        plant_step: Step of plant and drives [s]; it divides the period of the controller.
        motion: Reference motion, by task.
        lifted: Intervals in which the controller does not use a contact, by contact.
        pushes: Wrenches on links over time.
        masses: Factor on the mass and the inertia of a link in the plant alone, by link.
        source: Folder that file names are relative to.
    """

    SCHEMA: ClassVar[str] = "whole-body-scenario"

    controller: str
    changes: Mapping[str, Any] = field(default_factory=dict)
    duration: Positive = 2.0
    plant_step: Positive = 1e-3
    motion: Mapping[str, KnotSpec] = field(default_factory=dict)
    lifted: Mapping[str, tuple[SpanSpec, ...]] = field(default_factory=dict)
    pushes: tuple[PushSpec, ...] = ()
    masses: Mapping[str, float] = field(default_factory=dict)
    source: str = "."

    def __post_init__(self) -> None:
        super().__post_init__()
        check_masses(self.masses)
        if self.torque_error is not None and self.torque_error.hold < self.plant_step:
            raise ParamsError(
                f"torque_error.hold: expected plant_step {self.plant_step:g} s or more, got {self.torque_error.hold:g}"
            )
        for name, default, choice, needed in (
            ("drives", DrivesSpec(), self.torque, "drives"),
            ("series_elastic", SpringDrivesSpec(), self.torque, "series_elastic"),
            ("estimator", BaseEstimationSpec(), self.state, "base_estimator"),
        ):
            if choice != needed and getattr(self, name) != default:
                key = "state" if name == "estimator" else "torque"
                raise ParamsError(f"{name}: expected {key}: {needed} beside it; with {key}: {choice} there are none")
        if self.torque != "drives" and self.state == "plant" and self.sensors != SENSORS:
            raise ParamsError(
                "sensors: expected state: estimated or torque: drives beside it; with neither nothing is sensed"
            )
        for name in self.faults:
            if name not in FALLIBLE:
                raise ParamsError(f"faults: no sensor {name!r}; possible: {', '.join(FALLIBLE)}")
        if self.faults.get("contacts") and not any(self.lifted.values()):
            raise ParamsError(
                "faults.contacts: expected `lifted` beside it; without it no contact signal can be corrupted"
            )
        if self.series_elastic.position_gain > 0.0 and (self.motion or self.lifted):
            raise ParamsError(
                "series_elastic.position_gain: expected neither motion nor lifted; motors stay where they are"
            )
        if any(self.faults.values()) and (self.state, self.torque) != ("base_estimator", "series_elastic"):
            raise ParamsError(
                "faults: expected state: base_estimator and torque: series_elastic beside it,"
                f" got {self.state} and {self.torque}"
            )
