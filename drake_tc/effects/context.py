"""What is known of a rig before an effect is looked for in its logs, and the parameters that an effect fits to them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np

from drake_tc.config.joint_units import JointType, JointUnits
from drake_tc.types import FloatArray

Scale = Literal[
    "one", "effort", "torque", "torque/speed", "torque/speed^2", "torque/span", "load", "load/duration", "speed",
    "span", "1/torque", "effort/speed", "effort/supply", "coulomb", "viscous",
]  # fmt: skip
"""The quantity of the rig by which a plausible range is multiplied; `Context.scale` computes it."""
Values: TypeAlias = Mapping[str, FloatArray | float]
"""Values of parameters by name, each one number or one a joint."""


@dataclass(frozen=True)
class Plausible:
    """The range in which a parameter is physically possible: lower * scale <= value <= upper * scale.

    The bounds of a fit keep the arithmetic sound and may be wide. This range decides whether a value that was fitted
    may be reported as a cause.

    Attributes:
        lower, upper: Limits, inclusive, in units of `scale`.
        source: Why the range is what it is: a law, a definition, a data sheet or a publication.
        scale: What the limits are multiplied by.
        sliding: The range of a joint that slides, where it is another one.
    """

    lower: float
    upper: float
    source: str
    scale: Scale = "one"
    sliding: "Plausible | None" = None

    def on(self, joint_type: JointType) -> "Plausible":
        """The range of a joint of this type."""
        return self.sliding if self.sliding is not None and joint_type == "prismatic" else self


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect: its unit, where it may lie, and what it is before any data speak.

    Attributes:
        name: As it stands in YAML files and reports.
        unit: SI, as text, of a joint that turns (`drake_tc.config.joint_units` gives that of one that slides); "effort"
            means the unit of the drive's effort.
        lower, upper: Bounds of the fit, inclusive; an estimate that rests on one is reported `at_bound`.
        default: Value of a model that names the effect without this parameter.
        description: One line for reports and docs.
        plausible: Where the value is physically possible (`drake_tc.effects.check`). None for a coefficient
            of a fit that no report shows.
    """

    name: str
    unit: str
    lower: float = -np.inf
    upper: float = np.inf
    default: float = 0.0
    description: str = ""
    plausible: Plausible | None = None


DriveKind = Literal["position_servo", "current", "voltage", "torque"]
LoadKind = Literal["torque", "pendulum", "robot", "links", "unknown"]
BETWEEN_ENCODERS = "the balance at the motor does not contain it; a note states what the two encoders show of it"
NO_INERTIA = "the rig file states no value of rotor_inertia, so this effect cannot be distinguished from others"
"""Why an effect that needs a known inertia cannot be looked for; `declared: [rotor_inertia]` states no value."""


@dataclass(frozen=True)
class Context:
    """What is known of the rig before the data are looked at; decides which effects can apply.

    Attributes:
        drive: Kind of drive.
        load: Where the load torque comes from: a torque column, a pendulum's mass and length, a robot's model, "links":
            a robot's model whose links' parameters are fitted, or "unknown": the declared model fits it.
        recorded: Names of the `Signals` fields that were recorded.
        declared: Parameter values that the user vouches for.
        link_inertia: Of a pendulum load about the axis [kg m^2]; 0 where the load is measured.
        hang_angle: Of a pendulum load: joint position at which it hangs [rad].
        max_speed: Largest resolved speed in the logs [rad/s].
        position_span: (lowest, highest) position [rad].
        effort_span: (lowest, highest) effort.
        period: Sampling period [s].
        torque_span: (lowest, highest) load torque [N m]; infinite where it is not known.
        duration: Length of the longest run [s]; infinite where it is not known.
        supply_voltage: Median of the recorded supply voltage [V]; NaN where it was not recorded.
        supply_change: Largest departure of it from its median [V]; 0 where it was not recorded.
        position_recorded: Whether the position was measured; else it is the integral of the velocity, without a zero.
        temperature_span: (lowest, highest) recorded temperature [deg C]; NaN where it was not recorded.
        fitted: Values of the fitted model that other effects are compared with: `gain` (K [effort/(N m)]),
            `viscous` [N m s/rad] and `coulomb` [N m], those that are known.
        tolerances: Declared standard deviations of the joint's sensor errors, by the id of the effect.
        load_follows_position: Whether a fitted unknown load changes with the position: all but a mass that slides.
        joint_type: Whether the joint turns or slides; the units here are those of one that turns (`joint_units`).
    """

    drive: DriveKind
    load: LoadKind
    recorded: frozenset[str]
    declared: Mapping[str, float] = field(default_factory=dict)
    link_inertia: float = 0.0
    hang_angle: float = 0.0
    max_speed: float = 1.0
    position_span: tuple[float, float] = (-1.0, 1.0)
    effort_span: tuple[float, float] = (-1.0, 1.0)
    period: float = 1e-3
    torque_span: tuple[float, float] = (-math.inf, math.inf)
    duration: float = math.inf
    supply_voltage: float = math.nan
    supply_change: float = 0.0
    temperature_span: tuple[float, float] = (math.nan, math.nan)
    fitted: Mapping[str, float] = field(default_factory=dict)
    position_recorded: bool = True
    tolerances: Mapping[str, float] = field(default_factory=dict)
    joint_type: JointType = "revolute"
    load_follows_position: bool = True

    @property
    def units(self) -> JointUnits:
        """Units of the joint, with torques that have a scale."""
        return JointUnits(self.joint_type, self.drive)

    @property
    def imposes_current(self) -> bool:
        """Whether the drive controls its current, so that neither the supply nor the winding changes the torque."""
        return self.drive in ("current", "torque")

    @property
    def taken_up(self) -> str:
        """Why an effect that has the form of a load cannot be looked for beside an unknown load; "" where it can."""
        return (
            "the load is unknown, and the fitted load has a term of this form already" if self.load == "unknown" else ""
        )

    @property
    def effort(self) -> float:
        """Largest |effort| in the logs."""
        return max(abs(self.effort_span[0]), abs(self.effort_span[1]))

    @property
    def turns(self) -> float:
        """Turns of the output that the positions span."""
        return (self.position_span[1] - self.position_span[0]) / (2.0 * math.pi)

    @property
    def load_torque(self) -> float:
        """Largest |load torque| in the logs [N m]; infinite where it is not known."""
        return max(abs(self.torque_span[0]), abs(self.torque_span[1]))

    @property
    def torque(self) -> float:
        """Largest torque that drive and load together put into the joint [N m]; infinite where it is not known."""
        gain = self.fitted.get("gain", 0.0)
        return self.effort / gain + self.load_torque if gain > 0.0 else math.inf

    def scale(self, name: Scale) -> float:
        """The quantity `name` of this rig, infinite where it is not known (`1/torque` is then 0)."""
        tiny = 1e-12
        speed, span = max(self.max_speed, tiny), max(2.0 * math.pi * self.turns, tiny)
        values: dict[Scale, float] = {
            "one": 1.0,
            "effort": self.effort,
            "torque": self.torque,
            "torque/speed": self.torque / speed,
            "torque/speed^2": self.torque / speed**2,
            "torque/span": self.torque / span,
            "load": self.load_torque,
            "load/duration": self.load_torque / max(self.duration, tiny),
            "speed": speed,
            "span": span,
            "1/torque": 1.0 / max(self.load_torque, tiny) if math.isfinite(self.load_torque) else math.inf,
            "effort/speed": self.effort / speed,
            "effort/supply": self.effort / self.supply_voltage if self.supply_voltage > 0.0 else math.inf,
            "coulomb": self.fitted.get("coulomb", math.inf),
            "viscous": self.fitted.get("viscous", math.inf),
        }
        value = values[name]
        return math.inf if math.isnan(value) else value


@dataclass(frozen=True)
class JointNumbers:
    """The declared model of a joint in numbers, with which sizes of effects are compared.

    Attributes:
        gain: K [effort/(N m)].
        viscous: F_v [N m s/rad], at least 0.
        coulomb: F_c [N m], at least 0.
        inertia: Rotor and link together [kg m^2].
        torque: Largest torque that the motor delivers [N m].
        effort: Largest effort.
        speed: Largest speed [rad/s].
        span: Positions that the motion covers [rad].
        rotor: Of `inertia`, the rotor's part, declared or fitted [kg m^2].
    """

    gain: float
    viscous: float
    coulomb: float
    inertia: float
    torque: float
    effort: float
    speed: float
    span: float
    rotor: float = 0.0

    @property
    def part(self) -> float:
        """5 % of the largest torque [N m]."""
        return 0.05 * self.torque

    @property
    def friction(self) -> float:
        """A fifth of the Coulomb friction [N m], or 5 % of the largest torque where it is small."""
        return 0.2 * self.coulomb if self.coulomb > 0.02 * self.torque else self.part

    @property
    def damping_ratio(self) -> float:
        """F_v/F_c [s/rad]; 0 without Coulomb friction."""
        return self.viscous / self.coulomb if self.coulomb > 0.0 else 0.0


ObstacleReason = Literal["cannot_be_looked_for", "not_recorded", "not_excited"]


@dataclass(frozen=True)
class Obstacle:
    """What stands in the way.

    Attributes:
        reason: "not_recorded", the logs lack a signal; "not_excited", what they recorded changes too little; or
            "cannot_be_looked_for", this kind of drive or load, or what the rig file declares, does not allow it.
        statement: The same in a few words of the effect's own.
    """

    reason: ObstacleReason
    statement: str
