"""Notes on what raises the noise floor (`drake_tc.diagnosis.notes`)."""

from dataclasses import dataclass

from drake_tc.effects.context import DriveKind


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


NoiseNote = NoiseOfRecordedEffort | ScatteringTimes | CorrelatedTorqueNoise
"""On what raises the noise floor."""
