"""An experiment with robust TSID as data: controller, motion, contacts, plant, drives, torque errors."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from drake_tc.diagrams.scenarios.checks import check_run
from drake_tc.diagrams.scenarios.files import read_scenario
from drake_tc.diagrams.scenarios.parts import PushSpec
from drake_tc.diagrams.scenarios.strict_yaml import from_mapping

from drake_tc.control.torque_control import CompensationSpec
from drake_tc.errors import ParamsError


@dataclass(frozen=True)
class KnotSpec:
    """Where a task goes: its resting place moved by offsets, joined smoothly, at rest at both ends.

    Attributes:
        times: Of the knots [s], increasing, two at least.
        offsets: One a knot, [x, y, z] in the world [m].
    """

    times: tuple[float, ...]
    offsets: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        if len(self.times) < 2 or len(self.offsets) != len(self.times):
            raise ParamsError(
                f"motion: wanted two times or more and as many offsets; got {len(self.times)} and {len(self.offsets)}"
            )
        if any(len(offset) != 3 for offset in self.offsets):
            raise ParamsError("motion: wanted offsets of three numbers [x, y, z]")


@dataclass(frozen=True)
class SpanSpec:
    """A time in which something is so: begin <= t < end [s]."""

    begin: float
    end: float = math.inf

    def __post_init__(self) -> None:
        if not self.begin < self.end:
            raise ParamsError(f"span: wanted begin < end [s]; got {self.begin:g} and {self.end:g}")


@dataclass(frozen=True)
class GroundSpec:
    """The floor z = 0 and how the soles touch it: a sphere at each corner, point contact.

    Attributes:
        friction: Coulomb's, of the pair of surfaces.
        stiffness: Of each sphere [N/m]; None for as stiff as the step allows.
        dissipation: Of Hunt and Crossley [s/m].
        radius: Of the spheres [m].
        margin: How far the soles reach beyond what the controller takes for them [m].
        approximation: How the discrete plant solves for contact forces.
    """

    friction: float = 0.8
    stiffness: float | None = None
    dissipation: float = 1.0
    radius: float = 0.01
    margin: float = 0.005
    approximation: Literal["sap", "tamsi", "similar", "lagged"] = "tamsi"

    def __post_init__(self) -> None:
        if not (0.0 <= self.friction < math.inf and 0.0 <= self.dissipation < math.inf):
            raise ParamsError("ground: wanted finite friction and dissipation >= 0")
        if not 0.0 < self.radius < math.inf:
            raise ParamsError(f"ground.radius: wanted a positive length [m]; got {self.radius:g}")
        if self.stiffness is not None and not 0.0 < self.stiffness < math.inf:
            raise ParamsError(f"ground.stiffness: wanted a positive number [N/m]; got {self.stiffness:g}")
        if self.approximation not in ("sap", "tamsi", "similar", "lagged"):
            raise ParamsError(
                f"ground.approximation: wanted one of sap, tamsi, similar, lagged; got {self.approximation!r}"
            )


@dataclass(frozen=True)
class DrivesSpec:
    """The drives under the controller and their torque control (paper A).

    Attributes:
        actuators: Model file of the simulated drives; None takes the robot file's.
        model: Model file that the torque control compensates with; None takes the simulated drives themselves.
        kp: Feedback of the estimated torque [-].
        compensation: Which motion the drives' effects are compensated for; "reference" is the controller's own.
        start_time: From standing under the drives' own servos to the controller's torques [s].
    """

    actuators: str | None = None
    model: str | None = None
    kp: float = 1.0
    compensation: CompensationSpec = field(default_factory=CompensationSpec)
    start_time: float = 0.3

    def __post_init__(self) -> None:
        if not (0.0 <= self.kp < math.inf and 0.0 < self.start_time < math.inf):
            raise ParamsError(f"drives: wanted kp >= 0 and start_time > 0; got {self.kp:g} and {self.start_time:g}")


@dataclass(frozen=True)
class TorqueErrorSpec:
    """e ~ N(0, Sigma) that is added to the torques of the plant.

    Attributes:
        scale: On the controller's sigma, which has its Sigma from its file: 1.0 when the controller knows the truth.
        hold: How long a draw lasts [s].
    """

    scale: float = 1.0
    hold: float = 1e-3

    def __post_init__(self) -> None:
        if not (0.0 <= self.scale < math.inf and 0.0 < self.hold < math.inf):
            raise ParamsError(f"torque_error: wanted scale >= 0 and hold > 0; got {self.scale:g} and {self.hold:g}")


@dataclass(frozen=True)
class TsidScenario:
    """One experiment.

    Attributes:
        controller: Controller file (drake_tc/tsid/README.md), relative to the scenario file.
        changes: Laid over the controller file: `{formulation: {measure: classic}}`.
        duration: [s].
        plant_step: Of plant and drives [s]; divides the controller's period.
        seed: Of all random numbers.
        state: What the controller knows: the "plant"'s own state, or "estimated" from encoders, IMU and F/T sensors.
        torque: Where its torques go: "direct" to the joints, or through "drives" with friction under torque control.
        sensors: "perfect", "realistic" or a mapping (`drake_tc.sensing.suite`); for what is estimated.
        drives: With `torque: drives`.
        motion: Task to where it goes.
        lifted: Contact to the times when the controller does without it.
        torque_error: Errors of the torques; None: none.
        ground: The floor.
        pushes: Wrenches on links over time.
        masses: Link to a factor on its mass and inertia in the plant alone.
        source: Folder that file names are relative to.
    """

    controller: str
    changes: Mapping[str, Any] = field(default_factory=dict)
    duration: float = 2.0
    plant_step: float = 1e-3
    seed: int = 0
    state: Literal["plant", "estimated"] = "plant"
    torque: Literal["direct", "drives"] = "direct"
    sensors: Any = "realistic"
    drives: DrivesSpec = field(default_factory=DrivesSpec)
    motion: Mapping[str, KnotSpec] = field(default_factory=dict)
    lifted: Mapping[str, tuple[SpanSpec, ...]] = field(default_factory=dict)
    torque_error: TorqueErrorSpec | None = None
    ground: GroundSpec = field(default_factory=GroundSpec)
    pushes: tuple[PushSpec, ...] = ()
    masses: Mapping[str, float] = field(default_factory=dict)
    source: str = "."

    def __post_init__(self) -> None:
        choices = {"state": ("plant", "estimated"), "torque": ("direct", "drives")}
        check_run(self, choices, ("duration", "plant_step"))

    def changed(self, **fields: Any) -> "TsidScenario":
        """The same with other values; those that are None stay."""
        return replace(self, **{name: value for name, value in fields.items() if value is not None})

    def path(self, name: str) -> Path:
        """A file that the scenario names, relative to the file it stands in."""
        return Path(self.source) / name


def load_tsid_scenario(path: Path, name: str, text: str | None = None) -> TsidScenario:
    """The scenario `name` of a file, with the fields in `text` (YAML) changed.

    Raises:
        ParamsError: no such file or scenario, an unknown field, or a value that is not possible.
    """
    document = {"source": str(path.parent), **read_scenario(path, name, text)}
    scenario: TsidScenario = from_mapping(TsidScenario, document, f"{path}: {name}")
    return scenario
