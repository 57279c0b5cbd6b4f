"""A torque-control experiment as data: robot, controller, motion, surroundings, sensors and what goes wrong.

One YAML file holds many scenarios by name. `extends: NAME` takes another scenario of the file and changes what is
given, field by field. Everything is SI; joints are named as in the robot's YAML.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Literal

from drake_tc.errors import ParamsError
from drake_tc.loops.scenarios.base import ScenarioBase
from drake_tc.loops.scenarios.checks import check_run
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
        robot: Robot YAML, relative to the scenario file.
        duration: Length of the simulation [s].
        plant_step: Of plant and actuators [s]; divides dt.
        actuators: Model file of the simulated actuators; None takes the robot file's.
        model: Model file that the controller compensates with; None takes the simulated actuators themselves.
        model_factors: Errors of that model, on purpose.
        gains: Feedback gains.
        motion: Where the joints are to be.
        suspension: Springs that carry the base, which then floats; None: it is as the robot file has it.
        force: F/T sensor to force reference at its contact.
        pushes, objects: Surroundings.
        masses: Link to a factor on its mass and inertia in the simulated plant only: the model is then wrong.
        joint_stops: "none" takes the stops away from plant and model, to see where an unstable joint would go.
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
