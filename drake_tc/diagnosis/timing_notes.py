"""What the reader of a result must know of the instants at which its columns were sampled."""

from dataclasses import dataclass

from drake_tc.effects.context import DriveKind


@dataclass(frozen=True)
class DelayBySampling:
    """How much of a delay the instants of sampling may be.

    Attributes:
        name: "delay" or "lag". value: of it [s]. period: of the sampling [s].
    """

    name: str
    value: float
    period: float


@dataclass(frozen=True)
class OlderEffort:
    """The effort that acts is `age` [s] older than the one that is recorded, within one period [s]."""

    drive: DriveKind
    age: float
    period: float


@dataclass(frozen=True)
class RecordedLate:
    """The effort acts before it is recorded, by `lead` [s]."""

    drive: DriveKind
    lead: float


@dataclass(frozen=True)
class PositionRecordedLate:
    """The position is recorded after it was measured, by `lead` [s]."""

    lead: float


@dataclass(frozen=True)
class HeldEffort:
    """The effort is taken to act unchanged from one sample to the next, one period [s]."""

    drive: DriveKind
    period: float


@dataclass(frozen=True)
class ViscousByAge:
    """Viscous friction that a position servo's command adds or takes away where its age within a period is not known.

    Attributes:
        shift: K T/2, on either side [N m s/rad].
        period: T [s].
    """

    shift: float
    period: float
