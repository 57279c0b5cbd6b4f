"""An experiment on one series-elastic joint as data: motor, link, hand, sensors, torque law, reference.

A series-elastic joint as a linear analysis takes it, and the diagram at a moment of its scenario.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ClassVar, Literal

from drake_tc.actuation.model import ActuatorModel, EffectValue
from drake_tc.actuation.model_file import models_of_joints
from drake_tc.actuation.recorded_run import Link
from drake_tc.config.records import Checked, Finite, FromZero, Positive
from drake_tc.control.series_elastic import SeriesElasticSpec
from drake_tc.errors import ParamsError
from drake_tc.loops.scenarios import ScenarioBase, Seed, check_masses, erring
from drake_tc.sensing.spec import MOST_TICKS, SensorSpec


@dataclass(frozen=True)
class HandSpec(Checked):
    """A hand on the link: a spring and a damper to where it holds.

    Attributes:
        stiffness: Stiffness of the hand [N m/rad].
        damping: Damping of the hand [N m s/rad].
        times: Times of the knots of its path [s]; empty: the hand rests.
        knots: Positions at these times [rad], joined by straight lines that are rounded over `rounding`.
        rounding: Time over which corners of the path are rounded [s].
    """

    stiffness: FromZero
    damping: FromZero = 0.0
    times: tuple[float, ...] = ()
    knots: tuple[float, ...] = ()
    rounding: Positive = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.times) != len(self.knots) or len(self.times) == 1:
            raise ParamsError(f"hand: expected as many knots as times, none or two at least, got {len(self.knots)}")
        if any(b <= a for a, b in zip(self.times, self.times[1:], strict=False)):
            raise ParamsError("hand.times: expected rising times [s]")


@dataclass(frozen=True)
class ReferenceSpec(Checked):
    """Reference of the joint: a torque, or a motion of the link under a soft position loop.

    Attributes:
        offset, amplitude: Offset and amplitude of the torque [N m], or of the angle of the link [rad] with `of:
            position`.
        frequency_hz: Frequency of the sine [Hz].
        begin: Start of the motion [s].
        ramp: Duration of the rise [s].
        of: "torque", or "position": tau_ref = M q''_d + m g l sin q_d + stiffness (q_d - q) + damping (q'_d - q').
        stiffness, damping: Gains of the position loop [N m/rad, N m s/rad].
    """

    offset: Finite = 0.0
    amplitude: Finite = 0.0
    frequency_hz: Positive = 1.0
    begin: Finite = 0.1
    ramp: Positive = 0.4
    of: Literal["torque", "position"] = "torque"
    stiffness: Finite = 0.0
    damping: Finite = 0.0


@dataclass(frozen=True)
class SeaSensors:
    """The joint's sensors.

    Attributes:
        motor_encoder: Encoder before the spring [rad].
        link_encoder: Coarse encoder after the spring [rad].
        torque: Strain gauge [N m].
    """

    motor_encoder: SensorSpec = field(default_factory=SensorSpec)
    link_encoder: SensorSpec = field(default_factory=SensorSpec)
    torque: SensorSpec = field(default_factory=SensorSpec)


@dataclass(frozen=True, kw_only=True)
class SeriesElasticLoopSpec(Checked):
    """How voltage-driven series-elastic joints are torque-controlled.

    Attributes:
        control: The torque law.
        delay: Delay of the loop between the computation of a voltage and its effect at the motor [s], without the
            latencies of the sensors.
        torque_from: Torque that is fed back: that of the "gauge", or the "deflection" of the spring between the
            encoders.
        sensors: Errors of the sensors.
        dt: Period of control, sensors, motor and link [s].
        seed: Seed of all random numbers.

    Raises:
        ParamsError: a choice that there is not, or a delay that is no multiple of the period.

    Example:
        >>> SeriesElasticLoopSpec(delay=0.004).dt
        0.001
    """

    control: SeriesElasticSpec = field(default_factory=SeriesElasticSpec)
    delay: float = 0.015
    torque_from: Literal["gauge", "deflection"] = "gauge"
    sensors: SeaSensors = field(default_factory=SeaSensors)
    dt: Positive = 1e-3
    seed: Seed = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        ratio = self.delay / self.dt
        if not 0.0 <= ratio <= MOST_TICKS or abs(ratio - round(ratio)) > 1e-6:
            raise ParamsError(
                f"delay: expected a multiple of dt = {self.dt:g} s, {MOST_TICKS} of them at most; got {self.delay:g} s"
            )


@dataclass(frozen=True)
class SeaScenario(ScenarioBase, SeriesElasticLoopSpec):
    """One experiment.

    Attributes:
        actuators: Model file of the simulated motor, gear and spring, relative to the scenario file.
        joint: Name of the joint in that file.
        effects: Effects that are added to that model or replaced in it, with their parameters, as
            `{torque_ripple: {...}}`; `{}` in place of the parameters removes an effect.
        model_factors: Factor on `gain`, or on an effect of one parameter, in the controller's model.
        link: Inertia [kg m^2] and gravity moment [N m] behind the spring.
        hand: A spring and a damper that hold the link; None: the link is not held.
        reference: Torque or motion that the joint follows.
        duration: Length of the simulation [s].
        masses: None here: the link has no name.
        source: Folder that file names are relative to.
    """

    SCHEMA: ClassVar[str] = "series-elastic-scenario"

    actuators: str
    joint: str
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    model_factors: Mapping[str, float] = field(default_factory=dict)
    link: Link = field(default_factory=lambda: Link(0.1))
    hand: HandSpec | None = None
    reference: ReferenceSpec = field(default_factory=ReferenceSpec)
    duration: Positive = 3.0
    masses: Mapping[str, float] = field(default_factory=dict)
    source: str = "."

    def __post_init__(self) -> None:
        super().__post_init__()
        check_masses(self.masses)

    def actuator(self) -> ActuatorModel:
        """The simulated motor, gear and spring.

        Raises:
            ParamsError: a file that cannot be read, a joint or effect that is not there.
        """
        model = models_of_joints(Path(self.source) / self.actuators, [self.joint])[self.joint]
        kept = [value for value in model.effects if value.key not in self.effects]
        more = [EffectValue(key, parameters) for key, parameters in self.effects.items() if parameters]
        return replace(model, effects=(*kept, *more))

    def controller_actuator(self) -> ActuatorModel:
        """What the controller takes it for: drive gain, damping, dry friction, inertia, spring and limit, with errors.

        Raises:
            ParamsError: as `actuator`; or a factor for what the model does not have.
        """
        removed = {key for key, parameters in self.effects.items() if not parameters}
        factors = {key: factor for key, factor in self.model_factors.items() if key not in removed}
        return erring([self.actuator()], factors)[0]


def spring_compliance(model: ActuatorModel) -> float:
    """1/Ks [rad/(N m)].

    Raises:
        ParamsError: a model without a spring.
    """
    for value in model.effects:
        if value.key == "elasticity":
            return value.parameters["compliance"]
    raise ParamsError(f"joint {model.joint!r}: expected an elasticity in its model, the series spring, got none")


def sliding_sea(scenario: SeaScenario) -> SeaScenario:
    """The scenario without dry friction, in motor and model, and with sensors that are late but otherwise perfect."""
    sensors = scenario.sensors
    late = {name: SensorSpec(latency=getattr(sensors, name).latency) for name in vars(sensors)}
    return replace(scenario, effects={**scenario.effects, "coulomb": {}}, sensors=SeaSensors(**late))
