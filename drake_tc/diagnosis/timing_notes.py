"""Notes on the instants at which the columns of a log were sampled."""

from dataclasses import dataclass

from drake_tc.effects.context import DriveKind


@dataclass(frozen=True)
class DelayBySampling:
    """A delay that is partly or wholly explained by the instants of sampling.

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
class AllRecordedLate:
    """The efforts of all joints act before they are recorded, by `lead` [s]; `drive` is None of several kinds."""

    drive: DriveKind | None
    lead: float


@dataclass(frozen=True)
class PositionRecordedLate:
    """The position is recorded `lead` [s] after it was measured."""

    lead: float


@dataclass(frozen=True)
class TorqueRecordedLate:
    """The load torque is recorded `lead` [s] after it was measured."""

    lead: float


@dataclass(frozen=True)
class HeldEffort:
    """The effort is taken to act unchanged from one sample to the next, one period [s]."""

    drive: DriveKind
    period: float


@dataclass(frozen=True)
class ViscousByAge:
    """Possible error of the viscous friction of a position servo, whose command has an unknown age within one period.

    Attributes:
        shift: Largest error +-K T/2 [N m s/rad], with the stiffness K of the servo [N m/rad].
        period: Sampling period T [s].
    """

    shift: float
    period: float


@dataclass(frozen=True)
class LateCommand:
    """A delay of the command alone that fits hardly worse than the delay of the loop that was found.

    Attributes:
        delay: Of the command [s]. viscous: friction beside it [N m s/rad]. found: the same beside the loop's delay.
        ratio: Its error over that of the delay that was found.
    """

    delay: float
    viscous: float
    found: float
    ratio: float


@dataclass(frozen=True)
class UnknownAge:
    """What is left may come from a command of unknown age within one sampling period [s]."""

    period: float
