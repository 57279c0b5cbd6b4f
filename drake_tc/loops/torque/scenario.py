"""A torque-control experiment as data: robot, controller, motion, surroundings, sensors and what goes wrong.

One YAML file holds many scenarios by name. `extends: NAME` takes another scenario of the file and changes what is
given, field by field. Everything is SI; joints are named as in the robot's YAML.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Literal

from drake_tc.errors import ParamsError
from drake_tc.loops.scenarios.base import ScenarioBase, check_run
from drake_tc.loops.scenarios.parts import (
    ForceSpec,
    GainSpec,
    ModelFactors,
    MotionSpec,
    ObjectSpec,
    PushSpec,
    SuspensionSpec,
)
from drake_tc.loops.torque.spec import TorqueLoopSpec


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
    duration: float = 2.0
    plant_step: float = 1e-3
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
        TorqueLoopSpec.__post_init__(self)
        check_run(self, ("duration", "plant_step"))
        ratio = self.dt / self.plant_step
        if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-6:
            raise ParamsError(f"plant_step: expected dt = {self.dt:g} s over a whole number, got {self.plant_step:g}")
