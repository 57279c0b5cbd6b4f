"""An experiment with robust TSID as data: controller, motion, contacts, plant, drives, torque errors."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from drake_tc.control.torque_law import CompensationSpec
from drake_tc.errors import ParamsError
from drake_tc.loops.scenarios.base import ScenarioBase, check_run
from drake_tc.loops.scenarios.parts import PushSpec
from drake_tc.loops.whole_body.chain_specs import BaseEstimationSpec, SpringDrivesSpec
from drake_tc.loops.whole_body.ground import GroundSpec, SoleSpec
from drake_tc.loops.whole_body.references import KnotSpec, SpanSpec, TurnSpec
from drake_tc.sensing.fault import SensorFault

__all__ = [
    "DrivesSpec",
    "GroundSpec",
    "KnotSpec",
    "SoleSpec",
    "SpanSpec",
    "TorqueErrorSpec",
    "TsidScenario",
    "TurnSpec",
    "WholeBodySpec",
]


@dataclass(frozen=True)
class DrivesSpec:
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
    kp: float = 1.0
    compensation: CompensationSpec = field(default_factory=CompensationSpec)
    start_time: float = 0.3

    def __post_init__(self) -> None:
        if not (0.0 <= self.kp < math.inf and 0.0 < self.start_time < math.inf):
            raise ParamsError(f"drives: expected kp >= 0 and start_time > 0, got {self.kp:g} and {self.start_time:g}")


@dataclass(frozen=True)
class TorqueErrorSpec:
    """e ~ N(0, Sigma) that is added to the torques of the plant.

    Attributes:
        scale: Factor on the standard deviations of the controller file; 1.0: the controller knows the distribution of
            the errors.
        hold: Time for which a random error is held [s].
    """

    scale: float = 1.0
    hold: float = 1e-3

    def __post_init__(self) -> None:
        if not (0.0 <= self.scale < math.inf and 0.0 < self.hold < math.inf):
            raise ParamsError(f"torque_error: expected scale >= 0 and hold > 0, got {self.scale:g} and {self.hold:g}")


SENSORS = "realistic"
"""Preset of a scenario that says nothing of sensors."""
FALLIBLE = ("encoder", "motor_encoder", "gauge", "imu", "force_torque", "contacts")
"""What a scenario's faults may name."""


@dataclass(frozen=True, kw_only=True)
class WholeBodySpec:
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
        faults: Faults by sensor (`drake_tc.sensing.fault`); only with `state: base_estimator` and `torque:
            series_elastic`. The entry `contacts` corrupts the contact switches that the estimator receives.

    Example:
        >>> WholeBodySpec(state="estimated", torque="drives").drives.kp
        1.0
    """

    seed: int = 0
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
    duration: float = 2.0
    plant_step: float = 1e-3
    motion: Mapping[str, KnotSpec] = field(default_factory=dict)
    lifted: Mapping[str, tuple[SpanSpec, ...]] = field(default_factory=dict)
    pushes: tuple[PushSpec, ...] = ()
    masses: Mapping[str, float] = field(default_factory=dict)
    source: str = "."

    def __post_init__(self) -> None:
        check_run(self, ("duration", "plant_step"))
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
