"""What else may be in a load that is fitted because nothing is known of it."""

from dataclasses import dataclass

from drake_tc.effects.context import DriveKind


@dataclass(frozen=True)
class ConstantBesidePendulum:
    """An unknown pendulum with a constant torque, which no pendulum has.

    Attributes:
        drive: Kind of drive. effort: what the constant is worth [effort]. share: of the Coulomb friction.
    """

    drive: DriveKind
    effort: float
    share: float
