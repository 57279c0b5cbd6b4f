"""Series-elastic drives and the base estimator under a whole-body controller, as data (Faraji et al., 2015)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from drake_tc.control.series_elastic.spec import SeriesElasticSpec
from drake_tc.errors import ParamsError
from drake_tc.estimation.base.system import METHODS
from drake_tc.sensing.spec import SensorSpec


@dataclass(frozen=True)
class SpringDrivesSpec:
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
    delay: float = 0.015
    acceleration_bandwidth: float = 0.0
    joint_damping: float = 0.0
    damped_joints: tuple[str, ...] = ()
    position_gain: float = 0.0
    link_from: Literal["motor", "link"] = "motor"
    motor_encoder: SensorSpec = field(default_factory=lambda: SensorSpec(resolution=1.534e-5))
    gauge: SensorSpec = field(default_factory=lambda: SensorSpec(noise=0.02))

    def __post_init__(self) -> None:
        if self.link_from not in ("motor", "link"):
            raise ParamsError(f"series_elastic.link_from: expected motor or link, got {self.link_from!r}")
        for name, value, unit in (
            ("delay", self.delay, "a time >= 0 [s]"),
            ("acceleration_bandwidth", self.acceleration_bandwidth, "a number >= 0 [rad/s]"),
            ("joint_damping", self.joint_damping, "a number >= 0 [N m s/rad]"),
            ("position_gain", self.position_gain, "a number >= 0 [N m/rad]"),
        ):
            if not 0.0 <= value < math.inf:
                raise ParamsError(f"series_elastic.{name}: expected {unit}, got {value:g}")
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
class BaseEstimationSpec:
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
    velocity_window: int = 15
    sole_stiffness: float | None = None
    sole_points: tuple[int, ...] = (5, 3)
    tuning: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
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
        if self.velocity_window < 4:
            raise ParamsError(f"estimator.velocity_window: expected 4 samples or more, got {self.velocity_window}")
        if len(self.sole_points) != 2:
            raise ParamsError(f"estimator.sole_points: expected two numbers, got {list(self.sole_points)}")
