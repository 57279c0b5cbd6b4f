"""A torque-control experiment as data: robot, controller, motion, surroundings, sensors and what goes wrong.

One YAML file holds many scenarios by name. `extends: NAME` takes another scenario of the file and changes what is
given, field by field. Everything is SI; joints are named as in the robot's YAML.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from drake_tc.control.guard import GuardSpec
from drake_tc.control.torque_control import CompensationSpec
from drake_tc.errors import ParamsError
from drake_tc.estimation.delay_predictor import PredictorSpec
from drake_tc.estimation.disturbance_observer import ObserverSpec
from drake_tc.loops.scenarios.base import ScenarioBase
from drake_tc.loops.scenarios.checks import check_run
from drake_tc.loops.scenarios.parts import (
    FilterSpec,
    ForceSpec,
    GainSpec,
    ModelFactors,
    MotionSpec,
    ObjectSpec,
    PushSpec,
    SuspensionSpec,
)
from drake_tc.sensing.fault import SensorFault
from drake_tc.sensor_validation.monitor_spec import MonitorSpec


@dataclass(frozen=True)
class Scenario(ScenarioBase):
    """One experiment.

    Attributes:
        robot: Robot YAML, relative to the scenario file.
        controller: "torque" (the whole chain), "servo" (the vendor's position servo alone).
        duration: [s].
        dt: Period of control and sensors [s].
        plant_step: Of plant and actuators [s]; divides dt.
        seed: Of the one generator.
        actuators: Model file of the simulated actuators; None takes the robot file's.
        model: Model file that the controller compensates with; None takes the simulated actuators themselves.
        model_factors: Errors of that model, on purpose.
        torque_from: "estimate" (F/T, IMU and encoders) or "sensor" (joint-torque sensors that this robot lacks).
        base_from: "imu" or "fixed": where estimator and controller take the base's motion from; "fixed": it has none.
        angular_acceleration: Of the IMU's link: differentiated from the "gyro", "neglected", or "zero" at the base.
        tare: How long the F/T sensors are zeroed before anything may touch the robot [s]; 0: not at all.
        sensors: "perfect", "realistic" or a mapping (`drake_tc.sensing.suite`).
        configuration: Where the inverse dynamics takes M, h and J: the delayed "estimate" or the "reference".
        compensation: Which motion the drives' effects are compensated for.
        gains, filters, motion, guard, monitor: See their classes.
        predictor: Undoes the delay of the estimates with the drives' models; None: off.
        observer: Compensates what those models lack, as encoders show it; None: off.
        rotor_inertia: Joint to what those two know of it [kg m^2]; that of the controller's model where not given.
        suspension: Springs that carry the base, which then floats; None: it is as the robot file has it.
        force: F/T sensor to force reference at its contact.
        pushes, objects: Surroundings.
        faults: "encoder", "imu" or "force_torque" to what goes wrong with it, and when.
        masses: Link to a factor on its mass and inertia in the simulated plant only: the model is then wrong.
        joint_stops: "none" takes the stops away from plant and model, to see where an unstable joint would go.
        log_truth, log_components: Record the true joint torques, the six components of the command too.
        source: Folder that file names are relative to.
    """

    robot: str
    controller: Literal["torque", "servo"] = "torque"
    duration: float = 2.0
    dt: float = 1e-3
    plant_step: float = 1e-3
    seed: int = 0
    actuators: str | None = None
    model: str | None = None
    model_factors: ModelFactors = field(default_factory=ModelFactors)
    torque_from: Literal["estimate", "sensor"] = "estimate"
    base_from: Literal["imu", "fixed"] = "imu"
    angular_acceleration: Literal["gyro", "neglected", "zero"] = "zero"
    tare: float = 0.3
    configuration: Literal["estimate", "reference"] = "reference"
    compensation: CompensationSpec = field(default_factory=CompensationSpec)
    sensors: Any = "realistic"
    gains: GainSpec = field(default_factory=GainSpec)
    filters: FilterSpec = field(default_factory=FilterSpec)
    motion: MotionSpec = field(default_factory=MotionSpec)
    guard: GuardSpec = field(default_factory=GuardSpec)
    monitor: MonitorSpec = field(default_factory=MonitorSpec)
    predictor: PredictorSpec | None = None
    observer: ObserverSpec | None = None
    rotor_inertia: Mapping[str, float] = field(default_factory=dict)
    suspension: SuspensionSpec | None = None
    force: Mapping[str, ForceSpec] = field(default_factory=dict)
    pushes: tuple[PushSpec, ...] = ()
    objects: tuple[ObjectSpec, ...] = ()
    faults: Mapping[str, tuple[SensorFault, ...]] = field(default_factory=dict)
    masses: Mapping[str, float] = field(default_factory=dict)
    joint_stops: Literal["modelled", "none"] = "modelled"
    log_truth: bool = False
    log_components: bool = False
    source: str = "."

    def __post_init__(self) -> None:
        check_run(self, _CHOICES, ("duration", "dt", "plant_step"))
        if not 0.0 <= self.tare < math.inf:
            raise ParamsError(f"tare: wanted a time >= 0 [s]; got {self.tare}")
        ratio = self.dt / self.plant_step
        if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-6:
            raise ParamsError(f"plant_step: wanted dt = {self.dt:g} s over a whole number; got {self.plant_step:g}")
        for name in self.faults:
            if name not in SENSORS:
                raise ParamsError(f"faults: no sensor {name!r}; possible: {', '.join(SENSORS)}")


SENSORS = ("encoder", "imu", "force_torque")
_CHOICES = {
    "controller": ("torque", "servo"),
    "joint_stops": ("modelled", "none"),
    "torque_from": ("estimate", "sensor"),
    "base_from": ("imu", "fixed"),
    "angular_acceleration": ("gyro", "neglected", "zero"),
    "configuration": ("estimate", "reference"),
}
