"""Physical parameters of a fit with 95 % intervals, shape parameters and drive gain included."""

from dataclasses import dataclass

import numpy as np

from drake_tc.types import FloatArray


@dataclass(frozen=True)
class Estimate:
    """One parameter: value, unit, 95 % interval that accounts for autocorrelation, and whether it rests on a bound.

    The interval has an infinite end where the parameter acts as the others together do (`is_identified`).
    """

    value: float
    unit: str
    ci95: tuple[float, float]
    at_bound: bool

    @property
    def is_identified(self) -> bool:
        """Whether the interval is finite."""
        return bool(np.isfinite(self.ci95).all())


@dataclass(frozen=True, eq=False)
class Correlation:
    """Correlation (p, p) of parameters, named "effect.parameter"; the drive gain is "drive.gain"."""

    names: tuple[str, ...]
    matrix: FloatArray

    def of(self, one: str, other: str) -> float:
        """Correlation of two parameters."""
        return float(self.matrix[self.names.index(one), self.names.index(other)])


def rests_on_bound(value: float, low: float, high: float) -> bool:
    """Whether a value is one of its bounds, up to rounding."""
    return bool(min(abs(value - low), abs(value - high)) <= 1e-9 * max(1.0, abs(value)))
