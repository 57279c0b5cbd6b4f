"""What the reader of a result must know beside its numbers: one small record a kind, with its figures.

`drake_tc.report.notes` makes the sentences.
"""

from dataclasses import dataclass
from typing import Literal

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
class NoiseOfRecordedEffort:
    """White noise of the recorded effort makes the noise floor this many times that of the sensors."""

    drive: DriveKind
    ratio: float


@dataclass(frozen=True)
class ScatteringTimes:
    """The instants at which a position was sampled scatter about their time stamps.

    Attributes:
        scatter: Standard deviation [s]. speed: of the fastest motion [rad/s].
        noise: Of one position of a joint at rest [rad].
    """

    scatter: float
    speed: float
    noise: float


@dataclass(frozen=True)
class CorrelatedTorqueNoise:
    """Noise of the torque, correlated over a time [s], makes the noise floor `ratio` times that of white noise."""

    ratio: float
    correlation_time: float


@dataclass(frozen=True)
class RunsDiffer:
    """The friction of the held-out runs is other than that of the training runs, no more than runs differ.

    The noise floor with this difference is `ratio` times that without.
    """

    ratio: float


@dataclass(frozen=True)
class LoadInAllRuns:
    """A mass that is larger than the link itself, as a load in all runs is.

    Attributes:
        link: Where it was found. mass: found beyond the robot file's [kg]. own: that of the robot file [kg].
    """

    link: str
    mass: float
    own: float


@dataclass(frozen=True)
class RunsWithoutMotion:
    """Runs that have no stretch of motion as long as the filter window [s]."""

    runs: tuple[str, ...]
    window: float


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
NoiseNote = NoiseOfRecordedEffort | ScatteringTimes | CorrelatedTorqueNoise | RunsDiffer
"""On what raises the noise floor."""
Note = RunNote | ScaleNote | NoiseNote | LoadInAllRuns | RunsWithoutMotion | NoFreeRun | FreeRunDiverges
