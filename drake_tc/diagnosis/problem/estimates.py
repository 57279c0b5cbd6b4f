"""Physical parameters of a fit with 95 % intervals, shape parameters and drive gain included."""

from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns
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


def block_lengths(columns: Columns) -> list[int]:
    """Rows in each contiguous stretch: autocorrelation is not counted across gaps."""
    rows = columns.samples.rows
    typical = int(np.median(np.diff(rows)))
    ends = np.array([s.stop for s in columns.samples.segments])
    segment = np.searchsorted(ends, rows, side="right")
    cuts = np.flatnonzero((np.diff(rows) > 50 * typical) | (np.diff(segment) != 0)) + 1
    return [int(n) for n in np.diff(np.concatenate([[0], cuts, [rows.size]]))]


def rests_on_bound(value: float, low: float, high: float) -> bool:
    """Whether a value is one of its bounds, up to rounding."""
    return bool(min(abs(value - low), abs(value - high)) <= 1e-9 * max(1.0, abs(value)))
