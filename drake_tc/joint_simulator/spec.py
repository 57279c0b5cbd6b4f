"""What one blind rig is: its true joint, its causes, its motions and its sensors, all as plain numbers."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from drake_tc.errors import DrakeTcError

Drive = Literal["position_servo", "current", "voltage"]
FileFormat = Literal["csv", "csv.gz", "parquet"]
RUNS: tuple[str, ...] = ("static", "sine", "multisine")
HELD_OUT = "multisine"
EFFORT_UNIT: Mapping[str, str] = {"position_servo": "rad", "current": "A", "voltage": "V"}


class BlindError(DrakeTcError):
    """A rig, a truth file or a report of the blind benchmark that cannot be used."""


class DivergedError(BlindError):
    """Rigs whose simulation left every plausible range; `names` says which."""

    def __init__(self, names: list[str]) -> None:
        super().__init__(f"simulation of {', '.join(names)} diverged; weaken their causes")
        self.names = frozenset(names)


@dataclass(frozen=True)
class Joint:
    """The true mechanics and drive of one geared joint, seen from the link.

    Attributes:
        drive: Kind of drive.
        gain: K [effort/(N m)].
        servo_damping: Part of the viscous coefficient that the drive causes [N m s/rad].
        viscous: Part of the viscous coefficient that the gear causes [N m s/rad].
        coulomb: Coulomb level C [N m].
        breakaway: Length over which friction builds up after a reversal [rad].
        rotor_inertia: Reflected rotor inertia J [kg m^2].
        link_inertia: Of the link about the joint [kg m^2].
        gravity: m g l of the link [N m]; the angle 0 hangs down.
        heat_capacity: [J/K].
        ambient: Temperature at the start of every run [deg C].
        bandwidth: Of the outer position loop of a current or voltage drive [rad/s].
    """

    drive: Drive
    gain: float
    servo_damping: float
    viscous: float
    coulomb: float
    breakaway: float
    rotor_inertia: float
    link_inertia: float
    gravity: float
    heat_capacity: float
    ambient: float
    bandwidth: float

    @property
    def damping(self) -> float:
        """B: the whole viscous coefficient [N m s/rad]."""
        return self.servo_damping + self.viscous

    def __post_init__(self) -> None:
        if self.gain <= 0 or self.rotor_inertia <= 0 or self.link_inertia <= 0:
            raise BlindError(
                f"expected positive gain and inertias, got {self.gain}, {self.rotor_inertia}, {self.link_inertia}"
            )


@dataclass(frozen=True)
class Sensors:
    """How the clean signals are spoiled on their way into the file.

    Attributes:
        rate_hz: Rows a second; divides 1000.
        encoder_step: Quantum of position [rad].
        torque_noise: RMS of the torque noise [N m].
        torque_noise_time: Correlation time of the torque noise [s]; 0 is white.
        torque_walk: Standard deviation, after 30 s, of a random walk added to the torque [N m].
        temperature_noise: RMS [K].
        temperature_drift: What the thermometer's own drift adds in 30 s [K].
        torque_bias: Constant error of the torque [N m]. torque_gain: Relative error of the torque.
        torque_band, position_band, command_band: RMS of noise in `band_hz` on that channel as it is recorded, in its
            unit. The joint does not feel it.
        band_hz: Lower and upper limit of that noise [Hz].
        jitter: Uniform half width of the sampling instants, as a share of the period.
        lost: Share of rows lost (single rows and bursts).
    """

    rate_hz: int = 1000
    encoder_step: float = 1e-5
    torque_noise: float = 0.25
    torque_noise_time: float = 0.0
    torque_walk: float = 0.0
    temperature_noise: float = 0.07
    temperature_drift: float = 0.0
    torque_bias: float = 0.0
    torque_gain: float = 0.0
    torque_band: float = 0.0
    position_band: float = 0.0
    command_band: float = 0.0
    band_hz: tuple[float, float] = (1.0, 5.0)
    jitter: float = 0.0
    lost: float = 0.0

    def __post_init__(self) -> None:
        if self.rate_hz < 1 or 1000 % self.rate_hz:
            raise BlindError(f"rate_hz: expected a divisor of 1000, got {self.rate_hz}")


@dataclass(frozen=True)
class RigSpec:
    """One rig of the benchmark.

    Attributes:
        name: Folder name; says nothing about the cause.
        group: `single`, `pair`, `null` or `outside`.
        kind: The effect, `a+b`, the kind of null, or the outside cause.
        strength: `weak`, `middle`, `strong`; empty for nulls.
        targets: Intended strength of each cause [N m RMS beyond refitting gain, viscous, Coulomb].
        joint: The true joint.
        causes: Cause id to its parameters; the amplitude is still a guess until `calibrate` has set it.
        sensors: The sensors.
        pendulum: (mass, length) of a pendulum load without torque sensor, or None.
        motor_position: Whether `joint/motor_position` is logged.
        file_format: Of the runs.
        seed: Of everything random in this rig.
        duration: Of each run [s].
        pace: Speed of the references against the usual one; 0.3 is a slow rig.
        declares_sensors: Whether the rig file says what the torque sensor's noise and the encoder's step are.
        sine_pace: The same of the run `sine` alone; 2 makes it ask for as much effort as the held-out run.
        hand: Loads by hand against the usual ones.
    """

    name: str
    group: str
    kind: str
    strength: str
    joint: Joint
    seed: int
    causes: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    targets: Mapping[str, float] = field(default_factory=dict)
    sensors: Sensors = field(default_factory=Sensors)
    pendulum: tuple[float, float] | None = None
    motor_position: bool = False
    file_format: FileFormat = "csv"
    duration: float = 30.0
    pace: float = 1.0
    declares_sensors: bool = False
    sine_pace: float = 1.0
    hand: float = 1.0

    @property
    def declared_inertia(self) -> float:
        """J that the rig file declares; 0 where the rotor's inertia is the missing cause [kg m^2]."""
        return 0.0 if "rotor_inertia" in self.causes else self.joint.rotor_inertia

    @property
    def link_side(self) -> bool:
        """Whether the logged position is the link's, behind a gap or a spring."""
        return "backlash" in self.causes or "elasticity" in self.causes
