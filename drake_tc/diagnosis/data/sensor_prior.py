"""What the prior of a joint's own sensor errors counts against the rows."""

from dataclasses import dataclass


@dataclass(frozen=True)
class SensorPrior:
    """Weight of the tolerances in a joint's regression: see `effects.within_tolerance`.

    A parameter of tolerance t has the precision (sigma^2/share)/t^2, in units in which a row's squared residual counts
    1.

    Attributes:
        variance: sigma^2 of the residual [N^2 m^2]; each fit then takes its own.
        share: n/N of N rows that are correlated in time and say as much as n independent ones.
    """

    variance: float
    share: float

    @property
    def weight(self) -> float:
        """sigma^2/share [N^2 m^2]: the precision of a parameter of tolerance 1."""
        return self.variance / self.share
