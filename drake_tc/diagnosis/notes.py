"""What the reader of a result must know beside its numbers: one small record a kind, with its figures.

`drake_tc.report.sentences.notes` makes the sentences.
"""

from dataclasses import dataclass
from typing import Literal

from drake_tc.diagnosis.link_notes import LoadInAllRuns
from drake_tc.diagnosis.load_notes import ConstantBesidePendulum
from drake_tc.diagnosis.noise_notes import NoiseNote
from drake_tc.diagnosis.timing_notes import (
    AllRecordedLate,
    DelayBySampling,
    HeldEffort,
    LateCommand,
    OlderEffort,
    PositionRecordedLate,
    RecordedLate,
    TorqueRecordedLate,
    UnknownAge,
    ViscousByAge,
)
from drake_tc.effects.context import DriveKind

FreeRunObstacle = Literal["load_beyond_gear", "no_fitted_inertia", "no_inertia", "nothing_to_simulate"]


@dataclass(frozen=True)
class LogRemark:
    """What the reader of a log did to it.

    Attributes:
        run: Name of the log's run. statement: the reader's own sentence (`Run.notes`).
    """

    run: str
    statement: str


@dataclass(frozen=True)
class SilentEffort:
    """A recorded effort that is exactly 0 in this share of the samples in motion of a run."""

    run: str
    column: str
    share: float


RunNote = LogRemark | SilentEffort
"""What concerns one run; the same may hold for others."""


@dataclass(frozen=True)
class TorqueAsCommanded:
    """The load is unknown, and the drive is taken to give the torque that it is asked for."""


@dataclass(frozen=True)
class ScaleOfRotorInertia:
    """The load is unknown, and the declared rotor inertia [kg m^2] alone fixes the scale of the torques."""

    rotor_inertia: float


@dataclass(frozen=True)
class TorqueAsEffort:
    """The load is unknown, and nothing fixes the scale of the torques.

    Attributes:
        drive: Kind of drive, whose effort they are told as. declares_inertia: whether a rotor inertia is declared.
    """

    drive: DriveKind
    declares_inertia: bool


@dataclass(frozen=True)
class GainOfTorqueDrive:
    """A drive that is commanded in N m, and whose gain is not 1.

    Attributes:
        gain: Commanded torque for one N m at the joint. low, high: its 95 % interval.
    """

    gain: float
    low: float
    high: float


@dataclass(frozen=True)
class SizeByRotorInertia:
    """Effects, by title, whose size only the declared rotor inertia fixes, because no drive gain is declared."""

    effects: tuple[str, ...]


@dataclass(frozen=True)
class FarFromRotor:
    """A payload, by title, whose inertia is `ratio` times the declared rotor inertia."""

    effect: str
    ratio: float


@dataclass(frozen=True)
class LoadWithRotor:
    """Effects, by title, that depend on a load torque whose fitted inertia includes that of the rotor."""

    effects: tuple[str, ...]


@dataclass(frozen=True)
class PayloadFromRatio:
    """A payload on a pendulum under a drive whose gain is not declared: only its ratio of inertia to moment shows.

    Attributes:
        least: Its smallest moment m g l [N m], of a mass close to the axis.
        like_pendulum: Its moment [N m] if it has the pendulum's own ratio of inertia to moment; None where the logs
            rule that out, or where the runs have different pendulums.
    """

    least: float
    like_pendulum: float | None


@dataclass(frozen=True)
class GainBesideEffects:
    """With effects that scale the torques, the drive gain is not the declared one.

    Attributes:
        effects: Their titles. drive: kind of drive. gain, declared: [effort/(N m)].
    """

    effects: tuple[str, ...]
    drive: DriveKind
    gain: float
    declared: float


@dataclass(frozen=True)
class GainDeclaredWrong:
    """What the error of the declared drive gain is in the terms of the rig file.

    Attributes:
        drive: Kind of drive. gain, declared: [effort/(N m)].
        factor: Torque that a unit of effort makes, over the declared one.
    """

    drive: DriveKind
    gain: float
    declared: float
    factor: float


@dataclass(frozen=True)
class ZeroOfEffort:
    """An offset of the effort that a data sheet may allow, and that would look like an effect that was found.

    Attributes:
        effect: Title of the effect. drive: kind of drive. offset: [effort]. share: of the largest effort in the logs.
    """

    effect: str
    drive: DriveKind
    offset: float
    share: float


@dataclass(frozen=True)
class ServoDamping:
    """The servo's own damping is part of the identified viscous friction.

    Attributes:
        viscous: Identified friction [N m s/rad]. servo: damping by the declared derivative gain [N m s/rad].
        exceeds: Whether the damping lies above the interval of the friction.
    """

    viscous: float
    servo: float
    exceeds: bool


@dataclass(frozen=True)
class GearBetweenEncoders:
    """What two encoders show of the gear, with 95 % intervals; None where they do not resolve it.

    Attributes:
        play: (value, low, high) of the whole gap [rad]. compliance: (value, low, high) [rad/(N m)].
    """

    play: tuple[float, float, float] | None
    compliance: tuple[float, float, float] | None


@dataclass(frozen=True)
class Sticking:
    """Static friction of a joint.

    Attributes:
        level: F_s, median of the break-away torques [N m]. low, high: its 95 % interval.
        sliding: Coulomb and Stribeck friction of the model [N m]. events: number of events.
    """

    level: float
    low: float
    high: float
    sliding: float
    events: int


@dataclass(frozen=True)
class RunsWithoutMotion:
    """Runs that have no stretch of motion as long as the filter window [s]."""

    runs: tuple[str, ...]
    window: float


@dataclass(frozen=True)
class ChargedIntegrator:
    """The servo's integral was not zero when the runs began, so channels are taken less their means."""


@dataclass(frozen=True)
class GapCrossings:
    """Rows near a sign change of the load torque take no part, because the teeth of the gear are apart there.

    Attributes:
        within: Time before and after the sign change [s].
    """

    within: float


@dataclass(frozen=True)
class NoFreeRun:
    """A joint without a free run.

    Attributes:
        reason: "load_beyond_gear", an effect depends on the torque at the gear, which a fitted smooth load does not
            pass; "no_fitted_inertia" and "no_inertia", nothing that a torque could accelerate, with an unknown load
            and with a known one; "nothing_to_simulate", no held-out run has a usable stretch.
    """

    reason: FreeRunObstacle


@dataclass(frozen=True)
class FreeRunDiverges:
    """Runs on which the free run of the model "before", "after" or "refined" leaves the finite numbers."""

    model: str
    runs: tuple[str, ...]


ScaleNote = TorqueAsCommanded | ScaleOfRotorInertia | TorqueAsEffort
"""On what fixes the scale of the torques of an unknown load."""
GainNote = (
    GainOfTorqueDrive
    | SizeByRotorInertia
    | FarFromRotor
    | LoadWithRotor
    | PayloadFromRatio
    | GainBesideEffects
    | GainDeclaredWrong
)
"""On the gain of a drive, and what else scales the torques."""
DriveNote = (
    GainNote
    | ZeroOfEffort
    | ConstantBesidePendulum
    | DelayBySampling
    | OlderEffort
    | RecordedLate
    | AllRecordedLate
    | PositionRecordedLate
    | TorqueRecordedLate
    | HeldEffort
    | ViscousByAge
    | LateCommand
    | UnknownAge
    | ServoDamping
)
"""On the drive that the rig file describes."""
Note = (
    RunNote
    | ScaleNote
    | DriveNote
    | GearBetweenEncoders
    | Sticking
    | NoiseNote
    | LoadInAllRuns
    | RunsWithoutMotion
    | GapCrossings
    | ChargedIntegrator
    | NoFreeRun
    | FreeRunDiverges
)
