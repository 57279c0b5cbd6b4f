"""An experiment with robust TSID as data: controller, motion, contacts, plant, drives, torque errors."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

from drake_tc.diagrams.scenarios.checks import check_run
from drake_tc.diagrams.scenarios.files import read_scenario
from drake_tc.diagrams.scenarios.parts import PushSpec
from drake_tc.diagrams.scenarios.strict_yaml import from_mapping
from drake_tc.diagrams.tsid.chain_specs import BaseEstimationSpec, SpringDrivesSpec

from drake_tc.control.torque_control import CompensationSpec
from drake_tc.errors import ParamsError

LONG = 0.1
"""The largest sphere under a sole, and how far soles may reach beyond what the controller takes for them [m]."""


@dataclass(frozen=True)
class TurnSpec:
    """How an orientation turns about an axis of the world: through angles, resting at each, or to and fro.

    Attributes:
        axis: Of any length but zero.
        times: Of the angles [s], increasing, two at least; none for to and fro.
        angles: From its resting orientation [rad], one a time.
        amplitude: Of the motion to and fro [rad]; with no times.
        frequency_hz: Of that [Hz].
        begin: When it starts [s].
        rise: In which its amplitude grows from 0 [s].
    """

    axis: tuple[float, ...]
    times: tuple[float, ...] = ()
    angles: tuple[float, ...] = ()
    amplitude: float = 0.0
    frequency_hz: float = 1.0
    begin: float = 0.0
    rise: float = 1.0

    def __post_init__(self) -> None:
        if len(self.axis) != 3:
            raise ParamsError(f"turn.axis: wanted three numbers; got {len(self.axis)}")
        if len(self.times) == 1 or len(self.angles) != len(self.times):
            raise ParamsError(
                f"turn: wanted no times, or two or more and as many angles; got {len(self.times)} and"
                f" {len(self.angles)}"
            )
        if self.times and self.amplitude:
            raise ParamsError("turn: wanted either times and angles or an amplitude; got both")
        if not all(later > earlier for earlier, later in pairwise(self.times)):
            raise ParamsError(f"turn.times: wanted increasing times [s]; got {list(self.times)}")


@dataclass(frozen=True)
class KnotSpec:
    """Where a task goes: its resting place moved by offsets, joined smoothly, at rest at both ends; or how it turns.

    Attributes:
        times: Of the knots [s], increasing, two at least.
        offsets: One a knot, [x, y, z] in the world [m].
        turn: In place of knots, for an orientation.
    """

    times: tuple[float, ...] = ()
    offsets: tuple[tuple[float, ...], ...] = ()
    turn: TurnSpec | None = None

    def __post_init__(self) -> None:
        if self.turn is not None and not self.times and not self.offsets:
            return
        if self.turn is not None:
            raise ParamsError("motion: wanted either times and offsets or a turn; got both")
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
class SoleSpec:
    """A soft layer under each sole, that lets the foot sink, tilt and roll: springs in a grid, on a rigid floor.

    Each of nx ny points carries k/(nx ny) of its depth and never pulls. At rest under a force F, c [m] off the middle
    of a sole of 2a x 2b, the foot sinks by F/k and tilts by F c/(k r^2), r^2 = a^2 (nx + 1)/(3 (nx - 1)) along x and
    the like along y, as long as all points touch: |c| < r^2/a. Farther out it rolls onto its edge.

    Attributes:
        stiffness: k of a whole sole [N/m]; E A/h of a layer of modulus E, area A, thickness h.
        points: nx, ny, along the sole's x and y, the outermost at its corners; a point foot has one.
        dissipation: Of Hunt and Crossley [s/m]: a foot under F has F times it for a damper; "sap" has a time instead.
    """

    stiffness: float
    points: tuple[int, ...] = (5, 3)
    dissipation: float = 10.0

    def __post_init__(self) -> None:
        if not 0.0 < self.stiffness < math.inf:
            raise ParamsError(f"ground.sole.stiffness: wanted a positive number [N/m]; got {self.stiffness:g}")
        if len(self.points) != 2 or min(self.points) < 2:
            raise ParamsError(f"ground.sole.points: wanted two numbers, 2 or more each; got {list(self.points)}")
        if not 0.0 <= self.dissipation < math.inf:
            raise ParamsError(f"ground.sole.dissipation: wanted a finite number >= 0; got {self.dissipation:g}")


@dataclass(frozen=True)
class GroundSpec:
    """The floor z = 0 and how the soles touch it: a sphere at each corner, point contact.

    Attributes:
        friction: Coulomb's, of the pair of surfaces.
        stiffness: Of each sphere [N/m]; None for as stiff as the step allows.
        dissipation: Of Hunt and Crossley [s/m].
        radius: Of the spheres [m], `LONG` at most.
        margin: How far the soles reach beyond what the controller takes for them [m], `LONG` at most; less than they
            do where it is negative.
        approximation: How the discrete plant solves for contact forces.
        sole: A soft layer in place of the corners' spheres, with a stiffness and dissipation of its own; None: none.
    """

    friction: float = 0.8
    stiffness: float | None = None
    dissipation: float = 1.0
    radius: float = 0.01
    margin: float = 0.005
    approximation: Literal["sap", "tamsi", "similar", "lagged"] = "tamsi"
    sole: SoleSpec | None = None

    def __post_init__(self) -> None:
        if not (0.0 <= self.friction < math.inf and 0.0 <= self.dissipation < math.inf):
            raise ParamsError("ground: wanted finite friction and dissipation >= 0")
        if not 0.0 < self.radius <= LONG:
            raise ParamsError(f"ground.radius: wanted a length above 0, {LONG:g} m at most; got {self.radius:g}")
        if not -LONG <= self.margin <= LONG:
            raise ParamsError(f"ground.margin: wanted a length of {-LONG:g} to {LONG:g} m; got {self.margin:g}")
        if self.stiffness is not None and not 0.0 < self.stiffness < math.inf:
            raise ParamsError(f"ground.stiffness: wanted a positive number [N/m]; got {self.stiffness:g}")
        if self.stiffness is not None and self.sole is not None:
            raise ParamsError("ground: wanted either stiffness, of hard soles, or sole; got both")
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


SENSORS = "realistic"
"""Preset of a scenario that says nothing of sensors."""


@dataclass(frozen=True)
class TsidScenario:
    """One experiment.

    Attributes:
        controller: Controller file (drake_tc/tsid/README.md), relative to the scenario file.
        changes: Laid over the controller file: `{formulation: {measure: classic}}`.
        duration: [s].
        plant_step: Of plant and drives [s]; the controller's period is a whole number of them.
        seed: Of all random numbers.
        state: What the controller knows: the "plant"'s own state, "estimated" from encoders, gyro and soles, or by the
            "base_estimator" from encoders, IMU and F/T sensors.
        torque: Where its torques go: "direct" to the joints, through "drives" with friction under torque control, or
            through "series_elastic" ones driven by voltage.
        sensors: "perfect", "realistic" or a mapping (`drake_tc.sensing.suite`); only where something is estimated.
        drives: Only with `torque: drives`.
        series_elastic: Only with `torque: series_elastic`.
        estimator: Only with `state: base_estimator`.
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
    state: Literal["plant", "estimated", "base_estimator"] = "plant"
    torque: Literal["direct", "drives", "series_elastic"] = "direct"
    sensors: Any = SENSORS
    drives: DrivesSpec = field(default_factory=DrivesSpec)
    series_elastic: SpringDrivesSpec = field(default_factory=SpringDrivesSpec)
    estimator: BaseEstimationSpec = field(default_factory=BaseEstimationSpec)
    motion: Mapping[str, KnotSpec] = field(default_factory=dict)
    lifted: Mapping[str, tuple[SpanSpec, ...]] = field(default_factory=dict)
    torque_error: TorqueErrorSpec | None = None
    ground: GroundSpec = field(default_factory=GroundSpec)
    pushes: tuple[PushSpec, ...] = ()
    masses: Mapping[str, float] = field(default_factory=dict)
    source: str = "."

    def __post_init__(self) -> None:
        choices = {
            "state": ("plant", "estimated", "base_estimator"),
            "torque": ("direct", "drives", "series_elastic"),
        }
        check_run(self, choices, ("duration", "plant_step"))
        if self.torque_error is not None and self.torque_error.hold < self.plant_step:
            raise ParamsError(
                f"torque_error.hold: wanted plant_step {self.plant_step:g} s or more; got {self.torque_error.hold:g}"
            )
        for name, default, choice, needed in (
            ("drives", DrivesSpec(), self.torque, "drives"),
            ("series_elastic", SpringDrivesSpec(), self.torque, "series_elastic"),
            ("estimator", BaseEstimationSpec(), self.state, "base_estimator"),
        ):
            if choice != needed and getattr(self, name) != default:
                key = "state" if name == "estimator" else "torque"
                raise ParamsError(f"{name}: wanted {key}: {needed} beside it; with {key}: {choice} there are none")
        if self.torque != "drives" and self.state == "plant" and self.sensors != SENSORS:
            raise ParamsError(
                "sensors: wanted state: estimated or torque: drives beside it; with neither nothing is sensed"
            )

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
